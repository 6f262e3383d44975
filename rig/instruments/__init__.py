"""The instruments of a bench, connected: their wires, the guard that watches them, and the person at the rig."""
