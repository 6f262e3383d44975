"""PI E-727: controller of the nano-positioner. The driver is `driver.py`, its simulated instrument `twin.py`."""
