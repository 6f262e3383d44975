"""The electronics inside a digital sensor: the analog output, less its nominal zero, divided by its nominal gain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from drivers.errors import did_you_mean
from drivers.world.errors import UnknownInput
from drivers.world.kernel import Floats


@dataclass(frozen=True)
class Trim:
    """The analog input behind a digital output, its nominal zero in V, and its gain in V per g, deg/s or uT."""

    analog: str
    zero_v: float = 0.0
    gain_v: float = 1.0


ACCELEROMETER = {f"a{axis}": Trim(f"v{axis}", 2.5, 1.0) for axis in "xyz"}
GYROSCOPE = {f"g{axis}": Trim(f"g{axis}", 2.5, 6e-3) for axis in "xyz"}
MAGNETOMETER = {f"m{axis}": Trim(f"m{axis}", 0.0, 0.02) for axis in "xyz"}
VOLTAGES = {name: Trim(name) for name in ("supply", "d63")}  # of a converter on the sensor's board
TRIMS: Mapping[str, Trim] = MappingProxyType(ACCELEROMETER | GYROSCOPE | MAGNETOMETER | VOLTAGES)


def trims(names: Sequence[str], trims_by_name: Mapping[str, Trim]) -> list[Trim]:
    """The trims of these outputs. Raises UnknownInput for one that the simulated sensor does not have."""
    for name in names:
        if name not in trims_by_name:
            raise UnknownInput(f"the simulated sensor has no output {name!r}", did_you_mean(name, trims_by_name))
    return [trims_by_name[name] for name in names]


def trim_outputs(volts: Floats, trims: Sequence[Trim]) -> Floats:
    """Outputs in g, deg/s, uT and V, shape (n, outputs)."""
    return np.asarray((volts - [trim.zero_v for trim in trims]) / [trim.gain_v for trim in trims])
