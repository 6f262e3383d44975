"""The compensation as a JSON document `rig.compensation/1`, for writers of other languages.

`before`, `loop` and `after` are lines [name, operation, [operands]]; operands are names and numbers. Run `before` once,
start every output at 0, and run `loop` `steps` times, each time setting the outputs to `next`. Names in `remembered`
are 0 before the first sample; run `after` once, then set each to its operand. The operation "table" has the operands x
and the name of one of `tables`: with s = (x - low) / step, limited to 0 .. the number of pieces, and u = s - i within
piece i, its value is c0 + c1 u + c2 u^2 + c3 u^3.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from decimal import ROUND_CEILING, Context
from textwrap import wrap
from typing import Any

import numpy as np
import scipy  # scipy.stats loads slowly: it is imported at its first use

from calibrations.compensation.cost import ErrorSize
from calibrations.compensation.forward import FORCES, INVERTED, LEFT_OUT, NOISE, OF_THE_RIG
from calibrations.compensation.graph import evaluate_nodes
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.program import ProgramLine
from calibrations.documents import parameters_document
from calibrations.effects.logged import RATE
from calibrations.model import Estimate
from calibrations.model.correlations import Correlations
from calibrations.table import Array
from calibrations.text import as_written

WIDTH = 112
UPWARD = Context(prec=3, rounding=ROUND_CEILING)  # bounds are not rounded down
UNIT_TEXT = {
    "g": "g, the local gravity of the calibration",
    "field": "shares of the field at the calibration",
    "deg/s": "deg/s",
}
PROVENANCE_TITLES = {"data": "data", "data_sha256": "SHA-256 of the data", "created": "calibrated", "sensor": "sensor",
        "serial": "serial number", "gravity_m_s2": "local gravity, m/s^2"}  # fmt: skip
UNITS = {"temperature_c": "C", "supply_v": "V", "t_s": "s since the power came on",
         RATE: "C/s, rate of change of temperature_c; 0 at a steady temperature"}  # fmt: skip


@dataclass(frozen=True)
class Origin:
    """Name and digest of the model file, the program that wrote the source, and the date."""

    name: str
    model_file: str
    sha256: str
    program: str
    date: str


def header_lines(compensation: Compensation, origin: Origin) -> list[str]:
    """The head of a source file, wrapped; an empty line separates its sections."""
    sections = [
        _program_lines(compensation, origin),
        _inputs(compensation),
        _method_lines(compensation),
        _effects(compensation),
        _uncertainty(compensation),
        _parameters(compensation),
    ]
    return [line for section in sections for line in [*(w for text in section for w in _wrap(text)), ""]][:-1]


def error_text(value: float, unit: str) -> str:
    """An error in the unit of the sensed quantity; in mg for g."""
    return f"{1e3 * value:.2g} mg" if unit == "g" else f"{value:.2g} {unit}"


def steps_text(compensation: Compensation) -> str:
    """`7 steps`."""
    return f"{compensation.bound.steps} step{'s' if compensation.bound.steps > 1 else ''}"


def round_up(bound: float) -> str:
    """A bound to three digits, rounded up."""
    return f"{float(UPWARD.create_decimal(bound)):.3g}"


def unit_of_input(name: str, compensation: Compensation) -> str:
    """The unit of an input of the program."""
    if name[0] == "v" and name[1:] in compensation.forward.axes:
        return compensation.model.unit or "V"
    if name in ("ax", "ay", "az"):
        return compensation.unit
    return UNITS.get(name, "as in the calibration")


def operations_text(compensation: Compensation) -> str:
    """`113 add, 102 multiply: 215 a sample`."""
    count: Mapping[str, int] = compensation.program.operations
    return f"{', '.join(f'{n} {kind}' for kind, n in count.items())}: {sum(count.values())} a sample"


def _wrap(text: str) -> list[str]:
    indent = " " * (len(text) - len(text.lstrip()))
    return wrap(
        text.strip(), WIDTH, initial_indent=indent, subsequent_indent=indent + "  ", break_on_hyphens=False
    ) or [""]


def _program_lines(compensation: Compensation, origin: Origin) -> Iterator[str]:
    model = compensation.model
    inputs = {
        "g": "specific force",
        "field": "the magnetic field",
        "deg/s": "angular rate",
    }[compensation.unit]
    yield f"{origin.name}: from outputs to {inputs} along the reference axes, by the model {model.name}."
    yield f"  in {UNIT_TEXT[compensation.unit]}"
    yield f"  model file  {origin.model_file}, SHA-256 {origin.sha256}"
    for key, title in PROVENANCE_TITLES.items():
        if key in model.provenance:
            yield f"  {title}  {as_written(model.provenance[key])}"
    yield f"  written by {origin.program} on {origin.date}"


def _inputs(compensation: Compensation) -> Iterator[str]:
    yield "Inputs:"
    for axis in compensation.forward.axes:
        yield f"  v{axis}  output of the {axis} axis, {unit_of_input(f'v{axis}', compensation)}"
    for name, (low, high) in compensation.input_limits.items():
        yield f"  {name}  {unit_of_input(name, compensation)}, from {low:g} to {high:g}{_axis_text(name, compensation)}"
    yield f"Proved for +-{compensation.range.reach:g} {compensation.unit} on each axis; not beyond these ranges."


def _axis_text(name: str, compensation: Compensation) -> str:
    if name not in ("ax", "ay", "az"):
        return ""
    if (size := compensation.costs.out_of_gravity) is None:
        return "; this axis is not measured: use another sensor for it"
    return (
        "; this axis is not measured. Use another sensor for it; or, if only gravity acts, the function in_gravity, "
        "which computes it from the other axes and the side that is up, with an error of "
        f"{_size_text(size, compensation.unit)}"
    )


def _method_lines(compensation: Compensation) -> Iterator[str]:
    bound, unit = compensation.bound, compensation.unit
    remaining = f"q^{bound.steps} x {compensation.range.reach:g} {unit} = {round_up(bound.within)} {unit}"
    yield (
        f"Method: a <- a + C (v - G(a)), {steps_text(compensation)} from a = 0. Each step reduces the error by the "
        f"factor q <= {round_up(bound.q)}, proved over the whole range by interval arithmetic; the remaining error is "
        f"below {remaining}, without rounding."
    )
    yield f"Operations: {operations_text(compensation)}."
    if tables := compensation.program.tables:
        size = sum(4 * len(table.pieces) for table in tables.values())
        yield (
            f"Tables: {len(tables)}, with {size} numbers, of curves whose form is not known. Each piece is a cubic, "
            "and beyond the data of the calibration the curve is constant. The proof includes them."
        )
        for name, table in tables.items():
            yield f"  {name}  from {table.low:.6g} to {table.low + table.step * len(table.pieces):.6g}"


def _effects(compensation: Compensation) -> Iterator[str]:
    by_how: dict[str, list[str]] = {}
    for fate in compensation.forward.fates:
        by_how.setdefault(fate.how, []).append(fate.effect)
    yield f"Inverted: {', '.join(by_how.get(INVERTED, ['nothing']))}."
    if remembering := compensation.forward.remembering:
        yield (
            f"With a history: {', '.join(remembering)}. Give every sample, in order: "
            f"{len(compensation.forward.memory)} numbers are stored between samples, 0 before the first. The true "
            "history is unknown until the input has turned round at both ends of its range."
        )
    if rigs := by_how.get(OF_THE_RIG):
        yield f"Effects of the rig, not compensated: {', '.join(rigs)}."
    if noise := by_how.get(NOISE):
        yield f"Noise, not compensated: {', '.join(noise)}."
    for fate in compensation.forward.fates:
        if fate.how == LEFT_OUT:
            size = compensation.costs.left_out[fate.effect]
            cost = (
                f"error {_size_text(size, compensation.unit)}"
                if size
                else "a sweep does not excite this effect; its error is not computed"
            )
            yield f"Left out: {fate.effect}, because {fate.why}; {cost}."


def _size_text(size: ErrorSize, unit: str) -> str:
    rms, most = error_text(size.rms, unit), error_text(size.most, unit)
    return f"{rms} rms and {most} at most in a simulated sweep over the stated ranges"


def coverage_text(compensation: Compensation) -> str:
    """The temperatures, supplies and times of the calibration data, and stated ranges beyond them."""
    spans = compensation.model.covered
    if not spans:
        return (
            "The model file does not give the temperature, supply and time of its calibration. Outside of them "
            "the model is extrapolated."
        )
    covered = ", ".join(f"{name} {_span(name, spans[name], compensation)}" for name in spans)
    extrapolated = [
        name for name, (low, high) in compensation.input_limits.items()
        if name not in FORCES and (name not in spans or low < spans[name][0] or high > spans[name][1])
    ]  # fmt: skip
    text = f"Covered by the data of the calibration: {covered}; beyond, the model is extrapolated"
    return f"{text}. The stated range goes beyond in {', '.join(extrapolated)}." if extrapolated else f"{text}."


def uncertainty_text(compensation: Compensation) -> str:
    """The standard uncertainty due to the parameters, over the data's coverage and at its maximum."""
    uncertainty = compensation.costs.parameters
    if uncertainty is None:
        return "Uncertainty: the model file has none."
    conditions = ", ".join(f"{name} {_span(name, span, compensation)}" for name, span in uncertainty.within.items())
    at = ", ".join(f"{name} {value:.6g}" for name, value in uncertainty.at.items())
    rms, most, largest = (
        error_text(value, compensation.unit) for value in (uncertainty.rms, uncertainty.most, uncertainty.largest)
    )
    correlation = (
        "with their correlations"
        if compensation.model.correlations is not None
        else "taken as independent, because the model file does not give their correlations"
    )
    return (
        f"Standard uncertainty of the result from the parameters, {correlation}: {rms} rms, {most} at most over the "
        f"sphere of directions{f' with {conditions}' if conditions else ''}; {largest} at most over the whole stated "
        f"range{f', at {at}' if at else ''}. Noise and errors of the model are not included."
    )


