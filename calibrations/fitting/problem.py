"""A model and a table as a least-squares problem: residuals and their derivatives by the parameters.

`Problem` is for rows of known specific force or rate: measured minus predicted output, one block of rows per axis, in
the output's unit. `problem_kinds` has the problems of the other kinds of table.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calibrations.fitting.table_noise import scatter
from calibrations.geometry.smooth import smooth_columns
from calibrations.means.noise import Processes, white_std
from calibrations.model import Model
from calibrations.model.chain import Step, force, forward
from calibrations.model.linearised_chain import LinearisedChain
from calibrations.model.parameters import Layout
from calibrations.table import Array, Table


@dataclass(frozen=True)
class Problem:
    """Residuals of a model on a table, as functions of the parameter vector. Rows are in order of time."""

    table: Table
    layout: Layout

    keeps_starts: ClassVar[bool] = False  # whether a parameter that the data do not determine keeps its start
    averages: ClassVar[bool] = True  # whether uncertainties are averaged over the slow noise that the data allow

    def on(self, table: Table) -> Problem:
        """The problem of the same model on another table of this kind."""
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

    signal: ClassVar[str] = "variation of an output"

    @property
    def signal_rms(self) -> Array:
        """The rms of the prediction, in the unit of the residual, (channels,) or (1,)."""
        return np.asarray(self.table.outputs.std(axis=0))

    def residual(self, theta: Array) -> Array:
        """Shape (channels, n)."""
        return self.residual_by(self.layout.steps(theta))

    def residual_by(self, steps: Sequence[Step]) -> Array:
        """The residual for effects that have their values: those of the model, or others."""
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
        """d residual / d theta by central differences, shape (channels, n, p); only the entries `of` if given.

        The derivative of a staircase, such as that of quantisation, is its mean slope of 1. With `stairs` it is the
        exact one, which is useful only near the solution: elsewhere the model errors move the edges. Free forms have
        the mean slope in both cases.
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
        """d residual / d theta for the entries of effects that give linear columns, (channels, n) each."""
        layout = self.layout
        even = [i for i, term in enumerate(layout.model.terms) if not term.effect.rounds]
        if layout.free.all():
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
        """White noise of the residual, from the standard deviations of the outputs' means, shape (n, axes)."""
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
