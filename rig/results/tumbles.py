"""Results that tumbles determine: check-standard, repeat and temperature-cycle; and the drift of a sweep."""

from __future__ import annotations

import math

import numpy as np

from calibrations.analyses.stability import fit_trend, repeatability
from calibrations.analyses.tumble import bias_coefficients, estimate_tumbles, scale_coefficients
from calibrations.criteria import FEWEST_FOR_DRIFT
from procedures.instruments import output_channel
from procedures.sweep import REFERENCE
from rig.record.measured import MeasuredRun
from rig.record.tables import units_of
from rig.results.result import Missing, Result, evaluates

AXES = "xy"
HOUR_S = 3600.0


@evaluates("check-standard")
def check_standard(measured: MeasuredRun) -> dict[str, Result]:
    """bias-x in the unit of the outputs and scale-x per g, the same of y; uncertainties by white noise alone.

    Raises DataError.
    """
    table, results = measured.table(), {}
    for axis in (axis for axis in table.axes if axis in AXES):
        (tumble,) = estimate_tumbles(table, axis)
        results[f"bias-{axis}"] = Result(tumble.bias_v, table.unit, tumble.bias_std_v)
        std = tumble.scale_std * abs(tumble.scale_v_per_g)
        results[f"scale-{axis}"] = Result(tumble.scale_v_per_g, f"{table.unit}/g", std)
    return results


@evaluates("repeat")
def repeat(measured: MeasuredRun) -> dict[str, Result | Missing]:
    """bias-as-is-x in the unit of the outputs, scale-power-y as a fraction, and so on.

    Raises DataError for fewer than two repetitions.
    """
    table, results = measured.table(), dict[str, Result | Missing]()
    for axis in (axis for axis in table.axes if axis in AXES):
        tumbles = estimate_tumbles(table, axis)
        for kind in dict.fromkeys(tumble.path.partition(" ")[0] for tumble in tumbles):
            of_kind = [tumble for tumble in tumbles if tumble.path.partition(" ")[0] == kind]
            bias = repeatability([t.bias_v for t in of_kind], [t.bias_std_v for t in of_kind])
            mean = sum(t.scale_v_per_g for t in of_kind) / len(of_kind)
            scale = repeatability([t.scale_v_per_g / mean for t in of_kind], [t.scale_std for t in of_kind])
            results[f"bias-{kind}-{axis}"] = _spread(bias, table.unit)
            results[f"scale-{kind}-{axis}"] = _spread(scale, "")
    return results


def _spread(estimate: tuple[float, float | None], unit: str) -> Result | Missing:
    """A spread with its standard uncertainty; Missing without one, because a spread of 0 would pass any limit."""
    spread, std = estimate
    if std is None:
        return Missing("all repetitions are equal and their noise is unknown; record more digits or more samples")
    return Result(spread, unit, std)


@evaluates("temperature-cycle")
def temperature_cycle(measured: MeasuredRun) -> dict[str, Result]:
    """Slopes of the bias per K, in the unit of the outputs, and of the scale factor in 1/K; hysteresis (up minus down)
    in the unit of the outputs and as a fraction. Raises DataError for too few steps."""
    table, results = measured.table(), {}
    for axis in (axis for axis in table.axes if axis in AXES):
        steps = estimate_tumbles(table, axis)
        for name, unit, coefficients in (
            ("bias", table.unit, bias_coefficients(steps)),
            ("scale", "", scale_coefficients(steps)),
        ):
            slope, slope_std = coefficients.slope
            results[f"{name}-temperature-{axis}"] = Result(slope, f"{unit or '1'}/K", _known(slope_std))
            hysteresis, std = coefficients.hysteresis
            results[f"{name}-temperature-hysteresis-{axis}"] = Result(hysteresis, unit, _known(std))
    return results


def _known(std: float) -> float | None:
    """The standard uncertainty of a result; None if it is not known."""
    return None if math.isnan(std) else std


@evaluates("sweep")
def sweep(measured: MeasuredRun) -> dict[str, Result]:
    """Trend of the outputs at the reference pose, an hour, with the standard error that its scatter gives."""
    if not measured.run.settings.get("reference_every"):
        return {}
    visits = [recorded.dwell for recorded in measured.kept() if recorded.pose.path == REFERENCE.path]
    if len(visits) < FEWEST_FOR_DRIFT:
        return {}
    hours = np.array([dwell.t_s for dwell in visits]) / HOUR_S
    results = {}
    for axis in "xyz":
        if (channel := output_channel(axis, visits[0].means)) is None:
            continue
        drift, std = fit_trend(hours, np.array([dwell.means[channel] for dwell in visits]))
        unit = units_of(measured.run, [channel]).get(channel, "V")
        results[f"reference-drift-{axis}"] = Result(drift, f"{unit}/h", std)
    return results
