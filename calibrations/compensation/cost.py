"""Errors of a compensation over a simulated sweep: by effects left out, by an axis that is not measured, and by the
uncertainties of its parameters.

The sweep holds the sensor in gravity alone, with every effect of the model but those of the rig, at angles approached
from both sides. Temperature, supply and further inputs go up and down over their stated ranges.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calibrations.compensation.forward import FORCES, INVERTED, Forward, steps_of
from calibrations.compensation.program import Program
from calibrations.effects.logged import RATE
from calibrations.errors import CalibrationError, ModelError
from calibrations.geometry.orientation import reported_force
from calibrations.geometry.stage_path import sensed_turning_points
from calibrations.model import Estimate, Model, Term
from calibrations.model.chain import Step, respond, sensed
from calibrations.table import AXES, Array, Table

# The uncertainty of the result by the uncertainties of the parameters.
#
# A parameter such as a temperature coefficient multiplies the distance of an input from its reference. The uncertainty
# grows with this distance. So there are two figures: over all directions of gravity, with inputs in the range of the
# calibration data; and the greatest over the stated ranges of all inputs.

PARAMETER_STEP = 1e-3  # of a standard uncertainty: steps of derivatives
INPUT_LEVELS = 9  # of an input over its range, one after the other
LOG_DECADES = 6  # decades towards the lower end, for changes soon after power-on
REFERENCES = {"temperature_c": "reference_c", "supply_v": "reference_v"}  # constants of models

Span = tuple[float, float]
Inputs = Mapping[str, float]
Stds = Callable[[Inputs], Array]


@dataclass(frozen=True)
class Uncertainty:
    """The worst axis: rms and maximum with inputs `within` the calibrated ranges; `largest` of all inputs, at `at`."""

    within: Mapping[str, Span]
    rms: float
    most: float
    largest: float
    at: Inputs


def result_uncertainty(
    model: Model, forward: Forward, table: Table, a: Array, spans: Mapping[str, Span], reach: float
) -> Uncertainty | None:
    """Uncertainty from the parameters' standard uncertainties and correlations; None if the model has none.

    For the specific force `a` (n, 3) of the rows of `table`, and for `a` scaled to `reach` on its largest axis; `spans`
    has the stated range of each input besides the outputs. Source  GUM 5.2.2.
    """
    if not any(e.std and e.identified for e in model.params.values()):
        return None
    inputs = {name: span for name, span in spans.items() if name not in FORCES}
    covered = {name: _measured_span(name, span, model) for name, span in inputs.items()}
    far = reach * a / np.abs(a).max(axis=1, keepdims=True)
    stds = np.concatenate([_stds(model, forward, table, a, point) for point in _corners(covered)])
    point, largest = _largest_error(lambda place: _stds(model, forward, table, far, place), inputs)
    rms = float(np.sqrt(np.mean(stds**2, axis=0)).max())
    return Uncertainty(covered, rms, float(stds.max()), max(largest, float(stds.max())), point)


def _measured_span(name: str, stated_span: Span, model: Model) -> Span:
    """The range of an input during the measurement of the parameters, limited to the stated range.

    The range that the data covered, by the model file, or its reference; the whole range if neither is known.
    """
    constants = {key: value for term in model.terms for key, value in term.constants.items()}
    reference = constants.get(REFERENCES.get(name, ""))
    low, high = model.covered.get(name, stated_span if reference is None else (reference, reference))
    return float(np.clip(low, *stated_span)), float(np.clip(high, *stated_span))


def _corners(spans: Mapping[str, Span]) -> list[Inputs]:
    """Every combination of the lowest, middle and highest value of each input."""
    levels = [dict.fromkeys((low, (low + high) / 2, high)) for low, high in spans.values()]
    return [dict(zip(spans, values, strict=True)) for values in product(*levels)]


def _largest_error(stds: Stds, spans: Mapping[str, Span]) -> tuple[Inputs, float]:
    """Place and value of the maximum: from the worst corner, each input in turn is varied over its range."""

    def most(place: Inputs) -> float:
        return float(stds(place).max())

    best = max(_corners(spans), key=most)
    for name, (low, high) in spans.items():
        early = low + (high - low) * np.geomspace(10.0**-LOG_DECADES, 1, 3 * LOG_DECADES)
        levels = [*np.linspace(low, high, INPUT_LEVELS).tolist(), *early.tolist()]
        best = max([best, *({**best, name: value} for value in levels)], key=most)
    return best, most(best)


def _stds(model: Model, forward: Forward, table: Table, a: Array, inputs: Inputs) -> Array:
    """Standard uncertainties (n, axes) of the sensed quantity: u^2 = d^T R d, with d = J^-1 dG/dp u(p) and J = dG/da.

    R are the correlations of the parameters, 1 on the diagonal and 0 elsewhere where the model has none.
    """
    constant_table = replace(
        table, columns={**table.columns, **{name: np.full(table.n, value) for name, value in inputs.items()}}
    )
    k = ["xyz".index(axis) for axis in forward.axes]

    def output(perturbed: Model, force: Array) -> Array:
        steps = steps_of(perturbed)
        return respond(sensed(force, constant_table, steps), constant_table, steps)[:, k]

    h = 1e-5
    J = np.stack([(output(model, a + h * e) - output(model, a - h * e)) / (2 * h) for e in np.eye(3)[k]], axis=2)
    try:
        inverse = np.linalg.inv(J)
    except np.linalg.LinAlgError:
        raise ModelError(
            f"{model.name}: beside its bias, a change of the input changes no output; correct bias and scale factor "
            "in the model file"
        ) from None
    estimates = {key: e for key, e in model.params.items() if e.std and e.identified}
    sides = [(output(up, a), output(down, a)) for up, down in _perturb_models(model)]
    changes = np.stack([np.einsum("nij,nj->ni", inverse, up - down) for up, down in sides]) / (2 * PARAMETER_STEP)
    mixed = (
        changes
        if model.correlations is None
        else np.tensordot(model.correlations.submatrix(list(estimates)), changes, 1)
    )
    return np.asarray(np.sqrt(np.maximum(np.sum(changes * mixed, axis=0), 0.0)))


def _perturb_models(model: Model) -> Sequence[tuple[Model, Model]]:
    """The model with each known parameter increased and decreased by a small step, in the order of `params`."""
    return [
        (_with_change(model, i, j, PARAMETER_STEP * e.std), _with_change(model, i, j, -PARAMETER_STEP * e.std))
        for i, term in enumerate(model.terms)
        for j, e in enumerate(term.estimates)
        if e.std and e.identified
    ]


def _with_change(model: Model, i: int, j: int, change: float) -> Model:
    term: Term = model.terms[i]
    estimate: Estimate = replace(term.estimates[j], value=term.estimates[j].value + change)
    estimates = (*term.estimates[:j], estimate, *term.estimates[j + 1 :])
    return replace(model, terms=(*model.terms[:i], replace(term, estimates=estimates), *model.terms[i + 1 :]))


# The memory of a product at each row of a table, after the samples of the whole path to that row.
#
# Between poses the path is that of the stages, as in the effects themselves (`calibrations.geometry.stage_path`). The
# sensed values on it stand for the values of the product there; the two are as close as at the poses.


def memory_at(table: Table, a: Array, forward: Forward) -> dict[str, Array]:
    """The stored values by name, shape (n,), for the sensed quantity `a` (n, 3) at the rows; empty without any.

    Rows in order of time.
    """
    if not forward.memory:
        return {}
    steps = [step for step in steps_of(forward.model) if step[0].name in forward.remembering]
    stored = np.array(list(_memories_by_row(table, a, steps)))  # (n, slots, 3)
    columns = {f"m{slot}{axis}": stored[:, slot, k] for slot in range(stored.shape[1]) for k, axis in enumerate(AXES)}
    return {name: columns[name] for name in forward.memory}


def _memories_by_row(table: Table, a: Array, steps: Sequence[Step]) -> Iterator[list[Array]]:
    """The memory before each row, (3,) for every slot."""
    stored = [[np.zeros((1, 3))] * effect.memory for effect, _ in steps]
    paths = sensed_turning_points(table, a) if "alpha_deg" in table else np.empty((table.n, 0, 3))
    for i in range(table.n):
        row = table.rows(np.array([i]))
        for force in paths[i]:
            stored = _next_memories(steps, force, row, stored)
        yield [slot[0] for slots in stored for slot in slots]
        stored = _next_memories(steps, a[i], row, stored)


def _next_memories(steps: Sequence[Step], force: Array, row: Table, memories: list[list[Array]]) -> list[list[Array]]:
    """The memory of each effect after one more sample of the specific `force`, (3,)."""
    return [
        list(effect.follow(force[None], row, p, slots)[1])
        for (effect, p), slots in zip(steps, memories, strict=True)
        if effect.memory
    ]


INCLINATIONS_DEG = (90, 30, 150, 60, 120, 10, 170)
STEP_DEG = 15.0
PASSES = 3  # for the axis without measurement, from gravity


@dataclass(frozen=True)
class ErrorSize:
    """An error's root mean square and greatest magnitude over the sweep, worst axis."""

    rms: float
    most: float