def _span(name: str, span: tuple[float, float], compensation: Compensation) -> str:
    low, high = (f"{end:.6g}" for end in span)
    return f"{low if low == high else f'{low} to {high}'} {unit_of_input(name, compensation)}"


def _uncertainty(compensation: Compensation) -> Iterator[str]:
    yield uncertainty_text(compensation)
    yield coverage_text(compensation)


def _parameters(compensation: Compensation) -> Iterator[str]:
    yield "Parameters, with standard uncertainties:"
    for term in compensation.model.terms:
        for e in term.quantities:
            yield f"  {term.name} {f'{e.name} {e.axis}'.strip()} = {_value(e)} {e.unit}".rstrip()
        for axis, count in term.coefficients.items():
            yield f"  {term.name} {f'curve {axis}'.strip()}: {count} coefficient{'s' if count > 1 else ''}"
    if (correlations := _correlations(compensation)) is not None:
        yield "Correlation coefficients of the parameters, each with those above it in this list:"
        for name, row in zip(correlations.names, correlations.lower, strict=True):
            yield f"  {name}{': ' if row else ''}{' '.join(f'{r:.3f}' for r in row)}"


def _correlations(compensation: Compensation) -> Correlations | None:
    """The correlations of the parameters, if the model has them."""
    correlations = compensation.model.correlations
    return correlations.only(compensation.model.params) if correlations is not None else None


