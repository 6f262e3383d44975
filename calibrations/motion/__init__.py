"""Motion: a sensor with a displacement sensor; reference acceleration, evaluation, rows for the fit."""
