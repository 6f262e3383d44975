"""gyro-scale-factor: the output of a gyroscope per unit of angular rate.

    V += k w                                          k in {out}/(deg/s), one for each axis that was turned about

An axis that was not turned about is taken to have the mean of the others, for the sake of its misalignment.

Symptom   the residual is proportional to the rate about the axis itself.
Excited by  turns at constant rates, both ways, about each axis.
Confused with  nothing, where the rate takes several values.
Source    Book 17.3.7; IEEE Std 528, scale factor.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import AXES, Array, Table
from calibrations.turning import scales

KINDS = ("rates",)
PARAMETERS = (Parameter("scale", "{out}/(deg/s)", typical=1.0, where="turned", doc="change of output per deg/s"),)
STARTS = {"scale": scales}


def _turned(table: Table, axis: int) -> float:
    return float(scales(table)[axis] != 0)


def _mean_of_turned(table: Table) -> float:
    found = scales(table)
    return float(np.mean(np.abs(found[found != 0])))


CONSTANTS: dict[str, Callable[[Table], float]] = {
    **{f"turned_{axis}": partial(_turned, axis=k) for k, axis in enumerate(AXES)},
    "assumed": _mean_of_turned,
}


def transduction(a: Array, table: Table, p: Values) -> Array:
    turned = np.array([p[f"turned_{axis}"] for axis in AXES]) > 0
    return a * np.where(turned, p["scale"], p["assumed"])
