"""Oriental Motor AZ: drive of a rotary stage. The driver is `driver.py`, its simulated instrument `twin.py`."""
