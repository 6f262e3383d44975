"""Residuals in what is sensed: mg, thousandths of the field, or mdeg/s.

At one orientation the scale factor is not known: there they are in mV.
"""

from __future__ import annotations

import numpy as np

from calibrations.fitting.fit import Fit
from calibrations.geometry.orientation import one_orientation
from calibrations.table import MILLI, Array


def scales(fit: Fit) -> Array:
    """Output per g, or deg/s, of each channel; 1 for a residual in what is sensed, or where that is not known."""
    if fit.table.type.magnitude:
        return np.ones(1)
    if one_orientation(fit.table):
        return np.ones(len(fit.channels))
    effect = "gyro-scale-factor" if fit.table.type.turning else "scale-factor"
    axes, nominal = [axis_of(channel) for channel in fit.channels], fit.problem.layout.nominal
    return np.abs([fit.model.value(f"{effect}.{axis}", nominal) for axis in axes])


def axis_of(channel: str) -> str:
    """The axis that a channel belongs to: "x" of "x in phase at 10 Hz"; itself where it has no parts."""
    return channel.partition(" ")[0]


def milli_unit(fit: Fit) -> str:
    """The unit of `in_milli`."""
    return f"m{fit.problem.unit}" if one_orientation(fit.table) else MILLI[fit.table.input_unit]


def in_milli(values: Array, fit: Fit) -> Array:
    """Values per channel, in the residual's unit, as mg, thousandths of the field, or mdeg/s."""
    return np.asarray(1e3 * values / scales(fit))


def pool_in_milli(fit: Fit) -> tuple[float, float]:
    """Rms of the residual over all channels, and the noise floor, in the unit of `in_milli`."""
    error, floor = in_milli(fit.rmse, fit), in_milli(fit.noise.floor, fit)
    return float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(floor**2)))
