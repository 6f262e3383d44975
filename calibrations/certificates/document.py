"""The certificate as JSON, `rig.certificate/1`: every figure, its budget, and the weight of every row in it."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from calibrations.certificates.content import Certificate, Outcome


def document(c: Certificate) -> dict[str, Any]:
    """Plain mappings; what has no limit is null."""
    whole = asdict(c)
    figures = whole.pop("figures")
    outcomes = [_outcome(o) for o in c.figures.outcomes]
    made: dict[str, Any] = _finite({"schema": "rig.certificate/1", **whole, **figures, "outcomes": outcomes})
    return made


def _outcome(o: Outcome) -> dict[str, Any]:
    return {**asdict(o), "expanded": o.expanded, "weights": {str(number): share for number, share in o.weights}}


def _finite(value: Any) -> Any:
    """JSON has no infinity: no limit is null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    return [_finite(each) for each in value] if isinstance(value, (list, tuple)) else value
