"""The signal chain: from stage angles to the output, and back from the output to the specific force.

    pose -> force -> transduction -> output

Forward for `poses`, where the orientation is known, and for samples of `motion`, where the reference acceleration adds
to gravity and the output filter and the converter's skew come after the transduction; backward for `positions`, where
only the magnitude of gravity is known. The backward way solves the same functions, so that an effect is written once.
What is a specific force for an accelerometer is the angular rate for a gyroscope, in deg/s, and for a magnetometer the
field as a share of its strength.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property, partial
from typing import Any

import numpy as np

from calibrations.effects import Effect, Values
from calibrations.geometry.orientation import Pose, nominal_pose, reported_force, specific_force
from calibrations.geometry.rate_table import rate_deg_s
from calibrations.table import Array, Table

Step = tuple[Effect, Values]
MOST_STEPS = 30  # of Newton's method
SHRINKS = 0.1  # of the step before it: a larger step needs a new slope
LITTLE = 1e-5  # of the largest force, and rad: steps of derivatives with respect to the force and the stage angles


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
    return _apply_stages(a, table, steps)[1]


def _apply_stages(a: Array, table: Table, steps: Sequence[Step]) -> tuple[list[Array], list[Array]]:
    """The force, g, (n, 3), that each stage gets, and the contribution of each effect."""
    parts: dict[int, Array] = {}
    forces = [a]
    for stage in Stage:
        stage_parts = {
            i: stage_contribution(stage, partial(_apply_transduction, effect, table, p), a, forces[stage])
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


def _apply_transduction(effect: Effect, table: Table, p: Values, a: Array) -> Array:
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


@dataclass(frozen=True)
class LinearisedChain:
    """The chain with the values of `steps`.

    `measured`: specific force along the reference axes, g, (n, 3), where the outputs and not the stages give it.
    """

    table: Table
    steps: Sequence[Step]
    measured: Array | None = None

    @cached_property
    def static(self) -> Array:
        """Specific force along the reference axes, g, shape (n, 3)."""
        return static_force(self.table, self.steps) if self.measured is None else self.measured

    @cached_property
    def _sensed_force(self) -> Array:
        return sensed(self.static, self.table, self.steps)

    @cached_property
    def _contributions(self) -> list[Array]:
        return effect_contributions(self._sensed_force, self.table, self.steps)

    @cached_property
    def _total(self) -> Array:
        """The sum of all parts, shape (n, 3)."""
        return np.asarray(sum(self._contributions, np.zeros((self.table.n, 3))))

    @cached_property
    def _has_output_stage(self) -> bool:
        return any("output" in effect.places for effect, _ in self.steps)

    @cached_property
    def _needs_output_stage(self) -> bool:
        """Whether the slope of the output stage at each row is not enough: it has memory, or makes a staircase."""
        return self.table.type.moving or any(effect.rounds for effect, _ in self.steps)

    @cached_property
    def _slope(self) -> Array:
        """d output / d the sum of all parts, where the output stage has no memory, shape (n, axes)."""
        total, axes = self._total, len(self.table.axes)
        if not self._has_output_stage:
            return np.ones((self.table.n, axes))
        h = 1e-6 * (float(np.ptp(total)) or 1.0)
        plus, minus = (convert_output([total + s * h], self.table.n, self.table, self.steps) for s in (1.0, -1.0))
        return np.asarray((plus - minus)[:, :axes] / (2 * h))

    @cached_property
    def columns(self) -> Mapping[int, Mapping[str, Array]]:
        """d output / d each parameter of effects that are linear in them, by term and name, shape (n, axes) each."""
        axes = len(self.table.axes)
        by_term = {i: self._columns_of(effect) for i, (effect, _) in enumerate(self.steps)}
        slopes = {i: self._slope * self._drift_of(effect)[:, :axes] for i, (effect, _) in enumerate(self.steps)}
        return {i: {k: v[:, :axes] * slopes[i] for k, v in c.items()} for i, c in by_term.items() if c is not None}

    @cached_property
    def _scales(self) -> bool:
        return any(effect.scales for effect, _ in self.steps)

    @cached_property
    def _forces(self) -> list[Array]:
        """The force, g, that each stage of the response gets, shape (n, 3)."""
        return (
            _apply_stages(self._sensed_force, self.table, self.steps)[0]
            if self._scales
            else [self._sensed_force] * len(Stage)
        )

    @cached_property
    def _gains(self) -> list[Array]:
        """By stage, its sensitivity through the later stages over that of the scale factor, shape (n, 3)."""
        gains = [np.ones((1, 3))]
        for stage in (Stage.DRIFT, Stage.SCALE):
            gains.insert(0, gains[0] * self._gain_by(stage))
        return gains

    def _gain_by(self, stage: Stage) -> Array:
        """Sensitivity over that of the scale factor, by the effects of one stage, which are linear in the own force."""
        a, unit = self._sensed_force, np.ones((1, 3))
        total = np.zeros((1, 3))
        for effect, p in self.steps:
            if stage_of(effect) == stage:
                part_of = partial(_apply_transduction, effect, self.table, p)
                total = total + stage_contribution(stage, part_of, a, a + unit) - part_of(a)
        return add_response(unit, total, self.steps)

    def _columns_of(self, effect: Effect) -> Mapping[str, Array] | None:
        """d contribution / d each parameter of an effect that is linear in them, shape (n, 3) each; else None."""
        a, response, stage = self._sensed_force, self._forces[stage_of(effect)], stage_of(effect)
        names = effect.columns(response, self.table)
        if names is None or stage is not Stage.SCALE or response is a:
            return names
        by_axis = [effect.columns(a + (response - a) * axis, self.table) or {} for axis in np.eye(3)[:, None]]
        return {name: np.column_stack([by_axis[k][name][:, k] for k in range(3)]) for name in names}

    def _drift_of(self, effect: Effect) -> Array:
        return self._gains[stage_of(effect)] if effect.of_force and self._scales else np.ones((1, 3))

    def _contribution(self, effect: Effect, values: Values) -> Array:
        """Contribution of one effect to the output, together with the other effects of the model."""
        stage = stage_of(effect)
        part = stage_contribution(
            stage, partial(_apply_transduction, effect, self.table, values), self._sensed_force, self._forces[stage]
        )
        return np.asarray(part * self._drift_of(effect) if self._scales else part)

    def output(self, term: int, values: Values) -> Array:
        """Output of the measured axes with other `values` of one effect, up to a constant, shape (n, axes).

        If an effect only adds to the output, this is its contribution alone: in the sum of all, digits would be lost.
        """
        effect = self.steps[term][0]
        steps = [*self.steps[:term], (effect, values), *self.steps[term + 1 :]]
        if effect.places & {"pose", "force"}:
            static = static_force(self.table, steps) if "pose" in effect.places else self.static
            parts = effect_contributions(sensed(static, self.table, steps), self.table, steps)
        elif not self._has_output_stage:
            parts = [self._contribution(effect, values)]
        else:
            parts = [*self._contributions[:term], self._contribution(effect, values), *self._contributions[term + 1 :]]
        return convert_output(parts, self.table.n, self.table, steps)[:, : len(self.table.axes)]

    def change(self, term: int, upper: Values, lower: Values) -> Array:
        """Output with the `upper` values of one effect less the output with the `lower` ones, first order, (n, axes).

        Values before the transduction change the force. The output follows by d output / d force, found once for all.
        """
        effect = self.steps[term][0]
        if len(effect.places) > 1 or "output" in effect.places:
            return self.output(term, upper) - self.output(term, lower)
        if "transduction" in effect.places:
            return self._read_out(self._contribution(effect, upper) - self._contribution(effect, lower))
        force_upper, force_lower = self._force_with(term, upper), self._force_with(term, lower)
        parts = [np.einsum("nij,nj->ni", self._by_force, force_upper - force_lower)]
        for memory_effect, values in self._history_steps:
            followed = (memory_effect.transduction(a, self.table, values) for a in (force_upper, force_lower))
            parts.append((next(followed) - next(followed)) * self._drift_of(memory_effect))
        return self._read_out(sum(parts[1:], parts[0]))

    def _force_with(self, term: int, values: Values) -> Array:
        """Force along the sensing axes with other values of one effect, shape (n, 3)."""
        effect = self.steps[term][0]
        steps = [*self.steps[:term], (effect, values), *self.steps[term + 1 :]]
        if "pose" not in effect.places:
            return sensed(self.static, self.table, steps)
        pose, by_angle, by_up = self._pose, self._by_angle, self._by_up
        pose_changed = true_pose(self.table, steps)
        change_of_up = np.broadcast_to((pose_changed.up - pose.up).T, self.static.shape)
        static = self.static + np.einsum("nij,nj->ni", by_up, change_of_up)
        for change, derivative in zip(
            (pose_changed.alpha - pose.alpha, pose_changed.beta - pose.beta), by_angle, strict=True
        ):
            static = static + change[:, None] * derivative
        return sensed(static, self.table, steps)

    @cached_property
    def _pose(self) -> Pose:
        return true_pose(self.table, self.steps)

    @cached_property
    def _by_angle(self) -> tuple[Array, Array]:
        """d force along the reference axes / d alpha and beta, g/rad, shape (n, 3) each."""
        pose = self._pose

        def slope(plus: Pose, minus: Pose) -> Array:
            return (specific_force(plus) - specific_force(minus)) / (2 * LITTLE)

        return (
            slope(replace(pose, alpha=pose.alpha + LITTLE), replace(pose, alpha=pose.alpha - LITTLE)),
            slope(replace(pose, beta=pose.beta + LITTLE), replace(pose, beta=pose.beta - LITTLE)),
        )

    @cached_property
    def _by_up(self) -> Array:
        """d force along the reference axes / d the true vertical, shape (n, 3, 3)."""
        return np.stack([specific_force(replace(self._pose, up=e)) for e in np.eye(3)], axis=2)

    @cached_property
    def _history_steps(self) -> list[Step]:
        """Effects that depend on the force of earlier rows too."""
        return [(effect, values) for effect, values in self.steps if effect.memory]

    @cached_property
    def _by_force(self) -> Array:
        """d the sum of all parts / d the force, without the effects of earlier rows, shape (n, 3, 3)."""
        a, steps = self._sensed_force, [(effect, values) for effect, values in self.steps if not effect.memory]
        h = LITTLE * (float(np.max(np.abs(a))) or 1.0)

        def total(a: Array) -> Array:
            return np.asarray(sum(effect_contributions(a, self.table, steps), np.zeros_like(a)))

        return np.stack([(total(a + h * e) - total(a - h * e)) / (2 * h) for e in np.eye(3)], axis=2)

    def _read_out(self, change: Array) -> Array:
        """Change of the output, shape (n, axes), by a small change of the sum of all parts, (n, 3)."""
        axes, half = len(self.table.axes), change / 2
        if self._needs_output_stage:
            plus, minus = (
                convert_output([self._total + h], self.table.n, self.table, self.steps) for h in (half, -half)
            )
            return np.asarray((plus - minus)[:, :axes])
        return np.asarray(self._slope * change[:, :axes])
