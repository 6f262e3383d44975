"""Fleets: thousands of sensors brought to workers on Dask, and what they find brought into the record."""
