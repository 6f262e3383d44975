"""gyro-misalignment: the sensing axes of a gyroscope are not along the reference edges.

    x = (r, xy, xz)      y = (yx, r, yz)      z = (zx, zy, r)

    the sensing axes as unit vectors, r what makes their length 1; in deg as sines: xy is what x feels of a turn about y

Symptom   outputs follow the rate about another axis, with opposite sign when turned the other way.
Excited by  turns about each axis, both ways; a turn about z shows xz and yz only.
Confused with  gyro-g-sensitivity, where the sensor lies otherwise in a turn than at rest.
Source    Book 17.3.9; Ferraris, Grimaldi and Parvis, Sensors and Materials 7 (1995); IEEE Std 528, misalignment.
"""

from collections.abc import Callable
from functools import partial
from itertools import permutations

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import AXES, Array, Table
from calibrations.turning import scales

KINDS = ("rates",)
EXACT = True
PAIRS = tuple(permutations(AXES, 2))
PARAMETERS = tuple(
    Parameter(own + other, "deg", typical=2.0, per_axis=False, low=-45.0, high=45.0, where=f"turned_{other}",
              doc=f"lean of the sensing axis {own} towards {other}")
    for own, other in PAIRS
)  # fmt: skip


def _turned(table: Table, axis: int) -> float:
    return float(scales(table)[axis] != 0)


CONSTANTS: dict[str, Callable[[Table], float]] = {
    f"turned_{axis}": partial(_turned, axis=k) for k, axis in enumerate(AXES)
}


def force(a: Array, table: Table, p: Values) -> Array:
    axes: Array = np.zeros((3, 3))
    for own, other in PAIRS:
        axes[AXES.index(own), AXES.index(other)] = np.sin(np.radians(p[own + other]))
    np.fill_diagonal(axes, np.sqrt(np.maximum(0.0, 1 - np.sum(axes**2, axis=1))))
    return a @ axes.T
