"""The JSON document of a noise analysis."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from calibrations.noise_analysis.analysis import Coefficient, NoiseAnalysis


def noise_document(found: NoiseAnalysis) -> dict[str, Any]:
    """`rig.noise/1`: the overlapping Allan deviation with its 95 % interval, and every coefficient."""
    curve = found.allan
    allan = {"tau_s": curve.tau_s, "deviation": curve.deviation, "low": curve.low, "high": curve.high}
    return {
        "schema": "rig.noise/1",
        "rate_hz": found.rate_hz,
        "n": found.n,
        "allan": {name: values.tolist() for name, values in allan.items()},
        "coefficients": {name: _coefficient(each) for name, each in found.coefficients.items()},
    }


def _coefficient(each: Coefficient) -> dict[str, Any]:
    """Value, its uncertainty, unit and whether it was identified; beside them what only some have."""
    given = {name: value for name, value in asdict(each).items() if value is not None}
    return {**given, "identified": each.identified}
