"""A compensation beside unseen poses: what it leaves of the specific force that the stages set, and what the linear
model of the data sheet leaves, which is fitted to these very poses (Ang Fig. 12, at rest).

The truth is the specific force at the poses as the model of the rig has them: its pose effects are the stages'.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calibrations.chain import force, sensed
from calibrations.compensation.cost import in_gravity
from calibrations.compensation.forward import FORCES, OF_THE_RIG, steps_of
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.memory import memory_at
from calibrations.errors import DataError
from calibrations.fit import fit
from calibrations.model_file import read_model
from calibrations.noise import rms
from calibrations.numerals import plain
from calibrations.table import AXES, Array, Table

LINEAR = "linear"


@dataclass(frozen=True)
class Residual:
    """Errors of the specific force in mm/s^2, shape (n, axes), rows in order of time."""

    table: Table
    axes: tuple[str, ...]
    linear: Array
    compensated: Array

    @property
    def rmse(self) -> Mapping[str, tuple[float, float]]:
        """By axis: linear, compensated, mm/s^2."""
        each = zip(self.axes, rms(self.linear.T), rms(self.compensated.T), strict=True)
        return {axis: (float(a), float(b)) for axis, a, b in each}

    def lines(self) -> list[str]:
        """For people."""
        return [
            f"{axis}: rms error {plain(before)} mm/s² by the linear model, {plain(after)} mm/s² compensated, "
            f"{100 * (1 - after / before):.1f} % less, on {self.table.n} poses of {self.table.source}"
            for axis, (before, after) in self.rmse.items()
        ]

    def document(self) -> dict[str, Any]:
        """As JSON."""
        rmse = {axis: {"linear": before, "compensated": after} for axis, (before, after) in self.rmse.items()}
        return {"data": self.table.source, "n": self.table.n, "unit": "mm/s^2", "rmse": rmse}


def residual(made: Compensation, table: Table) -> Residual:
    """What is left of a table of poses. Raises DataError for another kind, and MissingColumn for an input it lacks."""
    if table.kind != "poses" or made.unit != "g":
        raise DataError(
            f"{table.source}: a compensation is set beside poses of an accelerometer, not beside {table.kind}"
        )
    table = table.in_order()
    rigs = {fate.effect for fate in made.forward.fates if fate.how == OF_THE_RIG}
    a = force(table, [step for step in steps_of(made.model) if step[0].name in rigs])
    found = _compensated(made, table, a)
    axes = tuple(axis for axis in made.forward.axes if axis in table.axes)
    true = np.column_stack([a[:, AXES.index(axis)] for axis in axes])
    linear = fit(read_model(LINEAR), replace(table, source=LINEAR)).model
    values = {(e.name, e.axis): e.value for term in linear.terms for e in term.estimates}
    by_hand = [
        (table.outputs[:, table.axes.index(axis)] - values["bias", axis]) / values["scale", axis] for axis in axes
    ]
    unit = 1e3 * table.gravity_m_s2
    return Residual(
        table,
        axes,
        unit * (np.column_stack(by_hand) - true),
        unit * (np.column_stack([found[f"a{axis}"] for axis in axes]) - true),
    )


def _compensated(made: Compensation, table: Table, a: Array) -> dict[str, Array]:
    """By the program alone: an axis that is not measured comes from gravity and the side that is up."""
    program = made.program
    inputs = {
        name: table.column(f"{name}_v" if name[0] == "v" else name) for name in program.inputs if name not in FORCES
    }
    memory = memory_at(table, sensed(a, table, steps_of(made.model)), made.forward)
    if made.costs.out_of_gravity is not None:
        return in_gravity(program, inputs | memory, np.where(a[:, 2] < 0, -1.0, 1.0))
    return program.run(inputs | memory | {name: a[:, k] for k, name in enumerate(FORCES) if name in program.inputs})
