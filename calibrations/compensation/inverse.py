"""Inversion of a calibrated model: a program from outputs to specific force, its proved bound, and its errors."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calibrations.compensation.bound import Bound, prove_bound
from calibrations.compensation.cost import Cost, compensation_costs, memory_at, restore_axis_by_gravity
from calibrations.compensation.forward import (
    FORCES,
    INVERTED,
    NOTHING,
    OF_THE_RIG,
    Forward,
    input_unit,
    known_at_run_time,
    steps_of,
    trace_model,
)
from calibrations.compensation.graph import variable_names
from calibrations.compensation.program import Program, write_program
from calibrations.effects.logged import RATE, temperature_rate_c_s
from calibrations.errors import DataError, ModelError
from calibrations.fitting.fit import fit
from calibrations.means.noise import rms
from calibrations.model import Model
from calibrations.model.chain import force, sensed
from calibrations.model.file import read_model
from calibrations.table import AXES, Array, Table
from calibrations.text import rounded

DEFAULT_REACH = {
    "g": 1.5,
    "field": 1.5,
    "deg/s": 300.0,
}  # default range of the sensed quantity, to either side
DEFAULT_INPUTS = {
    "temperature_c": (-20.0, 85.0),
    "supply_v": (4.75, 5.25),
    "t_s": (0.0, 1e7),
    RATE: (-0.02, 0.02),
}  # C, V, s, C/s
DEFAULT_TOLERANCE = {"double": 1e-12, "float": 1e-7}  # remaining error after the last step, as a share of the range


@dataclass(frozen=True)
class Range:
    """The range of the proof: `reach` to either side of 0 on every axis, and the ranges of the other inputs."""

    reach: float
    input_limits: Mapping[str, tuple[float, float]] = field(default_factory=lambda: dict(DEFAULT_INPUTS))

    @staticmethod
    def for_model(model: Model, reach: float | None = None, **input_limits: tuple[float, float]) -> Range:
        """The default range for the model's kind of sensor, with the given `reach` and ranges by input name."""
        constants = {name: value for term in model.terms for name, value in term.constants.items()}
        supply = (
            {"supply_v": (0.95 * constants["reference_v"], 1.05 * constants["reference_v"])}
            if "reference_v" in constants
            else {}
        )
        return Range(reach or DEFAULT_REACH[input_unit(model)], DEFAULT_INPUTS | supply | input_limits)

    def of(self, inputs: Collection[str]) -> dict[str, tuple[float, float]]:
        """The range of each input besides the outputs; another axis' force has the sensor's own range.

        Raises ModelError for an input with unknown range.
        """
        ranges = dict.fromkeys(FORCES, (-self.reach, self.reach)) | dict(self.input_limits)
        for name in inputs:
            if name not in ranges:
                raise ModelError(f"the range of the input {name} is unknown; give --input {name}=LOW:HIGH")
        return {name: ranges[name] for name in inputs}


@dataclass(frozen=True)
class Compensation:
    """The input of the writers. `costs` are in the unit of the sensed quantity."""

    model: Model
    forward: Forward
    range: Range
    bound: Bound
    program: Program
    precision: str
    unit: str
    costs: Cost

    @property
    def input_limits(self) -> dict[str, tuple[float, float]]:
        """The inputs besides the outputs, with their ranges."""
        return self.range.of(self.program.inputs[len(self.forward.axes) :])


def invert_model(
    model: Model, input_range: Range | None = None, without: Collection[str] = (), precision: str = "double"
) -> Compensation:
    """The compensation of a fitted model over `input_range`, without the effects in `without`.

    `input_range` is by default that of the data of the fit; `precision` is "double" or "float".

    Raises ModelError for a model without values, and for one without a provable inverse over the range, with the effect
    that prevents it.
    """
    unknown = [name for name in without if name not in model.effects]
    if unknown:
        raise ModelError(f"{model.name}: the model has no effect {unknown[0]}; it has {', '.join(model.effects)}")
    if all(known_at_run_time(term.effect) == NOTHING for term in model.terms):
        raise ModelError(f"{model.name}: a model of noise alone has no inverse; give the model of a sensor")
    unit = input_unit(model)
    input_range = input_range or Range.for_model(model)
    forward = trace_model(model, without)
    bound = _bound(forward, input_range, precision)
    if bound is None:
        raise ModelError(_explain_missing_inverse(model, input_range, without, precision, unit))
    program = write_program(forward, bound)
    return Compensation(
        model,
        forward,
        input_range,
        bound,
        program,
        precision,
        unit,
        compensation_costs(model, forward, program, input_range.reach, unit, input_range.input_limits),
    )


def _bound(forward: Forward, input_range: Range, precision: str) -> Bound | None:
    inputs = input_range.of(
        [name for name in variable_names(forward.outputs) if name not in {*forward.unknowns, *forward.memory}]
    )
    want = DEFAULT_TOLERANCE[precision] * input_range.reach
    return prove_bound(forward.outputs, forward.unknowns, input_range.reach, inputs, want, tuple(forward.memory))