def _value(e: Estimate) -> str:
    if not e.identified:
        return f"{e.value:.8g}, not identified,"
    return f"{e.value:.8g} +- {e.std:.2g}" if e.std else f"{e.value:.8g}"


# Reference vectors for the self-test: inputs and expected results.
#
# The points fill the range evenly (Sobol). The model itself computes the outputs, so a self-test that passes on the
# target checks both the arithmetic and the inverse. With stored values, the vectors are successive samples.

TOLERANCE = {"double": 1e-9, "float": 2e-5}  # of the reach
COUNT = 16


@dataclass(frozen=True)
class ReferenceVectors:
    """`inputs` shape (n, inputs), `expected` (n, sought): true values, from which the model made the inputs."""

    inputs: Array
    expected: Array
    tolerance: float


def make_vectors(compensation: Compensation, count: int = COUNT) -> ReferenceVectors:
    """`count` vectors, a power of two; the first is a corner of the range, the second its middle."""
    ranges = (
        dict.fromkeys(compensation.forward.unknowns, (-compensation.range.reach, compensation.range.reach))
        | compensation.input_limits
    )
    unit = scipy.stats.qmc.Sobol(len(ranges), scramble=False).random(count)
    low, high = np.array(list(ranges.values())).T
    inputs_by_name = dict(zip(ranges, (low + unit * (high - low)).T, strict=True))
    outputs = [np.broadcast_to(v, count) for v in _successive_outputs(compensation, inputs_by_name, count)]
    inputs_by_name |= {f"v{axis}": v for axis, v in zip(compensation.forward.axes, outputs, strict=True)}
    inputs = np.column_stack([inputs_by_name[name] for name in compensation.program.inputs])
    expected = np.column_stack([inputs_by_name[name] for name in compensation.forward.unknowns])
    return ReferenceVectors(inputs, expected, TOLERANCE[compensation.precision] * compensation.range.reach)


