"""Any SCPI multimeter or scanner: its driver is `driver.py`, its simulated instrument `twin.py`."""
