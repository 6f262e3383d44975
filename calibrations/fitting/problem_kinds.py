"""The least-squares problem of each kind of table, and `make_problem`, which chooses it.

poses, rates   `Problem`: measured minus predicted output
positions      |a| - 1, where a is the specific force that the model computes from the output, in g
fields         the same of the field, as a share of its strength (that of the sphere nearest to the outputs)
motion         the parts of measured minus predicted output in each stretch of the record
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from calibrations.errors import DataError, ModelError, TooFewRows
from calibrations.fitting.problem import Problem
from calibrations.means.noise import norm_std, rms
from calibrations.model import Model
from calibrations.model.chain import Step, backward, magnitude_by_output, sensed, slope_at
from calibrations.model.linearised_chain import LinearisedChain
from calibrations.model.parameters import Layout
from calibrations.table import Array, Table
from calibrations.tables import FITTED_KINDS

if TYPE_CHECKING:
    from calibrations.geometry.turns import Turns
    from calibrations.motion.stretches import Stretches

STRENGTH = "field-strength"


class RateProblem(Problem):
    """Outputs of a gyroscope at known rates."""

    @staticmethod
    def check(model: Model, table: Table) -> None:  # noqa: ARG004
        """Raises DataError for an output that never changes."""
        _check_changes(table, "each gyroscope output must change when the table turns; check its channel and its cable")


class InverseProblem(Problem):
    """Rows whose residual follows from the sensed quantity, which the model computes from the outputs."""

    @property
    def unit(self) -> str:
        """The unit of the sensed quantity."""
        return self.table.input_unit

    @property
    def adds(self) -> bool:
        """The residual is not linear in any parameter."""
        return False

    def sensed(self, theta: Array) -> Array:
        """The sensed quantity that the model computes from the outputs."""
        steps = self.layout.steps(theta)
        return sensed(backward(self.samples, steps), self.samples, steps)

    def of_output(self, theta: Array, changes: Array) -> Array:
        """Derivative of the residual with respect to each output."""
        return self._response_to(self._chain_at(self.layout.steps(theta)))(changes)

    def _response_to(self, chain: LinearisedChain) -> Callable[[Array], Array]:
        """The function from changes of the outputs (samples, 3, m) to changes of the residual (channels, n, m)."""
        raise NotImplementedError

    def _chain_at(self, steps: Sequence[Step]) -> LinearisedChain:
        """The linearised inverse of the chain: from the outputs to the sensed quantity."""
        return LinearisedChain(self.samples, steps, backward(self.samples, steps))

    def _changes_near(self, theta: Array, stairs: bool) -> Callable[[int, float, float], Array]:  # noqa: ARG002
        """The response at the same sensed quantity changes; the residual follows it as it follows the outputs."""
        chain = self._chain_at(self.layout.steps(theta))
        response = self._response_to(chain)

        def change(k: int, upper: float, lower: float) -> Array:
            term = self.layout.slots[k].term
            values = (self.layout.values_with(chain.steps[term][1], k, value) for value in (upper, lower))
            return response(chain.change(term, *values)[:, :, None])[:, :, 0]

        return change


class PositionProblem(InverseProblem):
    """Magnitudes of the sensed quantity, of which only the strength is known."""

    signal = "magnitude"

    @property
    def signal_rms(self) -> Array:
        """The magnitude is 1."""
        return np.ones(1)

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

    def residual_by(self, steps: Sequence[Step]) -> Array:
        """The magnitude less the known one, shape (1, n)."""
        error: Array = np.linalg.norm(backward(self.table, steps), axis=1)[:, None] - 1.0
        return error.T

    def _response_to(self, chain: LinearisedChain) -> Callable[[Array], Array]:
        by_output = magnitude_by_output(chain.static, self.table, chain.steps)
        return lambda changes: np.asarray(-np.einsum("ni,nim->nm", by_output, changes)[None])

    def _white(self, std: Array) -> Array:
        return norm_std(self.table, std).T / self.layout.nominal


class FieldProblem(PositionProblem):
    """Magnitudes of a field, whose strength is a parameter."""

    @staticmethod
    def check(model: Model, table: Table) -> None:
        """Check the table as one of positions; raises ModelError for a model without a field."""
        PositionProblem.check(model, table)
        if STRENGTH not in model.effects:
            raise ModelError(
                f"{table.source}: a model of magnetometers needs the effect {STRENGTH}, and {model.name} has "
                f"{', '.join(model.effects)}; take the model field or magnetometer"
            )

    def residual_by(self, steps: Sequence[Step]) -> Array:
        """The residual as a share of the field strength that the outputs show, not of the model's strength.

        Relative to the model's own strength, an infinite field would make every residual 0.
        """
        return super().residual_by(steps) * self._strength(steps)

    def _strength(self, steps: Sequence[Step]) -> float:
        """The model's strength of the field over that which the outputs show."""
        strengths = [float(p["total"]) for effect, p in steps if effect.name == STRENGTH]
        return strengths[0] / self.layout.nominal if strengths else 1.0

    def _response_to(self, chain: LinearisedChain) -> Callable[[Array], Array]:
        response, strength = super()._response_to(chain), self._strength(chain.steps)
        return lambda changes: response(changes) * strength

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
class SummedProblem(Problem):
    """Rows that sum up many samples: stretches of a motion, turns of a gyroscope."""

    table: Stretches | Turns

    @property
    def adds(self) -> bool:
        """A row is not linear in any parameter, or is fitted by its own steps (`keeps_starts`)."""
        return False

    @cached_property
    def white(self) -> Array | None:
        """White noise of each row, from its samples."""
        return self.table.white

    @property
    def samples(self) -> Table:
        return self.table.samples


