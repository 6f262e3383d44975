"""A motion's place in the report: both models beside the displacement sensor come first, and each filter's own bias.

They are the models of the run's own sweep. The rest of the report is on a model that is fitted to the motion itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from calibrations.motion.evaluate import MotionResult, Quantity
from calibrations.motion.reference import Bias
from calibrations.numerals import measured, plain, unit
from calibrations.reports.words import unbroken

NAMES = {
    "rmse-linear-x": "rms error of the linear model",
    "rmse-physical-x": "rms error of the physical model",
    "improvement-x": "by how much the physical model's is less",
    "noise-limit-x": "what the sensor's noise alone leaves in this band",
    "amplitude": "peak acceleration, by the displacement sensor",
    "frequency": "frequency, by the displacement sensor",
}
LEAST = 1e-8


def head(found: MotionResult) -> dict[str, Any]:
    """The head of the page."""
    linear, physical, limit = (
        f"{plain(q.value)} mm/s²" for q in (found.rmse_linear, found.rmse_physical, found.noise_limit)
    )
    return {
        "headline": f"In motion, the physical model errs by {physical}, the linear model by {linear}.",
        "verdict": "measured",
        "state": "found",
        "what": f"Calibration report, motion at {found.frequency.value:.4g} Hz",
        "summary": unbroken(_summary(found)),
        "figures": [
            ("linear model of the sweep", linear, "rms error beside the displacement sensor"),
            ("physical model of the sweep", physical, f"{plain(found.excess)} × the noise limit"),
            ("noise limit", limit, "what the sensor's noise alone leaves in this band"),
        ],
    }


def section(found: MotionResult) -> dict[str, Any]:
    """What the page says of the motion, in rows."""
    return {
        "quantities": [(NAMES[name], *_written(quantity)) for name, quantity in found.results.items()],
        "biases": [_bias(bias) for bias in found.biases],
    }


def _summary(found: MotionResult) -> str:
    before, after, limit = (plain(q.value) for q in (found.rmse_linear, found.rmse_physical, found.noise_limit))
    return (
        f"Shaken at {found.frequency.value:.4g} Hz with {plain(found.amplitude.value, 4)} mm/s² peak, the linear model "
        f"errs by {before} mm/s² (rms), the physical model by {after} mm/s², "
        f"{100 * found.improvement.value:.1f} % less. The sensor's noise alone leaves {limit} mm/s² in this band: the "
        f"physical model is at {plain(found.excess)} × that limit. Both models were fitted to the sweep of this run "
        "and have not seen the motion."
    )


def _written(q: Quantity) -> tuple[str, str]:
    if q.unit == "1":
        return measured(100 * q.value, 100 * q.std), "%"
    return measured(q.value, q.std), unit(q.unit)


def _bias(bias: Bias) -> dict[str, str]:
    low, high = bias.band_hz
    return {
        "name": bias.name,
        "at": f"{bias.at_hz:.4g} Hz",
        "amplitude": f"{_small(100 * bias.amplitude)} %",
        "phase": f"{_small(float(np.degrees(bias.phase_rad)))}°",
        "band": f"{low:.4g} to {high:.4g} Hz",
        "edge": f"{bias.edge_s:.2g} s",
    }


def _small(value: float) -> str:
    """To two digits; what is below the rounding of a computation is nothing."""
    return plain(value, 2) if abs(value) > LEAST else "0"
