"""The measurement model of an inertial sensor, and the search for the physical effect that the model misses.

A library of its own: tables in, frozen results out, no instrument needed.

    import calibrations as cal

    data = cal.read("sweep.csv")
    found = cal.fit(data, "linear")
    found.params["scale-factor.x"].value

    read, table      data            fit, compare       a model beside data
    diagnose         missing effects discover           missing effects, added one by one
    noise            noise of a still sensor
    compensate       outputs back to specific force
    add              a model with one effect more
    Effect, Parameter  what a class of your own needs to be an effect

The functions are in `calibrations.face`, and load what they need when they are called.
"""

from __future__ import annotations

import calibrations.noise
import calibrations.table  # noqa: F401 both are bound before the functions of the same names, which replace them
from calibrations.effects import Effect, Parameter
from calibrations.face import add, compare, compensate, diagnose, discover, fit, noise, read, table

__all__ = [
    "Effect", "Parameter", "add", "compare", "compensate", "diagnose", "discover", "fit", "noise", "read", "table",
]  # fmt: skip