@dataclass(frozen=True)
class Cost:
    """`left_out` by effect, None where a sweep does not show it; `out_of_gravity` of an axis found from the others;
    `parameters`: the standard uncertainty of the sensed quantity, from those of the parameters.
    """

    left_out: Mapping[str, ErrorSize | None]
    out_of_gravity: ErrorSize | None
    parameters: Uncertainty | None


def compensation_costs(
    model: Model, forward: Forward, program: Program, reach: float, unit: str, spans: Mapping[str, Span]
) -> Cost:
    """All costs of a compensation, in `unit`; `spans` has the stated ranges of the inputs besides the outputs."""
    table = _sweep(model, spans)
    a = reported_force(table) * (1.0 if unit != "deg/s" else reach)
    fates = {fate.effect: fate.how for fate in forward.fates}
    followed = [step for step in steps_of(model) if fates[step[0].name] == INVERTED]
    trial = _Trial(forward, program, table, a, memory_at(table, sensed(a, table, followed), forward))
    names = {effect.name for effect, _ in followed}
    reduced = replace(model, terms=tuple(term for term in model.terms if term.name in names))
    needs_gravity = unit == "g" and len(forward.axes) == 2 and "az" in program.inputs
    return Cost(
        {name: _error_of_excluded_effect(name, model, followed, trial) for name in forward.left_out},
        _gravity_error(followed, trial) if needs_gravity else None,
        result_uncertainty(
            reduced, forward, table, a, {name: spans[name] for name in program.inputs if name in spans}, reach
        ),
    )


