"""The paper's own estimation, Ang (1)-(17), step by step and axis by axis, to compare with the joint `fit`.

The coefficients of one sensing axis are estimated one after another, each from its own part of the data:

    B, SF       output along and against gravity at alpha = 90 deg                      (1)-(2)
    g(V_p)      quadratic in the other axis's output: residual of the line (8)          (9)-(11)
    h(V_z)      quadratic in a_z: bias at an inclination less that at 90 deg            (12)-(13)
    SF(V_z)     quadratic in a_z: scale factor at an inclination                        (15), (17)

V_z is in units of V_g^z, the z output to 1 g, as the sensor has no z channel: during the calibration it is cos(alpha).

The poses are an axis up and an axis down at each inclination, and the turn at 90 deg. They are identified by the
specific force at their angles, not by the angles: this includes alpha and -alpha, a turned mount, and a sensor face
down.

The terms overlap. A tilt of the sensing axis is linear in the other two components of gravity, so it is a part of p1
and q1. The correction (20) by the angles of a search subtracts it a second time. `Tilt` has the size of this.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.geometry.orientation import reported_force
from calibrations.importing.foreign import require_kind
from calibrations.means.noise import rms
from calibrations.table import Array, Table

DECIMALS = 1  # of an inclination in deg: the digital level's resolution
UP_AND_DOWN_DEG = ((0, 180), (90, 270))  # beta where x, y are held up and down, at alpha = 90


@dataclass(frozen=True)
class Plane:
    """One inclination: the mean output where the axis is held up, and where it is held down, V; a_z in g."""

    inclination_deg: float
    a_z: float
    up: float
    down: float

    @property
    def vertical(self) -> bool:
        """Whether the sensing plane is vertical: alpha = 90 deg."""
        return self.inclination_deg == 90

    @property
    def bias(self) -> float:
        """V. Ang (2)."""
        return (self.up + self.down) / 2

    @property
    def scale(self) -> float:
        """V/g. Ang (1) holds at 90 deg; at another inclination the result is divided by sin(alpha)."""
        return (self.up - self.down) / (2 * float(np.sqrt(1 - self.a_z**2)))


def in_vertical_plane(a: Array) -> NDArray[np.bool_]:
    """Rows at alpha = 90 deg, of specific force `a`, shape (n, 3)."""
    return np.asarray(_inclinations(a) == 90)


def inclination_planes(table: Table, k: int, v: Array, a: Array) -> list[Plane]:
    """Every inclination at which axis `k` (0 or 1) was measured up and down; outputs `v` (n,), repetitions averaged.

    Raises DataError if the one at 90 deg is not among them, or fewer than three are.
    """
    planes = list(_planes(k, v, a))
    up, down = UP_AND_DOWN_DEG[k]
    if not any(plane.vertical for plane in planes):
        raise DataError(
            f"{table.source}: the stepwise estimate needs poses at alpha = 90, beta = {up} and {down} deg, "
            f"where {'xy'[k]} is held up and down; measure a full turn at alpha = 90"
        )
    if len(planes) < 3:
        angles = " and ".join(f"{plane.inclination_deg:g}" for plane in planes)
        raise DataError(
            f"{table.source}: the stepwise estimate needs three inclinations with poses at beta = {up} and {down} deg; "
            f"it has {angles} deg; measure full turns at more"
        )
    return planes


def _planes(k: int, v: Array, a: Array) -> Iterator[Plane]:
    inclination = _inclinations(a)
    aligned = np.abs(a[:, 1 - k]) < np.radians(10.0**-DECIMALS)
    for angle in np.unique(inclination):
        rows = aligned & (inclination == angle)
        up, down = rows & (a[:, k] > 0), rows & (a[:, k] < 0)
        if 0 < angle < 180 and up.any() and down.any():
            yield Plane(float(angle), float(np.mean(a[up | down, 2])), float(np.mean(v[up])), float(np.mean(v[down])))


def _inclinations(a: Array) -> Array:
    """Angle between the sensor's z axis and the vertical, deg, 0 to 180, shape (n,)."""
    angle: Array = np.degrees(np.arccos(np.clip(a[:, 2], -1.0, 1.0)))
    return np.asarray(np.round(angle, DECIMALS))


@dataclass(frozen=True)
class AxisEstimate:
    """Coefficients of one axis. `p`, `q`, `r` have shape (3,), the square's first, as in the paper."""

    axis: str
    bias: float  # B^90, V
    scale: float  # SF^90, V/g
    p: Array  # 1/V, V/V, V
    q: Array  # V/g^2, V/g, V
    r: Array  # V/g^3, V/g^2, V/g

    def line(self, a: Array) -> Array:
        """Output by the manufacturer's method, V. Ang (8)."""
        return a * self.scale + self.bias

    def output(self, a: Array, other_output: Array, a_z: Array) -> Array:
        """Output, V, from the acceleration, g, and the other axis's output: the inverse of Ang (14), (16), with (9)."""
        bias = self.bias + np.polyval(self.p, other_output) + np.polyval(self.q, a_z)
        return np.asarray(a * np.polyval(self.r, a_z) + bias)


