"""A model and a table as a least-squares problem: residuals and their derivatives.

For `poses` the residual is measured minus predicted output, one block of rows per axis, in the output's unit.
For `positions` it is |a| - 1, where a is the specific force that the model makes of the output, in g, or the field as
a share of its strength (that of the sphere nearest to the outputs). For `rates` it is as for poses.
For `motion` it is what each stretch of the record holds of measured minus predicted output, part by part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError, ModelError, TooFewRows
from calibrations.fitting.smooth import smooth_columns
from calibrations.model import Model
from calibrations.model.chain import Near, Step, backward, forward
from calibrations.model.parameters import Layout
from calibrations.motion.stretches import Stretches, make_stretches
from calibrations.noise.mean_noise import norm_std, white_std
from calibrations.noise.means import Processes
from calibrations.noise.table_noise import scatter
from calibrations.table import Array, Table

STRENGTH = "field-strength"
FITTED = ("poses", "positions", "motion", "rates")  # kinds of tables
KNOWN = ("poses", "rates")  # kinds of tables whose rows have a known specific force or rate


def check_kind(kind: str, source: str) -> None:
    """Raises ModelError for tables to which no model is fitted; known before any sample of theirs is read."""
    if kind not in FITTED:
        raise ModelError(f"{source}: models are fitted to poses, positions, motion or rates, not to a table of {kind}")


@dataclass(frozen=True)
class Problem:
    """Residuals of a model on a table, as functions of the parameter vector. Rows stand in order of time."""

    table: Table
    layout: Layout

    @staticmethod
    def of(model: Model, table: Table) -> Problem:
        """The problem. Raises ModelError and TooFewRows where there is none to solve."""
        table = make_stretches(table) if table.kind == "motion" else table.in_order()
        check_kind(table.kind, table.source)
        if table.kind == "positions":
            _check_positions(table)
        if table.kind == "rates":
            _check_changes(table, "a table that turns changes each output that senses it")
        _check_fields(model, table)
        model = model.for_table(table)
        if not model.terms:
            raise ModelError(
                f"{table.source}: no effect of {model.name} is defined for {table.content}; `rig models` lists others"
            )
        layout = Layout.of(model, table)
        rows = table.n * len(_channels(table))
        if rows <= len(layout.slots):
            raise TooFewRows(
                f"{table.source}: {table.n} rows cannot determine the {len(layout.slots)} parameters of {model.name}; "
                "measure more poses, or take a smaller model"
            )
        return Problem(table, layout)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the residual's blocks: the measured axes, "norm" for positions, the parts of a motion."""
        return _channels(self.table)

    @property
    def unit(self) -> str:
        """Unit of the residual."""
        return self.table.input_unit if self.table.kind == "positions" else self.table.unit

    def residual(self, theta: Array) -> Array:
        """Shape (channels, n)."""
        return self.residual_by(self.layout.steps(theta))

    def residual_by(self, steps: Sequence[Step]) -> Array:
        """As `residual`, of effects with their values: those of the model, and what else one wants to try."""
        if self.table.kind == "positions":
            error: Array = np.linalg.norm(backward(self.table, steps), axis=1)[:, None] - 1.0
            return error.T * self._share(steps)
        samples = self.table.samples if isinstance(self.table, Stretches) else self.table
        return self._reduced(samples.outputs - forward(samples, steps))

    def _reduced(self, error: Array) -> Array:
        """An error of each axis, shape (n, axes), by channel."""
        return self.table.parts(error) if isinstance(self.table, Stretches) else error.T

    def _share(self, steps: Sequence[Step]) -> float:
        """What a residual is given in: the field's strength as the outputs show it, whatever the model makes of it.

        By its own measure a field without end would leave nothing of any magnitude.
        """
        strengths = [float(p["total"]) for effect, p in steps if effect.name == STRENGTH]
        return strengths[0] / self.layout.nominal if strengths else 1.0

    @property
    def rounds(self) -> bool:
        """Whether an effect makes a staircase of the output."""
        return any(term.effect.rounds for term in self.layout.model.terms)

    @property
    def adds(self) -> bool:
        """Whether every effect only adds to the output: the model may then be linear in its parameters."""
        effects = [term.effect for term in self.layout.model.terms]
        return self.table.kind in KNOWN and not any(e.places & {"pose", "force", "output"} for e in effects)

    def jacobian(self, theta: Array, of: NDArray[np.bool_] | None = None, stairs: bool = False) -> Array:
        """d residual / d theta by central differences, shape (channels, n, p); only the entries `of` where given.

        A staircase that an effect makes of the output is taken for the slope of one that it has in the mean, unless
        `stairs` are to be climbed: beside what else is missing, where edges lie tells nothing of what comes before.
        """
        low, high = self.layout.bounds
        steps = 1e-3 * self.layout.typical
        chosen = np.flatnonzero(np.ones(len(theta), dtype=bool) if of is None else of)
        error = self._errors_near(theta, stairs)
        columns = []
        for k in map(int, chosen):
            ahead, behind = theta.copy(), theta.copy()
            ahead[k], behind[k] = min(theta[k] + steps[k], high[k]), max(theta[k] - steps[k], low[k])
            columns.append((error(k, ahead) - error(k, behind)) / (ahead[k] - behind[k]))
        return np.stack(columns, axis=2) if columns else np.zeros((len(self.channels), self.table.n, 0))

    def _errors_near(self, theta: Array, stairs: bool) -> Callable[[int, Array], Array]:
        """The residual, up to a constant, as a function of (entry changed, vector).

        An entry of an effect that only adds to the output changes that effect's contribution and nothing else.
        """
        if self.table.kind == "positions":
            return lambda _, vector: self.residual(vector)
        samples = self.table.samples if isinstance(self.table, Stretches) else self.table
        steps = self.layout.steps(theta)
        even = [i for i, (effect, _) in enumerate(steps) if stairs or not effect.rounds]
        near, beside_stairs = Near(samples, steps), Near(samples, [steps[i] for i in even])

        def error(k: int, vector: Array) -> Array:
            term = self.layout.slots[k].term
            values = self.layout.values(term, vector)
            output = beside_stairs.output(even.index(term), values) if term in even else near.output(term, values)
            return self._reduced(-output)

        return error

    @cached_property
    def white(self) -> Array | None:
        """Each mean's standard deviation by white noise, in the residual's unit, (channels, n); None if not known."""
        if isinstance(self.table, Stretches):
            return self.table.white
        std = white_std(self.table)
        if std is None and self.table.content in ("fields", "rates"):
            return scatter(self.table)
        if self.table.kind in KNOWN or std is None:
            return None if std is None else std.T
        return norm_std(self.table, std).T / self.layout.nominal

    @property
    def given(self) -> tuple[Processes, ...]:
        """Slow noise of each channel that is known from a still record; none where nothing is."""
        return tuple(self.table.noise[channel] for channel in self.channels) if self.table.noise else ()

    @cached_property
    def gap_s(self) -> Array:
        """Time between each row and the one before it, s, shape (n,); 0 where no time is given and none is needed."""
        if self.table.content in ("fields", "rates") and "t_s" not in self.table:
            return np.zeros(self.table.n)
        return np.diff(self.table.time_s, prepend=self.table.time_s[0])

    @cached_property
    def smooth(self) -> Array:
        """Columns set aside when noise is estimated, shape (n, k)."""
        return smooth_columns(self.table)