@dataclass(frozen=True)
class _Trial:
    """A sweep on which the program is tried: its specific force `a` (n, 3), and the stored values at each row."""

    forward: Forward
    program: Program
    table: Table
    a: Array
    memory: Mapping[str, Array]

    def inputs(self, steps: Sequence[Step]) -> dict[str, Array]:
        """Inputs of the program, for a sensor with these steps."""
        v = respond(sensed(self.a, self.table, steps), self.table, steps)
        by_name = {f"v{axis}": v[:, k] for k, axis in enumerate("xyz")}
        by_name |= {name: self.a[:, k] for k, name in enumerate(FORCES)}
        columns = {name: by_name[name] if name in by_name else self.table.column(name) for name in self.program.inputs}
        return columns | dict(self.memory)

    def size(self, result: Mapping[str, Array]) -> ErrorSize:
        """The error of the computed values."""
        return _size(np.column_stack([result[f"a{x}"] - self.a[:, "xyz".index(x)] for x in self.forward.axes]))


def restore_axis_by_gravity(program: Program, inputs: Mapping[str, Array], side: Array) -> dict[str, Array]:
    """The result of the program where only gravity acts and z is not measured: |a| = 1, z on the `side` +1 or -1.

    Source  Ang (5)-(7), with the model in place of the linear estimate. Fixed passes, as the written sources do.
    """
    result = program.run({**inputs, "az": np.zeros(np.shape(side))})
    for _ in range(PASSES):
        az = side * np.sqrt(np.maximum(0.0, 1 - result["ax"] ** 2 - result["ay"] ** 2))
        result = program.run({**inputs, "az": az})
    return result


def _sweep(model: Model, spans: Mapping[str, Span]) -> Table:
    """A table of poses: a turn each way at each inclination, 7 s a pose, all else but the time over its range."""
    up = np.arange(0.0, 360.0 + STEP_DEG / 2, STEP_DEG)
    alpha = np.repeat(np.array(INCLINATIONS_DEG, float), 2 * len(up))
    beta = np.tile(np.concatenate([up, up[::-1]]), len(INCLINATIONS_DEG))
    n = len(alpha)
    wave = np.sin(np.linspace(0, 4 * np.pi, n))
    constants = {name: value for term in model.terms for name, value in term.constants.items()}
    columns = {
        "alpha_deg": alpha,
        "beta_deg": beta,
        "direction": np.tile(np.repeat([1.0, -1.0], len(up)), len(INCLINATIONS_DEG)),
        "t_s": constants.get("middle_s", 0.0) + 7.0 * (np.arange(n) - n / 2) + 3.5 * n * ("middle_s" not in constants),
        "vx_v": np.zeros(n),
    }
    columns |= {
        name: (low + high) / 2 + (high - low) / 2 * wave for name, (low, high) in spans.items() if name not in columns
    }
    if RATE in columns and "temperature_c" in columns:
        columns[RATE] = np.gradient(columns["temperature_c"], columns["t_s"])
    return Table.from_columns("poses", columns, source="a simulated sweep")


def _size(errors: Array) -> ErrorSize:
    return ErrorSize(float(np.sqrt(np.mean(errors**2, axis=0)).max()), float(np.abs(errors).max()))


def _error_of_excluded_effect(name: str, model: Model, followed: Sequence[Step], trial: _Trial) -> ErrorSize | None:
    """Error that remains if the model has this effect and the compensation leaves it out."""
    steps = [s for s in steps_of(model) if s[0].name == name or any(s[0] is step[0] for step in followed)]
    try:
        inputs = trial.inputs(steps)
    except CalibrationError:  # it needs what no sweep has, such as a motion
        return None
    return trial.size(trial.program.run(inputs))


def _gravity_error(followed: Sequence[Step], trial: _Trial) -> ErrorSize:
    side = np.where(trial.a[:, 2] < 0, -1.0, 1.0)
    return trial.size(restore_axis_by_gravity(trial.program, trial.inputs(followed), side))
