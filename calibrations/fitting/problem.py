"""A model and a table as a least-squares problem: residuals and their derivatives, a class for each kind of table.

poses, rates   measured minus predicted output, one block of rows per axis, in the output's unit
positions      |a| - 1, where a is the specific force that the model makes of the output, in g
fields         the same of the field, as a share of its strength (that of the sphere nearest to the outputs)
motion         what each stretch of the record holds of measured minus predicted output, part by part
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError, ModelError, TooFewRows
from calibrations.fitting.table_noise import scatter
from calibrations.geometry.smooth import smooth_columns
from calibrations.means.noise import Processes, norm_std, white_std
from calibrations.model import Model
from calibrations.model.chain import LinearisedChain, Step, backward, force, forward, magnitude_by_output, sensed
from calibrations.model.parameters import Layout
from calibrations.table import Array, Table
from calibrations.tables import FITTED

if TYPE_CHECKING:
    from calibrations.motion.stretches import Stretches

STRENGTH = "field-strength"


def check_kind(kind: str, source: str) -> None:
    """Raises ModelError for tables to which no model is fitted; known before any sample of theirs is read."""
    if kind not in FITTED:
        raise ModelError(f"{source}: models are fitted to poses, positions, motion or rates, not to a table of {kind}")


@dataclass(frozen=True)
class Problem:
    """Residuals of a model on a table, as functions of the parameter vector. Rows stand in order of time.

    This class is for rows of known specific force or rate.
    """

    table: Table
    layout: Layout

    keeps_starts: ClassVar[bool] = False  # whether a parameter that the data do not determine keeps its start
    averages: ClassVar[bool] = True  # whether uncertainties are averaged over the slow noise that the data allow

    @staticmethod
    def of(model: Model, table: Table) -> Problem:
        """The problem. Raises ModelError and TooFewRows where there is none to solve."""
        check_kind(table.kind, table.source)
        problem = PROBLEMS[table.content]
        table = problem.prepared(table)
        problem.check(model, table)
        _check_effects(model, table)
        model = model.for_table(table)
        if not model.terms:
            raise ModelError(
                f"{table.source}: no effect of the model {model.name} exists for {table.content}; `rig models` "
                "lists others"
            )
        layout = Layout.of(model, table)
        instance = problem(table, layout)
        free = int(np.sum(~np.isfinite(layout.prior)))
        if table.n * len(instance.channels) <= free:
            raise TooFewRows(
                f"{table.source}: {table.n} rows cannot determine the {free} parameters of {model.name}; "
                "measure more poses, or take a smaller model"
            )
        return instance

    def on(self, table: Table) -> Problem:
        """The same model on another table of this kind."""
        return replace(self, table=table)

    @staticmethod
    def prepared(table: Table) -> Table:
        """The rows that are fitted."""
        return table.in_order()

    @staticmethod
    def check(model: Model, table: Table) -> None:
        """Raises DataError, ModelError where the rows, or the model, are not those that this kind needs."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the residual's blocks: the measured axes, "norm" for positions, the parts of a motion."""
        return self.table.axes

    @property
    def unit(self) -> str:
        """Unit of the residual."""
        return self.table.unit

    def residual(self, theta: Array) -> Array:
        """Shape (channels, n)."""
        return self.residual_by(self.layout.steps(theta))

    def residual_by(self, steps: Sequence[Step]) -> Array:
        """As `residual`, of effects with their values: those of the model, and what else one wants to try."""
        return self._reduced(self.samples.outputs - forward(self.samples, steps))

    @property
    def samples(self) -> Table:
        """The rows whose output the model predicts."""
        return self.table

    def _reduced(self, error: Array) -> Array:
        """An error of each axis, shape (samples, axes), by channel."""
        return error.T

    def sensed(self, theta: Array) -> Array:
        """The specific force or rate of the samples along the sensing axes, (samples, 3)."""
        return force(self.samples, self.layout.steps(theta))

    def of_output(self, theta: Array, changes: Array) -> Array:  # noqa: ARG002
        """Changes of the residual, (channels, n, m), by changes of the response, (samples, axes, m), to first order."""
        return np.stack([self._reduced(-change) for change in np.moveaxis(changes, 2, 0)], axis=2)

    @property
    def rounds(self) -> bool:
        """Whether an effect makes a staircase of the output."""
        return any(term.effect.rounds for term in self.layout.model.terms)

    @property
    def adds(self) -> bool:
        """Whether every effect only adds to the output: the model may then be linear in its parameters."""
        effects = [term.effect for term in self.layout.model.terms]
        return not any(e.places & {"pose", "force", "output"} for e in effects)

    def jacobian(self, theta: Array, of: NDArray[np.bool_] | None = None, stairs: bool = False) -> Array:
        """d residual / d theta by central differences, shape (channels, n, p); only the entries `of` where given.

        A staircase that an effect makes of the output is taken for the slope of one that it has in the mean, unless
        `stairs` are to be climbed: beside what else is missing, where edges lie tells nothing of what comes before.
        """
        low, high = self.layout.bounds
        steps = 1e-3 * self.layout.typical
        indices = np.flatnonzero(np.ones(len(theta), dtype=bool) if of is None else of)
        change, linear_columns = self._changes_near(theta, stairs), self._known_columns(theta)
        columns = []
        for k in map(int, indices):
            if k in linear_columns:
                columns.append(linear_columns[k])
                continue
            upper, lower = min(theta[k] + steps[k], high[k]), max(theta[k] - steps[k], low[k])
            columns.append(change(k, upper, lower) / (upper - lower))
        return np.stack(columns, axis=2) if columns else np.zeros((len(self.channels), self.table.n, 0))

    def _known_columns(self, theta: Array) -> dict[int, Array]:
        """d residual / d the entries of effects that say how they enter linearly, (channels, n) each."""
        layout = self.layout
        even = [i for i, term in enumerate(layout.model.terms) if not term.effect.rounds]
        if not np.isfinite(layout.prior).any():
            return {}
        steps = layout.steps(theta)
        columns = self._chain_at([steps[i] for i in even]).columns
        by_index: dict[int, Array] = {}
        for k, slot in enumerate(layout.slots):
            if slot.term in even and (effect_columns := columns.get(even.index(slot.term))) is not None:
                axes = [self.table.axes.index(slot.axis)] if slot.axis else slice(None)
                by_index[k] = np.zeros_like(effect_columns[slot.parameter.name])
                by_index[k][:, axes] = effect_columns[slot.parameter.name][:, axes]
        if not by_index:
            return {}
        output_columns = self.of_output(theta, np.stack(list(by_index.values()), axis=2))
        return dict(zip(by_index, np.moveaxis(output_columns, 2, 0), strict=True))

    def _chain_at(self, steps: Sequence[Step]) -> LinearisedChain:
        """The chain with these values."""
        return LinearisedChain(self.samples, steps)

    def _changes_near(self, theta: Array, stairs: bool) -> Callable[[int, float, float], Array]:
        """Change of the residual, as a function of (entry, its upper value, its lower value)."""
        steps = self.layout.steps(theta)
        even = [i for i, (effect, _) in enumerate(steps) if stairs or not effect.rounds]
        by_all, beside_stairs = (
            LinearisedChain(self.samples, steps),
            LinearisedChain(self.samples, [steps[i] for i in even]),
        )

        def change(k: int, upper: float, lower: float) -> Array:
            term = self.layout.slots[k].term
            chain, place = (beside_stairs, even.index(term)) if term in even else (by_all, term)
            values = (self.layout.values_with(steps[term][1], k, value) for value in (upper, lower))
            return self._reduced(-chain.change(place, *values))

        return change

    @cached_property
    def white(self) -> Array | None:
        """Each mean's standard deviation by white noise, in the residual's unit, (channels, n); None if not known."""
        std = white_std(self.table)
        return scatter(self.table) if std is None else self._white(std)

    def _white(self, std: Array) -> Array:
        """As `white`, from the standard deviations of the outputs' means, shape (n, axes)."""
        return std.T

    @property
    def given(self) -> tuple[Processes, ...]:
        """Slow noise of each channel that is known from a still record; none where nothing is."""
        return tuple(self.table.noise[channel] for channel in self.channels) if self.table.noise else ()

    @cached_property
    def gap_s(self) -> Array:
        """Time between each row and the one before it, s, shape (n,); 0 where no time is given and none is needed."""
        if not self.table.type.sequential and "t_s" not in self.table:
            return np.zeros(self.table.n)
        return np.diff(self.table.time_s, prepend=self.table.time_s[0])

    @cached_property
    def smooth(self) -> Array:
        """Columns set aside when noise is estimated, shape (n, k)."""
        return smooth_columns(self.table)