def _channels(table: Table) -> tuple[str, ...]:
    if isinstance(table, Stretches):
        return table.channels
    return table.axes if table.kind in KNOWN else ("norm",)


def _check_fields(model: Model, table: Table) -> None:
    """Raises ModelError for a magnetometer without a field, DataError where the rows cannot show an effect."""
    if table.content == "fields" and STRENGTH not in model.effects:
        raise ModelError(
            f"{table.source}: a model of magnetometers needs the effect {STRENGTH}, and {model.name} has "
            f"{', '.join(model.effects)}; take the model field or magnetometer"
        )
    for effect in (term.effect for term in model.terms if table.content in term.effect.kinds):
        if why := effect.lacks(table):
            raise DataError(f"{table.source}: {effect.name} is not fitted: {why}")


def _check_positions(table: Table) -> None:
    """Positions turn each of three axes. Raises DataError."""
    if len(table.axes) < 3:
        raise DataError(
            f"{table.source}: models of positions need the columns ax, ay, az, or mx, my, mz; "
            f"it has: {', '.join(table.columns)}"
        )
    _check_changes(table, "positions turn each axis up and down")


def _check_changes(table: Table, but: str) -> None:
    still = [name for name, spread in zip(table.output_names, np.ptp(table.outputs, axis=0), strict=True) if not spread]
    if still:
        raise DataError(f'{table.source}: the column "{still[0]}" never changes; {but}')
