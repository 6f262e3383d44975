"""The compensation as a JSON document `rig.compensation/1`, for writers of other languages.

`before`, `loop` and `after` are lines [name, operation, [operands]]; operands are names and numbers. Run `before` once,
start every output at 0, and run `loop` `steps` times, each time setting the outputs to `next`. Names in `remembered`
are
0 before the first sample; run `after` once, then set each to its operand.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import qmc

from calibrations.compensation.about import Origin, header_lines, unit_of_input
from calibrations.compensation.cost import ErrorSize
from calibrations.compensation.graph import evaluate_nodes
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.program import Line
from calibrations.documents import parameters_document
from calibrations.table import Array

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


def make_vectors(made: Compensation, count: int = COUNT) -> ReferenceVectors:
    """`count` vectors, a power of two; the first is a corner of the range, the second its middle."""
    ranges = dict.fromkeys(made.forward.sought, (-made.range.reach, made.range.reach)) | made.beside
    unit = qmc.Sobol(len(ranges), scramble=False).random(count)
    low, high = np.array(list(ranges.values())).T
    at = dict(zip(ranges, (low + unit * (high - low)).T, strict=True))
    outputs = [np.broadcast_to(v, count) for v in _in_a_row(made, at, count)]
    at |= {f"v{axis}": v for axis, v in zip(made.forward.axes, outputs, strict=True)}
    inputs = np.column_stack([at[name] for name in made.program.inputs])
    expected = np.column_stack([at[name] for name in made.forward.sought])
    return ReferenceVectors(inputs, expected, TOLERANCE[made.precision] * made.range.reach)


def _in_a_row(made: Compensation, at: Mapping[str, Array], count: int) -> list[Array]:
    """The model's outputs for successive samples, shape (count,) each."""
    forward = made.forward
    if not forward.memory:
        return evaluate_nodes(forward.outputs, at)
    remembered: dict[str, Array] = dict.fromkeys(forward.memory, np.zeros(()))
    rows = []
    for i in range(count):
        found = evaluate_nodes(
            (*forward.outputs, *forward.memory.values()), {k: v[i] for k, v in at.items()} | remembered
        )
        rows.append(found[: len(forward.outputs)])
        remembered = dict(zip(forward.memory, found[len(forward.outputs) :], strict=True))
    return list(np.array(rows, float).T)


def files(made: Compensation, origin: Origin, checks: ReferenceVectors) -> dict[str, str]:
    """The file by its name."""
    program = made.program
    whole = {
        **summary(made, origin),
        "about": header_lines(made, origin),
        "before": [_line(line) for line in program.before],
        "loop": [_line(line) for line in program.loop],
        "next": list(program.next),
        "after": [_line(line) for line in program.after],
        "remembered": dict(program.remembered),
        "self_test": {
            "tolerance": checks.tolerance,
            "inputs": checks.inputs.tolist(),
            "expected": checks.expected.tolist(),
        },
    }
    return {f"{origin.name}.json": json.dumps(whole, indent=1, allow_nan=False, ensure_ascii=False) + "\n"}


def summary(made: Compensation, origin: Origin) -> dict[str, Any]:
    """The document without the program."""
    program, bound, beside = made.program, made.bound, made.beside
    return {
        "schema": "rig.compensation/1",
        "name": origin.name,
        "model": made.model.name,
        "model_sha256": origin.sha256,
        "program": origin.program,
        "date": origin.date,
        "provenance": dict(made.model.provenance),
        "precision": made.precision,
        "unit": made.unit,
        "inputs": [
            {"name": name, "unit": unit_of_input(name, made), "range": list(beside[name]) if name in beside else None}
            for name in program.inputs
        ],
        "outputs": list(program.sought),
        "steps": program.steps,
        "bound": {"reach": made.range.reach, "q": bound.q, "within": bound.within},
        "operations": dict(program.operations),
        "effects": [
            {"effect": f.effect, "how": f.how, "why": f.why or None, "cost": _size(made.costs.left_out.get(f.effect))}
            for f in made.forward.fates
        ],
        "out_of_gravity": _size(made.costs.out_of_gravity),
        "uncertainty": None if made.costs.parameters is None else asdict(made.costs.parameters),
        "covered": {name: list(span) for name, span in made.model.covered.items()},
        "parameters": parameters_document(made.model),
    }


def _size(size: ErrorSize | None) -> dict[str, float] | None:
    return None if size is None else {"rms": size.rms, "most": size.most}


def _line(line: Line) -> list[Any]:
    return [line.name, line.operation, list(line.inner)]
