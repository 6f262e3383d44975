"""Estimators: unknowns from measurements that are linear in them, all at once or one after another.

    least_squares   all at once, weighted
    kalman          unknowns that change by themselves: prediction and correction
    scatter         the level of a logged column without the scatter of its reader
    approach        an exponential approach to a steady state, followed by a bank of Kalman filters

Source  Book 18.2-18.4, equations (18.1)-(18.10).
"""