@dataclass(frozen=True)
class MotionProblem(SummedProblem):
    """The motion of a record, as its stretches represent it."""

    table: Stretches

    keeps_starts = True  # one attitude cannot separate scale factor and bias of an axis that does not move
    averages = False  # some tens of stretches allow nearly any slow noise: Student's t is used instead

    @staticmethod
    def prepared(table: Table) -> Table:
        """A row for each stretch."""
        from calibrations.motion.stretches import make_stretches  # other kinds need no spectra

        return make_stretches(table)

    @property
    def channels(self) -> tuple[str, ...]:
        """Axis and part, such as "x in phase at 10 Hz"."""
        return self.table.channels

    def of_output(self, theta: Array, changes: Array) -> Array:
        """Behind the output filter."""
        from calibrations.motion.spectrum import sample_output  # other kinds need no spectra

        filtered = [sample_output(change, self.samples) for change in np.moveaxis(changes, 2, 0)]
        return super().of_output(theta, np.stack(filtered, axis=2))

    def _reduced(self, error: Array) -> Array:
        return self.table.parts(error)


@dataclass(frozen=True)
class TurnProblem(InverseProblem, SummedProblem):
    """Turns between rests, as the rates by the model make them."""

    table: Turns

    signal = "rate of the turns"

    @property
    def signal_rms(self) -> Array:
        """The mean rates of the turns, deg/s."""
        return np.array([rms(self.table.column("rate_deg_s"))])

    @staticmethod
    def prepared(table: Table) -> Table:
        """A row for each turn."""
        from calibrations.geometry.turns import make_turns  # other kinds integrate no rates

        return make_turns(table)

    @property
    def channels(self) -> tuple[str, ...]:
        """The angle of the turn along its axis and across it, and the rates at rest."""
        from calibrations.geometry.turns import CHANNELS

        return CHANNELS

    def residual_by(self, steps: Sequence[Step]) -> Array:
        """The residual of turns and rests, shape (channels, n)."""
        return self.table.residual(backward(self.samples, steps))

    def _response_to(self, chain: LinearisedChain) -> Callable[[Array], Array]:
        slope = slope_at(chain.static, self.samples, chain.steps)
        by_rate = self.table.by_rate(chain.static).transpose(0, 2, 1)
        by_output = -np.linalg.solve(slope.transpose(0, 2, 1), by_rate).transpose(0, 2, 1)  # (samples, channels, 3)
        return lambda changes: self.table.add_up(by_output @ changes)


PROBLEMS: Mapping[str, type[Problem]] = MappingProxyType(
    {
        "poses": Problem,
        "rates": RateProblem,
        "positions": PositionProblem,
        "fields": FieldProblem,
        "motion": MotionProblem,
        "turns": TurnProblem,
    }
)


def make_problem(model: Model, table: Table) -> Problem:
    """The problem of a model on a table. Raises ModelError, DataError and TooFewRows if it cannot be solved."""
    check_kind(table.kind, table.source)
    problem = PROBLEMS[table.content]
    table = problem.prepared(table)
    problem.check(model, table)
    _check_effects(model, table)
    model = model.for_table(table)
    if not model.terms:
        raise ModelError(
            f"{table.source}: no effect of the model {model.name} exists for {table.content}; `rig models` lists others"
        )
    made = problem(table, Layout.of(model, table))
    free = int(np.sum(made.layout.free))
    if table.n * len(made.channels) <= free:
        raise TooFewRows(
            f"{table.source}: {table.n} rows cannot determine the {free} parameters of {model.name}; "
            "measure more poses, or take a smaller model"
        )
    return made


def check_kind(kind: str, source: str) -> None:
    """Raises ModelError for tables to which no model is fitted; known before any sample of theirs is read."""
    if kind not in FITTED_KINDS:
        table = "a still record" if kind == "still" else f"a table of {kind}"
        raise ModelError(f"{source}: models are fitted to poses, positions, motion, rates or turns, not to {table}")


def _check_effects(model: Model, table: Table) -> None:
    """Raises DataError where the rows cannot show an effect of the model."""
    for effect in (term.effect for term in model.terms if table.content in term.effect.kinds):
        if reason := effect.lacks(table):
            raise DataError(f"{table.source}: {effect.name} is not fitted: {reason}")


def _check_changes(table: Table, but: str) -> None:
    still = [name for name, spread in zip(table.output_names, np.ptp(table.outputs, axis=0), strict=True) if not spread]
    if still:
        raise DataError(f'{table.source}: the column "{still[0]}" never changes; {but}')