class RateProblem(Problem):
    """Outputs of a gyroscope at known rates."""

    @staticmethod
    def check(model: Model, table: Table) -> None:  # noqa: ARG004
        """Raises DataError for an output that never changes."""
        _check_changes(table, "each gyroscope output must change when the table turns; check its channel and its cable")


class PositionProblem(Problem):
    """Magnitudes of what is sensed, of which only the strength is known."""

    @staticmethod
    def check(model: Model, table: Table) -> None:  # noqa: ARG004
        """Positions turn each of three axes. Raises DataError."""
        if len(table.axes) < 3:
            raise DataError(
                f"{table.source}: models of positions need the columns ax, ay, az, or mx, my, mz; "
                f"it has: {', '.join(table.columns)}"
            )
        _check_changes(table, "each axis must point up and down in the positions; check its channel and its cable")

    @property
    def channels(self) -> tuple[str, ...]:
        """The magnitude."""
        return ("norm",)

    @property
    def unit(self) -> str:
        """The unit of the sensed quantity."""
        return self.table.input_unit

    def residual_by(self, steps: Sequence[Step]) -> Array:
        """The magnitude less the known one, shape (1, n)."""
        error: Array = np.linalg.norm(backward(self.table, steps), axis=1)[:, None] - 1.0
        return error.T

    def sensed(self, theta: Array) -> Array:
        """As the model has it from the outputs."""
        steps = self.layout.steps(theta)
        return sensed(backward(self.table, steps), self.table, steps)

    def _chain_at(self, steps: Sequence[Step]) -> LinearisedChain:
        """From the outputs back to what is sensed."""
        return LinearisedChain(self.table, steps, backward(self.table, steps))

    def of_output(self, theta: Array, changes: Array) -> Array:
        """By how the magnitude follows each output."""
        return self._of_output(self._chain_at(self.layout.steps(theta)), changes)

    def _of_output(self, chain: LinearisedChain, changes: Array) -> Array:
        assert chain.measured is not None  # noqa: S101 `_chain_at` gives it
        by_output = magnitude_by_output(chain.measured, self.table, chain.steps)
        return np.asarray(-np.einsum("ni,nim->nm", by_output, changes)[None])

    @property
    def adds(self) -> bool:
        """A magnitude is not linear in any parameter."""
        return False

    def _changes_near(self, theta: Array, stairs: bool) -> Callable[[int, float, float], Array]:  # noqa: ARG002
        """The response at the same specific force changes; the magnitude follows it as it follows the output."""
        chain = self._chain_at(self.layout.steps(theta))
        by_response = self._of_output(chain, np.tile(np.eye(3), (self.table.n, 1, 1)))

        def change(k: int, upper: float, lower: float) -> Array:
            term = self.layout.slots[k].term
            values = (self.layout.values_with(chain.steps[term][1], k, value) for value in (upper, lower))
            return np.asarray(np.sum(by_response * chain.change(term, *values), axis=2))

        return change

    def _white(self, std: Array) -> Array:
        return norm_std(self.table, std).T / self.layout.nominal


