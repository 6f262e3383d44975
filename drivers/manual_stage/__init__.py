"""A stage that a person turns by hand. The driver is `driver.py`, its simulated instrument `twin.py`."""
