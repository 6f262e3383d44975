"""The kinds of measured data: a class each, which says how the kind differs from the others."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from calibrations.tables.fields import Fields
from calibrations.tables.kind import Kind
from calibrations.tables.motion import Motion
from calibrations.tables.poses import Poses
from calibrations.tables.positions import Positions
from calibrations.tables.rates import Rates
from calibrations.tables.still import Still

KINDS: Mapping[str, Kind] = MappingProxyType(
    {kind.name: kind for kind in (Poses(), Positions(), Motion(), Still(), Rates(), Fields())}
)
FILE_KINDS: Mapping[str, Kind] = MappingProxyType({name: kind for name, kind in KINDS.items() if kind.file == name})
MEANS = tuple(name for name, kind in FILE_KINDS.items() if kind.means)
FITTED = tuple(name for name, kind in FILE_KINDS.items() if kind.fitted)

__all__ = ["FILE_KINDS", "FITTED", "KINDS", "MEANS", "Kind"]
