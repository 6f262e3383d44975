"""A sensor in a simulated hand: `triad.py` is the sensor, `hand.py` the hand, `world.py` the world with both."""
