"""Forms of causes: alignment of the sensor, tilt of the base, and errors of the stages."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tests.benchmark.examiner.cause import Cause, Constants, Stand
from tests.benchmark.examiner.layouts import RAD, THERE_AND_BACK, Array
from tests.benchmark.examiner.record import Record


def rotation(vector: Array) -> Array:
    """Matrix of a rotation vector, rad. Source: Rodrigues' formula, R = I + sin K + (1 - cos) K K."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    k = vector / angle
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def _turned_sensor(record: Record, force: Array, size: float, constants: Constants) -> Array:
    return force @ rotation(size * constants.axis).T


def _elastic_die(record: Record, force: Array, size: float, constants: Constants) -> Array:
    """The force along z bends the die, so that the rotation grows with it."""
    turned = force @ (rotation(size * constants.plane_axis).T - np.eye(3))
    return force + (1 + 0.08 * force[:, 2:3]) * turned


def _lean(record: Record, force: Array, size: float, constants: Constants) -> Array:
    angle = size * constants.sign
    y = force[:, 1] * math.cos(angle) + force[:, 0] * math.sin(angle)
    return np.column_stack([force[:, 0], y, force[:, 2]])


def _stiffening_lean(record: Record, force: Array, size: float, constants: Constants) -> Array:
    y = force[:, 1] + size * constants.sign * (force[:, 0] + 0.12 * force[:, 0] ** 3)
    return np.column_stack([force[:, 0], y, force[:, 2]])


def _tilted(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    x = stand.tilt_x + size * constants.sign * 0.95
    return replace(stand, tilt_x=x, tilt_y=stand.tilt_y + size * constants.other_sign * 0.3)


def _sagging_floor(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    x = stand.tilt_x + size * constants.sign * (1 + 0.12 * np.cos(record.poses.alpha * RAD))
    return replace(stand, tilt_x=x, tilt_y=stand.tilt_y + size * 0.1)


def _two_zeros(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    beta = stand.beta + size * constants.other_sign * 0.8
    return replace(stand, alpha=stand.alpha + size * constants.sign, beta=beta)


def _drooping_arm(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    alpha = stand.alpha + size * constants.sign * (1 + 0.12 * np.sin(record.poses.alpha * RAD))
    return replace(stand, alpha=alpha, beta=stand.beta + size * constants.other_sign * 0.3)


def _second_harmonic(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    beta = record.poses.beta
    wave = np.sin(beta * RAD - constants.phase) + 0.25 * np.sin(2 * beta * RAD - constants.other_phase)
    return replace(stand, beta=stand.beta + size * wave)


def _eccentric_worm(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    """The exact angle of an eccentric scale, and a wave with twelve periods in a turn from the worm."""
    beta = record.poses.beta
    e, b = math.tanh(size * RAD), beta * RAD - constants.phase
    exact = np.arctan2(e * np.sin(b), 1 + e * np.cos(b)) / RAD
    return replace(stand, beta=stand.beta + exact + 0.12 * size * np.sin(12 * beta * RAD - constants.other_phase))


def _play(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    """Play operator: the table rests within `size` of the motor, and moves only if a tooth pushes it.

    A pose that repeats the angle from the other side is approached from 3 degrees beyond. Source: Krasnoselskii and
    Pokrovskii, Systems with Hysteresis (1989).
    """
    poses = record.poses
    state, table = poses.beta[0] - size, np.empty(record.n)
    for i, motor in enumerate(poses.beta):
        if poses.turns_round(i):
            beyond = motor + 3 * poses.side[i - 1]
            state = min(max(state, beyond - size), beyond + size)
        state = min(max(state, motor - size), motor + size)
        table[i] = state
    return replace(stand, beta=stand.beta + table - poses.beta)


def _loaded_gear(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    poses = record.poses
    return replace(stand, beta=stand.beta - size * poses.side * (1 + 0.3 * np.cos(poses.beta * RAD - constants.phase)))


def _stiction(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    """A short move does not load the gear fully."""
    poses = record.poses
    return replace(stand, beta=stand.beta - size * poses.side * (0.6 + 0.4 * (1 - np.exp(-poses.move / 15))))


ALIGNMENT = {"base": "bias+scale", "high": 0.3, "low": 1e-6}
TILT = {"high": 0.3, "low": 1e-6}
ZERO = {"base": "bias+scale", "high": 15.0, "low": 1e-4}
ECCENTRIC = {"high": 15.0, "low": 1e-4, "is_smooth": False}
BACKLASH = {**ECCENTRIC, "needs": ("direction",), "layouts": (*THERE_AND_BACK, "serpentine")}

CAUSES = (
    Cause(
        "axis-misalignment",
        "rotation",
        "a <- R(rotvec) a, all three components",
        "alignment",
        _turned_sensor,
        **ALIGNMENT,
    ),
    Cause(
        "axis-misalignment",
        "elastic die",
        "a <- a + (1+0.08 a_z)(R-1) a, rotation about an axis in the plane",
        "alignment",
        _elastic_die,
        **ALIGNMENT,
    ),
    Cause("axis-nonorthogonality", "lean", "y <- y cos e + x sin e, x kept", "alignment", _lean, **ALIGNMENT),
    Cause(
        "axis-nonorthogonality",
        "stiffening lean",
        "y <- y + e (x + 0.12 x^3), x kept",
        "alignment",
        _stiffening_lean,
        **ALIGNMENT,
    ),
    Cause("base-tilt", "rotation", "up <- R(tx, ty) up, mostly tx", "pose", _tilted, **TILT),
    Cause(
        "base-tilt",
        "floor sags with the load",
        "tx <- tx (1 + 0.12 cos alpha), ty = 0.1 tx",
        "pose",
        _sagging_floor,
        **TILT,
    ),
    Cause("stage-zero-offset", "both stages", "alpha += a0, beta += b0", "pose", _two_zeros, **ZERO),
    Cause(
        "stage-zero-offset",
        "with droop of the arm",
        "alpha += a0 (1 + 0.12 sin alpha), beta += 0.3 a0",
        "pose",
        _drooping_arm,
        **ZERO,
    ),
    Cause(
        "stage-eccentricity",
        "second harmonic",
        "beta += e [sin(beta-f) + 0.25 sin(2 beta-f2)]",
        "pose",
        _second_harmonic,
        **ECCENTRIC,
    ),
    Cause(
        "stage-eccentricity",
        "exact, with worm wave",
        "beta += atan2(e sin b, 1+e cos b) + 0.12 e sin(12 beta-f2)",
        "pose",
        _eccentric_worm,
        **ECCENTRIC,
    ),
    Cause("stage-backlash", "play operator", "beta <- play_d(beta of the motor)", "pose", _play, **BACKLASH),
    Cause("stage-backlash", "load dependent", "beta -= d s (1 + 0.3 cos(beta-f))", "pose", _loaded_gear, **BACKLASH),
    Cause("stage-backlash", "stiction", "beta -= d s (1 - 0.4 exp(-|move|/15 deg))", "pose", _stiction, **BACKLASH),
)
