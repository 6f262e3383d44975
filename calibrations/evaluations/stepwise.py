"""The paper's own estimation, Ang (1)-(17), step by step and axis by axis; beside the joint one of `fit`.

Its terms overlap. A tilt of the sensing axis is linear in the other two components of gravity, and so ends up in p1
and q1; the correction (20) by the angles of a search then takes it off a second time. `Tilt` says how much that is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibrations.chain import nominal_pose, specific_force
from calibrations.evaluations.stepwise_axis import AxisEstimate, estimate_axis
from calibrations.evaluations.stepwise_planes import in_vertical_plane, planes
from calibrations.noise import rms
from calibrations.reading.read_csv import require_kind
from calibrations.table import Array, Table


@dataclass(frozen=True)
class Tilt:
    """Tilt of one axis that the bias model has already taken up, as the components of Theta that (20), (21) subtract.

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
        return specific_force(nominal_pose(self.table))

    @cached_property
    def predicted(self) -> Array:
        """Output at each pose, V: each axis needs the other's output, so both are solved for together."""
        a_x, a_y, a_z = self.force.T
        v_x, v_y = self.x.line(a_x), self.y.line(a_y)
        for _ in range(60):  # cross-axis slopes are far below 1: the error falls by their product each time
            v_x, v_y = self.x.output(a_x, v_y, a_z), self.y.output(a_y, v_x, a_z)
        return np.column_stack([v_x, v_y])

    @cached_property
    def acceleration(self) -> Array:
        """Acceleration from the measured outputs, g, a_z taken from the stage angle. Ang (14), (16)."""
        return self._accelerations(self.force[:, 2])

    @cached_property
    def acceleration_by_outputs(self) -> Array:
        """The same, a_z taken from the outputs themselves: what a tilt sensor without stages could do. Ang (5)-(7)."""
        return self._accelerations(self.a_z_by_outputs)

    @cached_property
    def a_z_by_outputs(self) -> Array:
        """a_z from the other two, g, shape (n,); its sign, which a root cannot know, is the stage's. Ang (5)-(7).

        The paper's normalised voltages forget the zero-g output, with which the radicand would be negative.
        """
        left = 1 - np.sum(self.linear_acceleration**2, axis=1)
        return np.asarray(np.sqrt(np.maximum(left, 0.0)) * np.sign(self.force[:, 2]))

    @cached_property
    def linear_acceleration(self) -> Array:
        """Acceleration by the manufacturer's method, g. Ang (3)."""
        return np.column_stack([self.x.linear(self.table.column("vx_v")), self.y.linear(self.table.column("vy_v"))])

    @cached_property
    def linear_predicted(self) -> Array:
        """Output by the manufacturer's method, V. Ang (8)."""
        return np.column_stack([self.x.line(self.force[:, 0]), self.y.line(self.force[:, 1])])

    @property
    def rmse_v(self) -> Array:
        """Root mean square error of the predicted output, V, shape (2,)."""
        return _rmse(self.predicted, self.table.outputs[:, :2])

    @property
    def rmse_mg(self) -> Array:
        """Root mean square error of the acceleration, mg, shape (2,)."""
        return 1e3 * _rmse(self.acceleration, self.force[:, :2])

    @property
    def linear_rmse_v(self) -> Array:
        """The linear model's, V, shape (2,)."""
        return _rmse(self.linear_predicted, self.table.outputs[:, :2])

    @property
    def linear_rmse_mg(self) -> Array:
        """The linear model's, mg, shape (2,)."""
        return 1e3 * _rmse(self.linear_acceleration, self.force[:, :2])

    @cached_property
    def tilts(self) -> tuple[Tilt, Tilt]:
        """The tilt of x and of y that p1 and q1 hold."""
        return self._tilt(self.x, self.y, 1), self._tilt(self.y, self.x, 0)

    def _tilt(self, own: AxisEstimate, other: AxisEstimate, across: int) -> Tilt:
        in_plane = (own.p[1] + 2 * own.p[0] * other.bias) * other.scale / own.scale
        out_of_plane = own.q[1] / own.scale
        twice = in_plane * self.force[:, across] + out_of_plane * self.force[:, 2]
        return Tilt(float(in_plane), float(out_of_plane), 1e3 * float(rms(twice)))

    def _accelerations(self, a_z: Array) -> Array:
        v_x, v_y = self.table.column("vx_v"), self.table.column("vy_v")
        return np.column_stack([self.x.acceleration(v_x, v_y, a_z), self.y.acceleration(v_y, v_x, a_z)])


def stepwise(table: Table) -> Stepwise:
    """Estimate (1)-(17) from full turns at alpha = 90 deg and two more inclinations at least.

    Raises MissingColumn without both outputs, DataError where the poses that an equation needs are not there.
    """
    require_kind(table, "poses")
    v = np.column_stack([table.column("vx_v"), table.column("vy_v")])
    a = specific_force(nominal_pose(table))
    turn = in_vertical_plane(a)
    x, y = (
        estimate_axis(axis, planes(table, k, v[:, k], a), v[turn, k], v[turn, 1 - k], a[turn, k])
        for k, axis in enumerate("xy")
    )
    return Stepwise(table, x, y)


def _rmse(given: Array, true: Array) -> Array:
    return rms((given - true).T)
