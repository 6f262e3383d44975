"""A report's sections on parameters: the uncertainty budget, and the general calibration M, S and b."""

from __future__ import annotations

from typing import Any

import numpy as np

from calibrations.fitting.budget import Budget, Line, make_budget
from calibrations.fitting.fit import Fit
from calibrations.fitting.inputs import input_contributions
from calibrations.fitting.matrices import calibration_matrices
from calibrations.model import Estimate
from calibrations.text import INFINITE_FREEDOM, contribution_text, estimate_text, freedom_text, rounded, unit


def budget(found: Fit) -> dict[str, Any] | None:
    """Numbers and words of the section; None for tables that no budget is drawn up for, and where nothing is known."""
    if not found.table.type.budget or not len(found.theta):
        return None
    drawn = make_budget(found, input_contributions(found.table))
    if not drawn.given:
        return None
    known = [(k, name, e) for k, name, e in _estimates(found) if e.identified and e.std is not None]
    groups = dict.fromkeys(name for _, name, _ in known)
    return {
        "parameters": [_parameter(drawn, *each) for each in known],
        "groups": [(name, [_sources(drawn, k, e) for k, n, e in known if n == name]) for name in groups],
        "not_given": ", ".join(drawn.not_given),
    }


def _estimates(found: Fit) -> list[tuple[int, str, Estimate]]:
    """Position, effect and estimate of each quantity; coefficients of free forms have no budget of their own."""
    every = [(term, e) for term in found.model.terms for e in term.estimates]
    return [(k, term.name, e) for k, (term, e) in enumerate(every) if e in term.quantities]


def _label(e: Estimate) -> str:
    return f"{e.name} {e.axis}".strip()


def _parameter(drawn: Budget, k: int, effect: str, e: Estimate) -> dict[str, str]:
    largest = max(drawn.given, key=lambda line: _of(line.std, k))
    return {
        "effect": effect,
        "name": _label(e),
        "combined": rounded(drawn.combined[k], 2),
        "freedom": freedom_text(drawn.freedom[k]),
        "coverage": f"{drawn.coverage[k]:.2f}",
        "expanded": rounded(drawn.expanded[k], 2),
        "unit": unit(e.unit),
        "largest": largest.source,
    }


def _sources(drawn: Budget, k: int, e: Estimate) -> dict[str, Any]:
    rows = [_source(line, k, float(drawn.combined[k])) for line in drawn.given]
    return {"name": f"{_label(e)}, {unit(e.unit)}", "rows": rows}


def _source(line: Line, k: int, combined: float) -> dict[str, str]:
    part = _of(line.std, k)
    return {
        "source": line.source,
        "kind": line.kind,
        "input": "–" if line.input_std is None else f"{rounded(line.input_std, 2)} {unit(line.unit)}".strip(),
        "sensitivity": "–" if line.sensitivity is None else rounded(line.sensitivity[k], 2),
        "std": contribution_text(part, combined),
        "freedom": freedom_text(line.freedom),
    }


def _of(std: Any, k: int) -> float:
    return 0.0 if std is None or np.isnan(std[k]) else float(std[k])


def budget_document(found: Fit) -> dict[str, Any] | None:
    """The budget as JSON: for each parameter what it adds up to, and the contributions by source. None as `section`."""
    if not found.table.type.budget or not len(found.theta):
        return None
    drawn = make_budget(found, input_contributions(found.table))
    known = [(k, name, e) for k, name, e in _estimates(found) if e.identified and e.std is not None]
    return {
        "parameters": [
            {
                "effect": name,
                "axis": e.axis or None,
                "name": e.name,
                "combined": float(drawn.combined[k]),
                "freedom": float(drawn.freedom[k]) if drawn.freedom[k] < INFINITE_FREEDOM else None,
                "coverage_factor": float(drawn.coverage[k]),
                "expanded": float(drawn.expanded[k]),
                "contributions": {line.source: _of(line.std, k) for line in drawn.given},
            }
            for k, name, e in known
        ],
        "not_given": list(drawn.not_given),
    }


AXES = "xyz"


def matrices(found: Fit) -> dict[str, Any] | None:
    """Numbers and words of the section; None for a sensor with fewer than three axes, and for a motion."""
    made = calibration_matrices(found)
    if made is None:
        return None
    rows = [
        {
            "axis": axis,
            "M": [estimate_text(float(value), float(std)) for value, std in zip(made.M[k], made.M_std[k], strict=True)],
            "S": estimate_text(float(made.S[k]), float(made.S_std[k])),
            "b": estimate_text(float(made.b[k]), float(made.b_std[k])),
        }
        for k, axis in enumerate(AXES)
    ]
    units = {"raw": unit(found.table.unit), "calibrated": unit(made.unit)}
    return {"rows": rows, **units, "beyond": ", ".join(made.beyond)}
