"""The signal chain: from stage angles to the output, and back from the output to the specific force.

    pose -> force -> transduction -> output

Forward for `poses`, where the orientation is known, and for samples of `motion`, where the reference acceleration adds
to gravity and the output filter and the converter's skew stand behind the transduction; backward for `positions`, where
only the magnitude of gravity is known. The backward way solves the same functions, so that an effect is written once.
What is a specific force for an accelerometer is the angular rate for a gyroscope, in deg/s, and for a magnetometer the
field as a share of its strength.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calibrations.effect import Effect, Values
from calibrations.motion.output import sampled
from calibrations.table import Array, Table
from calibrations.turning import rate_deg_s

Step = tuple[Effect, Values]

NOTHING = np.zeros((1, 3))


@dataclass(frozen=True)
class Pose:
    """True stage angles and the true vertical. Angles in rad, shape (n,); `up` a unit vector, shape (3,)."""

    alpha: Array
    beta: Array
    mount: Array
    flip: Array
    up: Array


@lru_cache(maxsize=2)
def nominal_pose(table: Table) -> Pose:
    """The pose that the stages report; level where a table of motion does not say."""
    return Pose(
        np.radians(table.optional("alpha_deg", 0.0)),
        np.radians(table.optional("beta_deg", 0.0)),
        np.radians(table.optional("mount_deg", 0.0)),
        table.optional("flip", 0.0),
        np.array([0.0, 0.0, 1.0]),
    )


def specific_force(pose: Pose) -> Array:
    """Static specific force in the sensor frame, g, shape (n, 3): a = F Rz(mount) Rz(beta) Ry(alpha) up."""
    ca, sa = np.cos(pose.alpha), np.sin(pose.alpha)
    turn = pose.beta + pose.mount
    ux, uy, uz = pose.up
    x, y, z = ca * ux + sa * uz, uy, -sa * ux + ca * uz
    cb, sb = np.cos(turn), np.sin(turn)
    side = np.where(pose.flip > 0, -1.0, 1.0)
    return np.column_stack([cb * x - sb * y, side * (sb * x + cb * y), side * z])


def force(table: Table, steps: Sequence[Step]) -> Array:
    """Specific force along the sensing axes, g, shape (n, 3); of a gyroscope the angular rate, deg/s."""
    return sensed(static_force(table, steps), table, steps)


def static_force(table: Table, steps: Sequence[Step]) -> Array:
    """The same along the reference axes."""
    if table.kind == "rates":
        return rate_deg_s(table)
    pose = nominal = nominal_pose(table)
    for effect, p in steps:
        if effect.pose is not None:
            pose = effect.pose(pose, table, p)
    a = _reported(table).copy() if pose is nominal else specific_force(pose)
    if table.kind == "motion":  # along the sensor's reference edge x, Ang V
        a[:, 0] += table.column("acceleration_m_s2") / table.gravity_m_s2
    return a


@lru_cache(maxsize=2)
def _reported(table: Table) -> Array:
    """Static specific force at the poses that the stages report, g, shape (n, 3)."""
    return specific_force(nominal_pose(table))


def sensed(a: Array, table: Table, steps: Sequence[Step]) -> Array:
    """Specific force along the sensing axes from that along the reference axes, g, shape (n, 3)."""
    for effect, p in steps:
        if effect.force is not None:
            a = effect.force(a, table, p)
    return a


def respond(a: Array, table: Table, steps: Sequence[Step]) -> Array:
    """Output of all three axes to the specific force `a` along the sensing axes, shape (n, 3)."""
    return converted(added(a, table, steps), len(a), table, steps)


def added(a: Array, table: Table, steps: Sequence[Step]) -> list[Array]:
    """What each effect adds to the output of all three axes, shape (n, 3) each; zeros, (1, 3), where nothing."""
    return [effect.transduction(a, table, p) if effect.transduction else NOTHING for effect, p in steps]


def converted(parts: Sequence[Array], n: int, table: Table, steps: Sequence[Step]) -> Array:
    """The sum of the parts as it is read out, shape (n, 3)."""
    v = np.zeros((n, 3))
    for part in parts:
        v += part
    if table.kind == "motion":
        v = sampled(v, table)
    for effect, p in steps:
        if effect.output is not None:
            v = effect.output(v, table, p)
    return v


def forward(table: Table, steps: Sequence[Step]) -> Array:
    """Predicted output of the measured axes, in the table's unit, shape (n, axes)."""
    return respond(force(table, steps), table, steps)[:, : len(table.axes)]


def backward(table: Table, steps: Sequence[Step], tolerance: float = 1e-12) -> Array:
    """Specific force along the reference axes that gives the measured output, g, shape (n, 3): Newton's method."""

    def output(a: Array) -> Array:
        return respond(sensed(a, table, steps), table, steps)

    a = np.zeros((table.n, 3))
    for _ in range(20):
        error = table.outputs - output(a)
        step = _solved(_slope(output, a), error)
        a = a + step
        if not np.max(np.abs(step)) > tolerance:
            break
    return a


def _solved(slope: Array, error: Array) -> Array:
    """Steps (n, 3) that take off errors (n, 3); none along what a row's slope (3, 3) does not show."""
    try:
        return np.asarray(np.linalg.solve(slope, error[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        return np.asarray((np.linalg.pinv(slope) @ error[:, :, None])[:, :, 0])


def _slope(output: Callable[[Array], Array], a: Array, h: float = 1e-4) -> Array:
    """d output / d a at each row, shape (n, 3, 3)."""
    columns = [(output(a + h * e) - output(a - h * e)) / (2 * h) for e in np.eye(3)]
    return np.stack(columns, axis=2)
