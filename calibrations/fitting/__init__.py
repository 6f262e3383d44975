"""Fitting: identifiable parameters, smooth columns, errors on unseen rows, and which models the data determine."""
