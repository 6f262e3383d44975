"""The values of an effect that its picture shows, and the panels that the picture is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.effect import Effect, Parameter
from calibrations.table import Array, Table

ACROSS = np.array([1.0, 0.6, 1.0])  # parameters of each axis, times those of x: no two are alike

# values for all axes that show an effect, where a parameter's typical one is only a step or a level
SHOWN: Mapping[str, Mapping[str, float]] = {
    "bias": {"bias": 0.02},
    "scale-factor": {"scale": 0.02},
    "quantisation": {"step": 0.5, "noise": 0.01, "offset": 0.07},
    "saturation": {"high": 3.3, "low": 1.6},
    "adc-nonlinearity": {"bend": -0.004},
    "stage-zero-offset": {"beta": 0.5},
    "stage-eccentricity": {"cosine": 0.1},
    "base-tilt": {"y": 0.5},
    "axis-misalignment": {"y": 1.0, "z": 0.5},
    "temperature-hysteresis": {"play": 1.0},
    "field-strength": {"total": 1.1},
    "hard-iron": {"offset": 0.2},
    "soft-iron": {"xx": 0.05, "yy": -0.02, "xy": 0.03, "xz": 0.0, "yz": -0.02},
    "gyro-bias": {"bias": 1.0},
    "gyro-scale-factor": {"scale": 1.02},
    "gyro-misalignment": {"xy": 0.5, "xz": 1.0, "yx": -0.5, "yz": 0.3, "zx": 0.0, "zy": -1.0},
    "gyro-g-sensitivity": {"x": 0.1, "y": 0.0, "z": -0.05},
}


@dataclass(frozen=True)
class Curve:
    """Rows that one line joins."""

    label: str
    colour: str
    style: str
    rows: NDArray[np.intp]


@dataclass(frozen=True)
class Panel:
    """What is left of one axis, in `unit`, shape (n,), over a column of that shape, and the rows that lines join."""

    axis: str
    left: Array
    over: Array
    label: str
    curves: tuple[Curve, ...]
    unit: str = "mV"


def shown(effect: Effect, table: Table) -> dict[str, Array]:
    """The values that are shown, and the effect's constants."""
    constants = {name: np.asarray(make(table)) for name, make in effect.constants.items()}
    return {**constants, **{p.name: shown_value(p, effect) for p in effect.parameters}}


def shown_value(p: Parameter, effect: Effect) -> Array:
    """What a sensor may typically show, of shape (3,) if per axis."""
    typical = p.typical if p.starts == (0.0,) else p.starts[-1]
    chosen = SHOWN.get(effect.name, {})
    across = np.ones(3) if p.name in chosen else ACROSS
    value = chosen.get(p.name, typical)
    return value * across if p.per_axis else np.asarray(value)
