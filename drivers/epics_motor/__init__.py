"""Any EPICS motor record as a rotary stage: its driver is `driver.py`, its simulated instrument `twin.py`."""
