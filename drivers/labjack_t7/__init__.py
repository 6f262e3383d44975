"""LabJack T7: analog-to-digital converter. The driver is `driver.py`, its simulated instrument `twin.py`."""
