"""Analyses of a procedure's table: soak, tumble, misalignment, stepwise estimation, field, stability, control chart."""
