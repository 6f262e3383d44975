"""A bench's instruments, connected: their wires, what watches over them, and the person beside them."""
