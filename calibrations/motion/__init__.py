"""Motion: a sensor shaken beside a displacement sensor; reference acceleration, evaluation, and rows for the fit."""
