from functools import partial
from itertools import permutations

import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.geometry.rate_table import is_turned
from calibrations.table import AXES, Array, Table

PAIRS = tuple(permutations(AXES, 2))


def _lean(axis: str, towards: str) -> Parameter:
    return Parameter(
        "deg",
        typical=2.0,
        per_axis=False,
        low=-45.0,
        high=45.0,
        where=f"turned_{towards}",
        doc=f"lean of the sensing axis {axis} towards {towards}",
    )


class GyroMisalignment(Effect):
    """gyro-misalignment: the sensing axes of a gyroscope are not parallel to the reference edges.

        x = (r, xy, xz)      y = (yx, r, yz)      z = (zx, zy, r)

        the sensing axes as unit vectors; r makes their length 1; in deg, as sines: xy is the response of x to a turn
        about y

    Symptom   the output follows the rate about another axis, with opposite signs for opposite directions.
    Excited by  turns about each axis in both directions; a turn about z shows xz and yz only.
    Confused with  gyro-g-sensitivity, if the orientation while turning differs from the orientation at rest.
    Source    Book 17.3.9; Ferraris, Grimaldi and Parvis, Sensors and Materials 7 (1995); IEEE Std 528, misalignment.
    """

    kinds = ("rates", "turns")
    exact = True

    xy = _lean("x", "y")
    xz = _lean("x", "z")
    yx = _lean("y", "x")
    yz = _lean("y", "z")
    zx = _lean("z", "x")
    zy = _lean("z", "y")
    turned_x = Constant(partial(is_turned, axis=0), doc="turns about x measured (1: yes, 0: no)")
    turned_y = Constant(partial(is_turned, axis=1), doc="turns about y measured (1: yes, 0: no)")
    turned_z = Constant(partial(is_turned, axis=2), doc="turns about z measured (1: yes, 0: no)")

    def force(self, a: Array, table: Table, p: Values) -> Array:
        axes: Array = np.zeros((3, 3))
        for axis, towards in PAIRS:
            axes[AXES.index(axis), AXES.index(towards)] = np.sin(np.radians(p[axis + towards]))
        np.fill_diagonal(axes, np.sqrt(np.maximum(0.0, 1 - np.sum(axes**2, axis=1))))
        return a @ axes.T
