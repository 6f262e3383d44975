"""One sensing axis by Ang's equations: coefficients found one after another, each from its own part of the data.

    B, SF       output along and against gravity at alpha = 90 deg                      (1)-(2)
    g(V_p)      quadratic in the other axis's output: what the line (8) leaves there    (9)-(11)
    h(V_z)      quadratic in a_z: bias at an inclination less that at 90 deg            (12)-(13)
    SF(V_z)     quadratic in a_z: scale factor at an inclination                        (15), (17)

V_z is in units of V_g^z, the z output to 1 g, as the sensor has no z channel: while calibrating it is cos(alpha).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.evaluations.stepwise_planes import Plane
from calibrations.table import Array


@dataclass(frozen=True)
class AxisEstimate:
    """Coefficients of one axis. `p`, `q`, `r` have shape (3,), the square's first, as in the paper."""

    axis: str
    bias: float  # B^90, V
    scale: float  # SF^90, V/g
    p: Array  # 1/V, V/V, V
    q: Array  # V/g^2, V/g, V
    r: Array  # V/g^3, V/g^2, V/g

    def linear(self, v: Array) -> Array:
        """Acceleration by the manufacturer's method, g. Ang (3)."""
        return (v - self.bias) / self.scale

    def line(self, a: Array) -> Array:
        """Output by the manufacturer's method, V. Ang (8)."""
        return a * self.scale + self.bias

    def acceleration(self, v: Array, other: Array, a_z: Array) -> Array:
        """Acceleration, g, from this output and that of the other axis, V. Ang (14), (16)."""
        return (v - self._bias_at(other, a_z)) / np.polyval(self.r, a_z)

    def output(self, a: Array, other: Array, a_z: Array) -> Array:
        """Output, V, from the acceleration, g, and the other axis's output: Ang (14), (16) the other way round."""
        return a * np.polyval(self.r, a_z) + self._bias_at(other, a_z)

    def _bias_at(self, other: Array, a_z: Array) -> Array:
        """Ang (9)."""
        return np.asarray(self.bias + np.polyval(self.p, other) + np.polyval(self.q, a_z))


def estimate_axis(axis: str, planes: Sequence[Plane], v: Array, other: Array, a: Array) -> AxisEstimate:
    """The axis's coefficients, from its planes, and from the rows at 90 deg for the step that needs a full turn.

    `v` output, `other` output of the other axis, V, and `a` specific force, g: of the rows at 90 deg.
    """
    vertical = next(plane for plane in planes if plane.vertical)
    a_z = np.array([plane.a_z for plane in planes])
    shift = np.array([plane.bias - vertical.bias for plane in planes])
    return AxisEstimate(
        axis=axis,
        bias=vertical.bias,
        scale=vertical.scale,
        p=_quadratic(other, v - (a * vertical.scale + vertical.bias)),
        q=_quadratic(a_z, shift),
        r=_quadratic(a_z, np.array([plane.scale for plane in planes])),
    )


def _quadratic(x: Array, y: Array) -> Array:
    """Least-squares polynomial of second order, the square's coefficient first, shape (3,)."""
    return np.asarray(np.linalg.lstsq(np.vander(x, 3), y, rcond=None)[0])
