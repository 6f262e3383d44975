"""The signal chain: from stage angles to the output, and back from the output to the specific force.

    pose -> force -> transduction -> output

Forward for `poses`, where the orientation is known, and for samples of `motion`, where the reference acceleration adds
to gravity and the output filter and the converter's skew come after the transduction; backward for `positions`, where
only the magnitude of gravity is known. The backward way solves the same functions, so that an effect is written once.
What is a specific force for an accelerometer is the angular rate for a gyroscope, in deg/s, and for a magnetometer the
field as a share of its strength.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import partial
from typing import Any

import numpy as np

from calibrations.effects import Effect, Values
from calibrations.geometry.orientation import Pose, nominal_pose, reported_force, specific_force
from calibrations.geometry.rate_table import rate_deg_s
from calibrations.table import Array, Table

Step = tuple[Effect, Values]
MOST_STEPS = 30  # of Newton's method
SHRINKS = 0.1  # of the step before it: a larger step needs a new slope


class Stage(IntEnum):
    """The stages of the response to the force; each changes the result of the one before."""

    RESPONSE = 0  # adds to it, as a nonlinearity does, or to the output alone
    SCALE = 1  # scales it over other forces
    DRIFT = 2  # scales all of it, over time or temperature


def stage_of(effect: Effect) -> Stage:
    """The stage at which an effect acts."""
    if not effect.scales:
        return Stage.RESPONSE
    return Stage.SCALE if effect.of_force else Stage.DRIFT


def force(table: Table, steps: Sequence[Step]) -> Array:
    """Specific force along the sensing axes, g, shape (n, 3); of a gyroscope the angular rate, deg/s."""
    return sensed(static_force(table, steps), table, steps)


def static_force(table: Table, steps: Sequence[Step]) -> Array:
    """The specific force along the reference axes."""
    if table.type.turning:
        return rate_deg_s(table)
    pose = true_pose(table, steps)
    a = reported_force(table).copy() if pose is nominal_pose(table) else specific_force(pose)
    if table.type.moving:  # along the sensor's reference edge x, Ang V
        a[:, 0] += table.column("acceleration_m_s2") / table.gravity_m_s2
    return a


def true_pose(table: Table, steps: Sequence[Step]) -> Pose:
    """The true stage angles and the true vertical."""
    pose = nominal_pose(table)
    for effect, p in steps:
        pose = effect.pose(pose, table, p)
    return pose


def sensed(a: Array, table: Table, steps: Sequence[Step]) -> Array:
    """Specific force along the sensing axes from that along the reference axes, g, shape (n, 3)."""
    for effect, p in steps:
        a = effect.force(a, table, p)
    return a


def respond(a: Array, table: Table, steps: Sequence[Step]) -> Array:
    """Output of all three axes to the specific force `a` along the sensing axes, shape (n, 3)."""
    return convert_output(effect_contributions(a, table, steps), len(a), table, steps)


def effect_contributions(a: Array, table: Table, steps: Sequence[Step]) -> list[Array]:
    """Contribution of each effect to the output of all three axes, shape (n, 3) each; zeros, (1, 3), for none.

    A change of the sensitivity multiplies all that the sensor makes of the force, also what its nonlinearity adds.
    """
    if not any(effect.scales for effect, _ in steps):
        return [effect.transduction(a, table, p) for effect, p in steps]
    return apply_stages(a, table, steps)[1]


def apply_stages(a: Array, table: Table, steps: Sequence[Step]) -> tuple[list[Array], list[Array]]:
    """The force, g, (n, 3), that each stage gets, and the contribution of each effect."""
    parts: dict[int, Array] = {}
    forces = [a]
    for stage in Stage:
        stage_parts = {
            i: stage_contribution(stage, partial(apply_transduction, effect, table, p), a, forces[stage])
            for i, (effect, p) in enumerate(steps)
            if stage_of(effect) == stage
        }
        of_force = [part for i, part in stage_parts.items() if steps[i][0].of_force]
        forces.append(
            add_response(forces[stage], sum(of_force, np.zeros((1, 3))), steps) if of_force else forces[stage]
        )
        parts |= stage_parts
    return forces, [parts[i] for i in range(len(steps))]


def stage_contribution(stage: Stage, part_of: Callable[[Any], Any], a: Any, response: Any) -> Any:
    """Contribution of an effect of some stage to the output, `part_of` a force, to the `response` before it, (n, 3), g.

    What scales the response over other forces follows the force along these, and not their response.
    """
    if stage is not Stage.SCALE or response is a:
        return part_of(response)
    parts = [part_of(a + (response - a) * axis) * axis for axis in np.eye(3)[:, None]]
    return parts[0] + parts[1] + parts[2]


def apply_transduction(effect: Effect, table: Table, p: Values, a: Array) -> Array:
    """The contribution of an effect to the output, with the force as the last argument."""
    return effect.transduction(a, table, p)


def add_response(a: Array, response: Array, steps: Sequence[Step]) -> Array:
    """The force `a` and the force, g, that would give a response (n, 3) in the output's unit; `a` without a scale."""
    scale = next((np.asarray(p["scale"]) for effect, p in steps if effect.name == "scale-factor"), np.zeros(3))
    return a + response * (1 / np.where(scale == 0, np.inf, scale))