class FieldProblem(PositionProblem):
    """Magnitudes of a field, whose strength is a parameter."""

    @staticmethod
    def check(model: Model, table: Table) -> None:
        """As for positions; raises ModelError for a model without a field."""
        PositionProblem.check(model, table)
        if STRENGTH not in model.effects:
            raise ModelError(
                f"{table.source}: a model of magnetometers needs the effect {STRENGTH}, and {model.name} has "
                f"{', '.join(model.effects)}; take the model field or magnetometer"
            )

    def residual_by(self, steps: Sequence[Step]) -> Array:
        """In the field's strength as the outputs show it, whatever the model makes of it.

        By its own measure a field without end would leave nothing of any magnitude.
        """
        return super().residual_by(steps) * self._strength(steps)

    def _strength(self, steps: Sequence[Step]) -> float:
        """The model's strength of the field over that which the outputs show."""
        strengths = [float(p["total"]) for effect, p in steps if effect.name == STRENGTH]
        return strengths[0] / self.layout.nominal if strengths else 1.0

    def _of_output(self, chain: LinearisedChain, changes: Array) -> Array:
        return super()._of_output(chain, changes) * self._strength(chain.steps)

    def _changes_near(self, theta: Array, stairs: bool) -> Callable[[int, float, float], Array]:
        """The strength itself changes the measure of the magnitude as well."""
        change_by_response = super()._changes_near(theta, stairs)
        steps = self.layout.steps(theta)
        error = super().residual_by(steps)

        def change(k: int, upper: float, lower: float) -> Array:
            by_response = change_by_response(k, upper, lower)
            if steps[self.layout.slots[k].term][0].name != STRENGTH:
                return by_response
            return by_response + error * (upper - lower) / self.layout.nominal

        return change


