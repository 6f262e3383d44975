"""The compensation as a JSON document, for whoever writes it in a language of their own: `rig.compensation/1`.

`before` and `loop` are lines [name, operation, [what it is applied to]], names and numbers; run `before` once, begin
with every output at 0, and `steps` times run `loop` and take `next` for the outputs. Where something is `remembered`,
each name is 0 before the first sample; run `after` once with the outputs found, and it is what its word says.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

from calibrations.compensation.about import Origin, lines, unit_of_input
from calibrations.compensation.cost import Size
from calibrations.compensation.inverse import Compensation
from calibrations.compensation.program import Line
from calibrations.compensation.vectors import Vectors
from calibrations.documents import parameters_document


def files(made: Compensation, origin: Origin, checks: Vectors) -> dict[str, str]:
    """The file by its name."""
    program = made.program
    whole = {
        **summary(made, origin),
        "about": lines(made, origin),
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
    """What it is, without the program itself."""
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


def _size(size: Size | None) -> dict[str, float] | None:
    return None if size is None else {"rms": size.rms, "most": size.most}


def _line(line: Line) -> list[Any]:
    return [line.name, line.operation, list(line.inner)]