def convert_output(parts: Sequence[Array], n: int, table: Table, steps: Sequence[Step]) -> Array:
    """The output after converter and filter for the sum of the parts, shape (n, 3)."""
    v = np.zeros((n, 3))
    for part in parts:
        v += part
    if table.type.moving:
        from calibrations.motion.spectrum import sample_output  # only motion has spectra

        v = sample_output(v, table)
    for effect, p in output_order(steps):
        v = effect.output(v, table, p)
    return v


def output_order(steps: Sequence[Step]) -> list[Step]:
    """The steps in the order in which they act on the output, whatever the order in which they were added."""
    return sorted(steps, key=lambda step: (step[0].converts, step[0].rounds))


def forward(table: Table, steps: Sequence[Step]) -> Array:
    """Predicted output of the measured axes, in the table's unit, shape (n, axes)."""
    return respond(force(table, steps), table, steps)[:, : len(table.axes)]


def backward(table: Table, steps: Sequence[Step], tolerance: float = 1e-12) -> Array:
    """Specific force along the reference axes that gives the measured output, g, shape (n, 3): Newton's method.

    The slope is found anew only where the steps shrink slowly: a response that is almost linear needs it once.
    """
    a, slope, largest = np.zeros((table.n, 3)), None, np.inf
    for _ in range(MOST_STEPS):
        if slope is None:
            slope = slope_at(a, table, steps)
        step = _solve(slope, table.outputs - respond(sensed(a, table, steps), table, steps))
        a = a + step
        before, largest = largest, float(np.max(np.abs(step)))
        if not largest > tolerance:
            break
        if largest > SHRINKS * before:
            slope = None
    return a


def slope_at(a: Array, table: Table, steps: Sequence[Step], h: float = 1e-4) -> Array:
    """d output / d the specific force `a` (n, 3) along the reference axes, shape (n, 3, 3)."""

    def output(a: Array) -> Array:
        return respond(sensed(a, table, steps), table, steps)

    return np.stack([(output(a + h * e) - output(a - h * e)) / (2 * h) for e in np.eye(3)], axis=2)


def magnitude_by_output(a: Array, table: Table, steps: Sequence[Step]) -> Array:
    """d |a| / d the measured output where `a` (n, 3) gives that output, shape (n, 3)."""
    direction = a / np.maximum(np.linalg.norm(a, axis=1, keepdims=True), np.finfo(float).tiny)
    return _solve(slope_at(a, table, steps).transpose(0, 2, 1), direction)


def _solve(slope: Array, error: Array) -> Array:
    """Steps (n, 3) that remove errors (n, 3); none along directions without a slope (3, 3) in a row."""
    try:
        return np.asarray(np.linalg.solve(slope, error[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        return np.asarray((np.linalg.pinv(slope) @ error[:, :, None])[:, :, 0])
