"""EPICS analog records as a converter: its driver is `driver.py`, its simulated instrument `twin.py`."""
