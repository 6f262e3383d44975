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

The functions are in `calibrations.face` and load when they are used.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calibrations.face import compare, compensate, diagnose, discover, fit, noise, read, table

__all__ = ["compare", "compensate", "diagnose", "discover", "fit", "noise", "read", "table"]


class _Face(ModuleType):
    """Keeps the public functions where the import system would replace them by submodules of the same name."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in __all__ and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Face


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from calibrations import face

    return getattr(face, name)