def estimate_axis(axis: str, planes: Sequence[Plane], v: Array, other_output: Array, a: Array) -> AxisEstimate:
    """The axis's coefficients, from its planes, and from the rows at 90 deg for the step that needs a full turn.

    `v` output and `other_output` of the other axis, V, and `a` specific force, g: of the rows at 90 deg.
    """
    vertical = next(plane for plane in planes if plane.vertical)
    a_z = np.array([plane.a_z for plane in planes])
    shift = np.array([plane.bias - vertical.bias for plane in planes])
    return AxisEstimate(
        axis=axis,
        bias=vertical.bias,
        scale=vertical.scale,
        p=_quadratic(other_output, v - (a * vertical.scale + vertical.bias)),
        q=_quadratic(a_z, shift),
        r=_quadratic(a_z, np.array([plane.scale for plane in planes])),
    )


def _quadratic(x: Array, y: Array) -> Array:
    """Least-squares polynomial of second order, the square's coefficient first, shape (3,)."""
    return np.asarray(np.linalg.lstsq(np.vander(x, 3), y, rcond=None)[0])


@dataclass(frozen=True)
class Tilt:
    """The part of the tilt of one axis in the bias model, as the components of Theta that (20), (21) subtract.

    in_plane      slope of g about the other axis's zero-g output, p1 + 2 p2 B, times SF over SF: 1 is a radian
    out_of_plane  q1 over SF
    twice_mg      rms over the table of what (20) or (21) would take off a second time, mg
    """

    in_plane: float
    out_of_plane: float
    twice_mg: float


@dataclass(frozen=True)
class Stepwise:
    """The estimate for both axes, on the table that it was made from. Arrays have shape (n, 2)."""

    table: Table
    x: AxisEstimate
    y: AxisEstimate

    @cached_property
    def force(self) -> Array:
        """Specific force by the stage angles, g, shape (n, 3)."""
        return reported_force(self.table)

    @cached_property
    def predicted(self) -> Array:
        """Output at each pose, V: each axis needs the output of the other, so both are computed together."""
        a_x, a_y, a_z = self.force.T
        v_x, v_y = self.x.line(a_x), self.y.line(a_y)
        for _ in range(60):  # cross-axis slopes are far below 1: the error falls by their product each time
            v_x, v_y = self.x.output(a_x, v_y, a_z), self.y.output(a_y, v_x, a_z)
        return np.column_stack([v_x, v_y])

    @cached_property
    def linear_predicted(self) -> Array:
        """Output by the manufacturer's method, V. Ang (8)."""
        return np.column_stack([self.x.line(self.force[:, 0]), self.y.line(self.force[:, 1])])

    @property
    def rmse_v(self) -> Array:
        """Root mean square error of the predicted output, V, shape (2,)."""
        return _rmse(self.predicted, self.table.outputs[:, :2])

    @property
    def linear_rmse_v(self) -> Array:
        """The linear model's, V, shape (2,)."""
        return _rmse(self.linear_predicted, self.table.outputs[:, :2])

    @cached_property
    def tilts(self) -> tuple[Tilt, Tilt]:
        """The tilt of x and of y in p1 and q1."""
        return self._tilt(self.x, self.y, 1), self._tilt(self.y, self.x, 0)

    def _tilt(self, axis_estimate: AxisEstimate, other_axis: AxisEstimate, across_axis: int) -> Tilt:
        in_plane = (
            (axis_estimate.p[1] + 2 * axis_estimate.p[0] * other_axis.bias) * other_axis.scale / axis_estimate.scale
        )
        out_of_plane = axis_estimate.q[1] / axis_estimate.scale
        second_order = in_plane * self.force[:, across_axis] + out_of_plane * self.force[:, 2]
        return Tilt(float(in_plane), float(out_of_plane), 1e3 * float(rms(second_order)))


def estimate_stepwise(table: Table) -> Stepwise:
    """Estimate (1)-(17) from full turns at alpha = 90 deg and two more inclinations at least.

    Raises MissingColumn without both outputs, DataError where the poses that an equation needs are not there.
    """
    require_kind(table, "poses")
    v = np.column_stack([table.output("x"), table.output("y")])
    a = reported_force(table)
    turn = in_vertical_plane(a)
    x, y = (
        estimate_axis(axis, inclination_planes(table, k, v[:, k], a), v[turn, k], v[turn, 1 - k], a[turn, k])
        for k, axis in enumerate("xy")
    )
    return Stepwise(table, x, y)


def _rmse(predicted: Array, true: Array) -> Array:
    return rms((predicted - true).T)