def _successive_outputs(compensation: Compensation, inputs: Mapping[str, Array], count: int) -> list[Array]:
    """The model's outputs for successive samples, shape (count,) each."""
    forward = compensation.forward
    if not forward.memory:
        return evaluate_nodes(forward.outputs, inputs)
    remembered: dict[str, Array] = dict.fromkeys(forward.memory, np.zeros(()))
    rows = []
    for i in range(count):
        values = evaluate_nodes(
            (*forward.outputs, *forward.memory.values()), {k: v[i] for k, v in inputs.items()} | remembered
        )
        rows.append(values[: len(forward.outputs)])
        remembered = dict(zip(forward.memory, values[len(forward.outputs) :], strict=True))
    return list(np.array(rows, float).T)


def files(compensation: Compensation, origin: Origin, checks: ReferenceVectors) -> dict[str, str]:
    """The file by its name."""
    program = compensation.program
    fields = {
        **summary(compensation, origin),
        "about": header_lines(compensation, origin),
        "before": [_line(line) for line in program.before],
        "loop": [_line(line) for line in program.loop],
        "next": list(program.next),
        "after": [_line(line) for line in program.after],
        "remembered": dict(program.remembered),
        "tables": {
            name: {"low": table.low, "step": table.step, "pieces": [list(piece) for piece in table.pieces]}
            for name, table in program.tables.items()
        },
        "self_test": {
            "tolerance": checks.tolerance,
            "inputs": checks.inputs.tolist(),
            "expected": checks.expected.tolist(),
        },
    }
    return {f"{origin.name}.json": json.dumps(fields, indent=1, allow_nan=False, ensure_ascii=False) + "\n"}


def summary(compensation: Compensation, origin: Origin) -> dict[str, Any]:
    """The document without the program."""
    program, bound, input_spans = compensation.program, compensation.bound, compensation.input_limits
    correlations = _correlations(compensation)
    return {
        "schema": "rig.compensation/1",
        "name": origin.name,
        "model": compensation.model.name,
        "model_sha256": origin.sha256,
        "program": origin.program,
        "date": origin.date,
        "provenance": dict(compensation.model.provenance),
        "precision": compensation.precision,
        "unit": compensation.unit,
        "inputs": [
            {
                "name": name,
                "unit": unit_of_input(name, compensation),
                "range": list(input_spans[name]) if name in input_spans else None,
            }
            for name in program.inputs
        ],
        "outputs": list(program.unknowns),
        "steps": program.steps,
        "bound": {"reach": compensation.range.reach, "q": bound.q, "within": bound.within},
        "operations": dict(program.operations),
        "effects": [
            {
                "effect": f.effect,
                "how": f.how,
                "why": f.why or None,
                "cost": _size(compensation.costs.left_out.get(f.effect)),
            }
            for f in compensation.forward.fates
        ],
        "out_of_gravity": _size(compensation.costs.out_of_gravity),
        "uncertainty": None if compensation.costs.parameters is None else asdict(compensation.costs.parameters),
        "covered": {name: list(span) for name, span in compensation.model.covered.items()},
        "parameters": parameters_document(compensation.model),
        "correlations": None
        if correlations is None
        else {"of": list(correlations.names), "matrix": correlations.matrix.tolist()},
    }


def _size(size: ErrorSize | None) -> dict[str, float] | None:
    return None if size is None else {"rms": size.rms, "most": size.most}


def _line(line: ProgramLine) -> list[Any]:
    return [line.name, line.operation, list(line.inner)]