def _explain_missing_inverse(
    model: Model, input_range: Range, without: Collection[str], precision: str, unit: str
) -> str:
    """The message for a model without a provable inverse; it names a single effect that prevents it."""
    inverted = [fate.effect for fate in trace_model(model, without).fates if fate.how == INVERTED]
    guilty = [n for n in inverted if _bound(trace_model(model, [*without, n]), input_range, precision) is not None]
    message = (
        f"{model.name}: the inverse does not converge for certain within +-{input_range.reach:g} {unit}: no number of "
        "steps is "
        "proved to be enough"
    )
    if guilty:
        return (
            f"{message}. It converges without {guilty[-1]}: use --leave-out {guilty[-1]}, which reports the error "
            "due to it"
        )
    return f"{message}; take a smaller --range, or leave out the most nonlinear effect with --leave-out EFFECT"


# Errors of a compensation on unseen poses, compared with the data sheet's linear model fitted to the same poses
# (Ang Fig. 12, at rest).
#
# The true value is the specific force at the poses, with the pose effects of the model, which belong to the stages.

LINEAR_MODEL = "linear"


@dataclass(frozen=True)
class Residual:
    """Errors of the specific force in mm/s^2, shape (n, axes), rows in order of time."""

    table: Table
    axes: tuple[str, ...]
    linear: Array
    compensated: Array

    @property
    def rmse(self) -> Mapping[str, tuple[float, float]]:
        """RMS error, mm/s^2, of each axis: with the linear model, and compensated."""
        errors = zip(self.axes, rms(self.linear.T), rms(self.compensated.T), strict=True)
        return {axis: (float(a), float(b)) for axis, a, b in errors}

    def lines(self) -> list[str]:
        """The result as lines of text."""
        return [
            f"{axis}: rms error {rounded(rms_linear)} mm/s² by the linear model, {rounded(rms_compensated)} mm/s² "
            f"compensated, {100 * (1 - rms_compensated / rms_linear):.1f} % less, "
            f"on {self.table.n} poses of {self.table.source}"
            for axis, (rms_linear, rms_compensated) in self.rmse.items()
        ]

    def document(self) -> dict[str, Any]:
        """The result as a JSON document."""
        rmse = {
            axis: {"linear": rms_linear, "compensated": rms_compensated}
            for axis, (rms_linear, rms_compensated) in self.rmse.items()
        }
        return {"data": self.table.source, "n": self.table.n, "unit": "mm/s^2", "rmse": rmse}


def compensate_residual(compensation: Compensation, table: Table) -> Residual:
    """Errors on a table of poses. Raises DataError for another kind, MissingColumn for a missing input."""
    if not table.type.stage_angles or compensation.unit != "g":
        raise DataError(
            f"{table.source}: a compensation is compared with poses of an accelerometer, not with {table.kind}"
        )
    table = table.in_order()
    rigs = {fate.effect for fate in compensation.forward.fates if fate.how == OF_THE_RIG}
    a = force(table, [step for step in steps_of(compensation.model) if step[0].name in rigs])
    result = _compensate(compensation, table, a)
    axes = tuple(axis for axis in compensation.forward.axes if axis in table.axes)
    true = np.column_stack([a[:, AXES.index(axis)] for axis in axes])
    linear = fit(read_model(LINEAR_MODEL), replace(table, source=LINEAR_MODEL)).model
    by_hand = [
        (table.outputs[:, table.axes.index(axis)] - linear[f"bias.{axis}"].value) / linear[f"scale-factor.{axis}"].value
        for axis in axes
    ]
    unit = 1e3 * table.gravity_m_s2
    return Residual(
        table,
        axes,
        unit * (np.column_stack(by_hand) - true),
        unit * (np.column_stack([result[f"a{axis}"] for axis in axes]) - true),
    )


def _input(name: str, table: Table) -> Array:
    """An input of a program in the rows of a table."""
    if name == RATE:
        return temperature_rate_c_s(table)
    return table.output(name[1]) if name[0] == "v" else table.column(name)


def _compensate(compensation: Compensation, table: Table, a: Array) -> dict[str, Array]:
    """The program's output; an axis without measurement follows from gravity and the side that is up."""
    program = compensation.program
    inputs = {name: _input(name, table) for name in program.inputs if name not in FORCES}
    memory = memory_at(table, sensed(a, table, steps_of(compensation.model)), compensation.forward)
    if compensation.costs.out_of_gravity is not None:
        return restore_axis_by_gravity(program, inputs | memory, np.where(a[:, 2] < 0, -1.0, 1.0))
    return program.run(inputs | memory | {name: a[:, k] for k, name in enumerate(FORCES) if name in program.inputs})
