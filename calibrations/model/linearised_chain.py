"""The signal chain about given values: the output when one effect changes, and derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from calibrations.effects import Effect, Values
from calibrations.geometry.orientation import Pose, specific_force
from calibrations.model.chain import (
    Stage,
    Step,
    add_response,
    apply_stages,
    apply_transduction,
    convert_output,
    effect_contributions,
    output_order,
    sensed,
    stage_contribution,
    stage_of,
    static_force,
    true_pose,
)
from calibrations.table import Array, Table

LITTLE = 1e-5  # of the largest force, and rad: steps of derivatives with respect to the force and the stage angles


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
        return self._slope_through(self._total, self.steps)

    def _slope_through(self, v: Array, steps: Sequence[Step]) -> Array:
        """d output / d the output before `steps`, at the value v (n, 3), where they have no memory, (n, axes)."""
        axes = len(self.table.axes)
        if not any("output" in effect.places for effect, _ in steps):
            return np.ones((self.table.n, axes))
        h = 1e-6 * (float(np.ptp(v)) or 1.0)
        plus, minus = (convert_output([v + s * h], self.table.n, self.table, steps) for s in (1.0, -1.0))
        return np.asarray((plus - minus)[:, :axes] / (2 * h))

    @cached_property
    def columns(self) -> Mapping[int, Mapping[str, Array]]:
        """d output / d each parameter of effects that are linear in them, by term and name, shape (n, axes) each."""
        axes = len(self.table.axes)
        at_output = [i for i, (effect, _) in enumerate(self.steps) if effect.places == {"output"}]
        before = [i for i in range(len(self.steps)) if i not in at_output]
        by_term = {i: self._columns_of(self.steps[i][0]) for i in before}
        slopes = {i: self._slope * self._drift_of(self.steps[i][0])[:, :axes] for i in before}
        for i in at_output:
            by_term[i], slopes[i] = self._columns_at_output(i)
        return {i: {k: v[:, :axes] * slopes[i] for k, v in c.items()} for i, c in by_term.items() if c is not None}

    def _columns_at_output(self, term: int) -> tuple[Mapping[str, Array] | None, Array]:
        """d contribution / d each parameter of an effect at the output, (n, 3), and d output / d contribution.

        The parameters are None if the effect is not linear in them, or where the output stage has a memory.
        """
        axes, v = len(self.table.axes), self._total
        if self._needs_output_stage:
            return None, np.ones((self.table.n, axes))
        ordered = output_order(self.steps)
        place = next(i for i, step in enumerate(ordered) if step is self.steps[term])
        for effect, p in ordered[:place]:
            v = effect.output(v, self.table, p)
        effect, p = ordered[place]
        columns = effect.columns(v, self.table)
        later = ordered[place + 1 :] if columns is not None else []
        return columns, self._slope_through(effect.output(v, self.table, p), later)

    @cached_property
    def _scales(self) -> bool:
        return any(effect.scales for effect, _ in self.steps)

    @cached_property
    def _forces(self) -> list[Array]:
        """The force, g, that each stage of the response gets, shape (n, 3)."""
        return (
            apply_stages(self._sensed_force, self.table, self.steps)[0]
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
                part_of = partial(apply_transduction, effect, self.table, p)
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
            stage, partial(apply_transduction, effect, self.table, values), self._sensed_force, self._forces[stage]
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
        axes, n = len(self.table.axes), self.table.n
        if self._needs_output_stage:
            plus, minus = (
                convert_output([self._total + s * change / 2], n, self.table, self.steps) for s in (1.0, -1.0)
            )
            return np.asarray((plus - minus)[:, :axes])
        return np.asarray(self._slope * change[:, :axes])
