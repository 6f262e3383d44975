"""Omega CN7500: temperature controller of the oven. The driver is `driver.py`, its simulated instrument `twin.py`."""
