"""The noise of means: white noise of one mean, slow noise from row to row, and columns made white."""
