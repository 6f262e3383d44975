"""Fleets: analyse thousands of sensors on Dask workers, and store the answers in the record."""
