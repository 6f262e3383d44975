"""The part of a report on a run of the procedure motion: both models of the sweep against the displacement sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from markupsafe import Markup

from calibrations.analyses.motion import MotionResult, Quantity
from calibrations.motion.reference import Bias
from calibrations.presentation.chart import Picture
from calibrations.presentation.document import Page, Remark, Section, Table
from calibrations.text import estimate_text, keep_units_together, rounded, unit

NAMES = {
    "rmse-linear-x": "rms error of the linear model",
    "rmse-physical-x": "rms error of the physical model",
    "improvement-x": "reduction of the rms error by the physical model",
    "noise-limit-x": "error by the sensor's noise alone, in this band",
    "amplitude": "peak acceleration, from the displacement sensor",
    "frequency": "frequency, from the displacement sensor",
}
LEAST = 1e-8
SWEEP_NOTE = (
    "Both models were fitted to the sweep of this run. The uncertainties hold the noise within this record only. The "
    "uncertainties of the displacement sensor's calibration curve and of the converter's clock scale the reference and "
    "are not included."
)
MOTION_NOTE = "From here on, models are fitted to the motion itself and not to the sweep."


def motion_page(page: Page, motion: MotionResult, evaluation: Picture) -> Page:
    """The page on models of a motion, headed by the comparison with the displacement sensor."""
    linear, physical, limit = (
        f"{rounded(q.value)} mm/s²" for q in (motion.rmse_linear, motion.rmse_physical, motion.noise_limit)
    )
    verdict = Markup('<span class="state {}">{}</span> <b>{}</b>').format(page.state, page.verdict, page.headline)
    model = page.subject.rpartition("model ")[2]
    fitted = Section(f"The model {model}, fitted to the motion", (Remark(MOTION_NOTE), verdict, page.summary))
    return replace(
        page,
        headline=f"In motion, the physical model has an rms error of {physical}, the linear model of {linear}.",
        verdict="measured",
        state="found",
        subject=f"Calibration report, motion at {motion.frequency.value:.4g} Hz",
        summary=keep_units_together(_motion_summary(motion)),
        figures=[
            ("linear model of the sweep", linear, "rms error against the displacement sensor"),
            ("physical model of the sweep", physical, f"{rounded(motion.excess)} × the noise limit"),
            ("noise limit", limit, "error by the sensor's noise alone, in this band"),
        ],
        sections=[_motion_section(motion, evaluation), fitted, *page.sections],
    )


def _motion_section(motion: MotionResult, evaluation: Picture) -> Section:
    quantities = [(NAMES[name], *_quantity_text(quantity)) for name, quantity in motion.results.items()]
    head = ("quantity", "value (standard uncertainty)", "unit")
    filters = ("filter", "at", "amplitude", "phase", "within 1 %", "discarded at each end")
    return Section(
        "Comparison with the displacement sensor",
        (
            evaluation,
            Table("The motion in numbers", head, quantities, (1,), headed=False),
            Remark(SWEEP_NOTE),
            Table("Errors of the filters", filters, [_bias(bias) for bias in motion.biases], range(1, 6)),
        ),
    )


def _motion_summary(motion: MotionResult) -> str:
    linear, physical, limit = (rounded(q.value) for q in (motion.rmse_linear, motion.rmse_physical, motion.noise_limit))
    return (
        f"The motion has a frequency of {motion.frequency.value:.4g} Hz and a peak of "
        f"{rounded(motion.amplitude.value, 4)} mm/s². The rms error of the linear model is {linear} mm/s², that of the "
        f"physical model {physical} mm/s², {100 * motion.improvement.value:.1f} % less. The sensor's noise alone gives "
        f"{limit} mm/s² in this band: the physical model has {rounded(motion.excess)} × that limit. Both models were "
        "fitted to the sweep of this run, without the motion. Models that are fitted to the motion itself have a "
        "smaller error, given below, because that fit includes the changes since the sweep."
    )


def _quantity_text(q: Quantity) -> tuple[str, str]:
    if q.unit == "1":
        return estimate_text(100 * q.value, 100 * q.std), "%"
    return estimate_text(q.value, q.std), unit(q.unit)


def _bias(bias: Bias) -> tuple[str, ...]:
    low, high = bias.band_hz
    return (
        bias.name,
        f"{bias.at_hz:.4g} Hz",
        f"{_small(100 * bias.amplitude)} %",
        f"{_small(float(np.degrees(bias.phase_rad)))}°",
        f"{low:.4g} to {high:.4g} Hz",
        f"{bias.edge_s:.2g} s",
    )


def _small(value: float) -> str:
    """Two digits; 0 for values within the rounding of the computation."""
    return rounded(value, 2) if abs(value) > LEAST else "0"
