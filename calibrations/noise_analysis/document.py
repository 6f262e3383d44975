"""The JSON document of a noise analysis."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from calibrations.noise_analysis.analysis import Coefficient, NoiseAnalysis
from calibrations.noise_analysis.octaves import KINDS, Curve

OVERLAPPING = "overlapping"


def noise_document(found: NoiseAnalysis) -> dict[str, Any]:
    """`rig.noise/1`: deviations and spectrum with intervals of 95 %, and every coefficient.

    `allan` is the overlapping Allan deviation, `deviations` holds the others; `spectrum` is two-sided, less the lines.
    """
    spectrum, per = found.spectrum, found.spectrum.frequency_hz.argsort()
    low, high = spectrum.interval
    bands = {
        "frequency_hz": spectrum.frequency_hz, "density": spectrum.density, "low": low, "high": high,
        "model": found.found.expected(spectrum),
    }  # fmt: skip
    return {
        "schema": "rig.noise/1",
        "rate_hz": found.rate_hz,
        "n": found.n,
        "unit": found.unit,
        "allan": _curve(found.allan),
        "deviations": {kind: _curve(found.curves[kind]) for kind in KINDS if kind != OVERLAPPING},
        "spectrum": {name: values[per].tolist() for name, values in bands.items()} | {"unit": f"({found.unit})^2/Hz"},
        "lines": [{"frequency_hz": line.frequency_hz, "amplitude": line.amplitude} for line in found.lines],
        "coefficients": coefficients_document(found),
    }


def coefficients_document(found: NoiseAnalysis) -> dict[str, Any]:
    """Every process by its name."""
    return {name: _coefficient(each) for name, each in found.coefficients.items()}


def _curve(curve: Curve) -> dict[str, list[float]]:
    each = {"tau_s": curve.tau_s, "deviation": curve.deviation, "low": curve.low, "high": curve.high}
    return {name: values.tolist() for name, values in each.items()}


def _coefficient(each: Coefficient) -> dict[str, Any]:
    """Value, its uncertainty, unit and whether it was identified; beside them what only some have."""
    given = {name: value for name, value in asdict(each).items() if value is not None}
    unknown = {name: None for name in ("std", "upper") if np.isinf(given.get(name, 0.0))}
    return {**given, **unknown, "identified": each.identified}
