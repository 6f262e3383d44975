"""How fast and how small: `make bench`. One file a subject; nothing here is a test, and no test is timed."""