@dataclass(frozen=True)
class MotionProblem(Problem):
    """The motion of a record, as its stretches represent it."""

    table: Stretches

    keeps_starts = True  # at one attitude an axis that does not move cannot tell its scale factor from its bias
    averages = False  # some tens of stretches allow nearly any: Student's t of the noise found stands in its place

    @staticmethod
    def prepared(table: Table) -> Table:
        """A row for each stretch."""
        from calibrations.motion.stretches import make_stretches  # other kinds need no spectra

        return make_stretches(table)

    @property
    def channels(self) -> tuple[str, ...]:
        """Axis and part, such as "x in phase at 10 Hz"."""
        return self.table.channels

    @property
    def adds(self) -> bool:
        """The parts are fitted by their own steps (`keeps_starts`)."""
        return False

    @cached_property
    def white(self) -> Array | None:
        """From the spectral density near each line."""
        return self.table.white

    @property
    def samples(self) -> Table:
        return self.table.samples

    def of_output(self, theta: Array, changes: Array) -> Array:
        """Behind the output filter."""
        from calibrations.motion.spectrum import sample_output  # other kinds need no spectra

        filtered = [sample_output(change, self.samples) for change in np.moveaxis(changes, 2, 0)]
        return super().of_output(theta, np.stack(filtered, axis=2))

    def _reduced(self, error: Array) -> Array:
        return self.table.parts(error)


PROBLEMS: Mapping[str, type[Problem]] = MappingProxyType(
    {
        "poses": Problem,
        "rates": RateProblem,
        "positions": PositionProblem,
        "fields": FieldProblem,
        "motion": MotionProblem,
    }
)


def _check_effects(model: Model, table: Table) -> None:
    """Raises DataError where the rows cannot show an effect of the model."""
    for effect in (term.effect for term in model.terms if table.content in term.effect.kinds):
        if reason := effect.lacks(table):
            raise DataError(f"{table.source}: {effect.name} is not fitted: {reason}")


def _check_changes(table: Table, but: str) -> None:
    still = [name for name, spread in zip(table.output_names, np.ptp(table.outputs, axis=0), strict=True) if not spread]
    if still:
        raise DataError(f'{table.source}: the column "{still[0]}" never changes; {but}')
