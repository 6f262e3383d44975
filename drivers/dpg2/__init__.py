"""Digi-Pas DPG2: digital level. The driver is `driver.py`, its simulated instrument `twin.py`."""
