"""The measurement model of an inertial sensor, and the search for the physical effect that the model misses.

A library of its own: tables in, frozen results out, no instrument needed.

    import calibrations as cal

    data = cal.read("sweep.csv")
    found = cal.fit(data, "linear")
    found.params["scale-factor.x"].value

    read, table      data            fit, compare       a model compared with data
    diagnose         missing effects discover           missing effects, added one by one
    noise            noise of a still sensor
    compensate       outputs back to specific force
    add              a model with one effect more
    Effect, Parameter, Constant, Values  the names that your own effect class needs
    Table            what `read` and `table` give

The functions are in `calibrations.face`, and load their modules when they are called.
"""

from __future__ import annotations

import calibrations.noise
import calibrations.table  # noqa: F401 both are bound before the functions of the same names, which replace them
from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.face import add, compare, compensate, diagnose, discover, fit, noise, read, table
from calibrations.table import Table

__all__ = [
    "Constant", "Effect", "Parameter", "Table", "Values",
    "add", "compare", "compensate", "diagnose", "discover", "fit", "noise", "read", "table",
]  # fmt: skip


def __getattr__(name: str) -> str:
    """`__version__`, read at the first use. Raises AttributeError."""
    if name == "__version__":
        from importlib.metadata import version  # the import of the library stays short

        return version("inertial-rig")
    raise AttributeError(f"module 'calibrations' has no attribute {name!r}")
