"""soak: steady-state time, drift and time constants of bias and scale factor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from calibrations.analyses.forecast import ForecastHistory, forecast_history, steady_time
from calibrations.analyses.soak import AXES, HOUR_S, QuantityHistory, Soak, SteadyState
from calibrations.analyses.soak import analyse_soak as soak_of
from calibrations.criteria import COVERAGE_FACTOR, FEWEST_APPROACH_VALUES
from calibrations.table import Table, std_column
from procedures.instruments import OUTPUTS, output_channel
from procedures.session import Dwell
from procedures.soak import REVERSAL
from rig.record.measured import MeasuredRun
from rig.results.result import Result, evaluates

ENDS = {names["xyz".index(axis)] for names in OUTPUTS for axis in AXES}
FEWEST_STEADY = 3  # reversals after the steady state before it ends a soak


@evaluates("soak")
def soak(measured: MeasuredRun) -> dict[str, Result]:
    """Results of each axis and of all axes. Times in h are since power-on.

    steady-state           1 if it is reached within the soak, else 0
    steady-state-time      h, if it is reached: the later time of bias and scale factor
    steady-state-earliest  h, if it is not reached: lower bound (97.5 %) of the forecast
    steady-state-latest    h, upper bound (97.5 %) of the forecast, if it is within two days
    steady-state-expected  h, median of the forecast, if there is an upper bound
    bias-drift             unit of the outputs, fitted bias at the last reversal minus that at the first
    scale-drift            the same of the scale factor, relative to its final value
    time-constant          h, slowest exponential of the bias, if there is one
    scale-time-constant    the same of the scale factor
    bias-tolerance         unit of the outputs, half-width of the band in which a bias is steady
    scale-tolerance        the same of the scale factor, relative to its final value
    temperature-wander     K, peak to peak, after removing the warm-up of the sensor
    gap                    s, total time without samples
    bias-final             unit of the outputs, final value of the bias by the Kalman filter, if it is known
    scale-final            that unit per g, the same of the scale factor
    bias-foreseen          h, time from which the filter knew the final bias
    scale-foreseen         the same of the scale factor

    A soak with too few reversals to separate drift from noise has only the gap.
    """
    soak, forecasts = read_soak(measured), read_forecasts(measured)
    results: dict[str, Result] = {}
    for axis in ("", *soak.axes) if all(course.state for course in soak.courses.values()) else ():
        results |= _steady(soak, forecasts, axis)
    for course in soak.courses.values():
        if course.state is not None:
            results |= _drift(course, course.state, soak.table.unit)
    if (wander_k := soak.temperature_wander_k) is not None:
        results["temperature-wander"] = Result(wander_k, "K")
    results |= _forecast_results(forecasts, soak.table.unit)
    return results | {"gap": Result(sum(gap.length_s for gap in soak.gaps), "s")}


def read_soak(measured: MeasuredRun) -> Soak:
    """The soak of the run. Times are since power-on, or since the beginning if that is not known."""
    return soak_of(measured.table(), measured.run.settings["oven_c"])


def read_forecasts(measured: MeasuredRun) -> dict[str, ForecastHistory]:
    """The forecasts of each quantity in the course of the run."""
    return forecast_history(measured.table(), measured.run.settings["oven_c"])


def steady(dwells: Sequence[Dwell], oven_c: float) -> bool:
    """Whether every axis of every sensor has been steady for several reversals, so that the soak can end early.

    `oven_c` is the temperature of the oven, C (0: no oven).
    """
    reversals = [dwell for dwell in dwells if dwell.pose.path.startswith(REVERSAL)]
    if len(list(groupby(reversals, lambda dwell: dwell.pose.path))) < FEWEST_APPROACH_VALUES:
        return False
    sensors = dict.fromkeys(name.rpartition(".")[0] for name in dwells[0].means if name[-2:] in ENDS)
    return all(_is_steady(soak_of(table_of(reversals, sensor), oven_c)) for sensor in sensors)


def _is_steady(soak: Soak) -> bool:
    """Whether bias and scale factor are certainly steady, with FEWEST_STEADY reversals after that time."""
    for course in soak.courses.values():
        state, last_s = course.state, course.t_s[-1]
        time = course.time_s
        if (
            state is None
            or time is None
            or time[0] + COVERAGE_FACTOR * time[1] > last_s
            or np.sum(course.t_s > time[0]) < FEWEST_STEADY
        ):
            return False
    return True


def table_of(
    dwells: Sequence[Dwell], sensor: str = "", constants: Mapping[str, str | float] | None = None, on_s: float = 0.0
) -> Table:
    """The dwells of one sensor ("" without a batch) as a table of poses; `on_s` is the time of power-on, s."""
    prefix = f"{sensor}." if sensor else ""
    columns: dict[str, list[float]] = {
        "alpha_deg": [dwell.pose.alpha_deg for dwell in dwells],
        "beta_deg": [dwell.pose.beta_deg for dwell in dwells],
        "direction": [dwell.pose.direction for dwell in dwells],
        "t_s": [dwell.t_s - on_s for dwell in dwells],
        "n": [dwell.n for dwell in dwells],
    }
    temperatures_c = [dwell.temperature_c for dwell in dwells if dwell.temperature_c is not None]
    if len(temperatures_c) == len(dwells):
        columns["temperature_c"] = temperatures_c
    names = [name.removeprefix(prefix) for name in dwells[0].means if name.startswith(prefix)]
    for name in (name for axis in AXES if (name := output_channel(axis, names)) is not None):
        column = f"{name}_v" if name.startswith("v") else name
        columns[column] = [dwell.means[f"{prefix}{name}"] for dwell in dwells]
        columns[std_column(column)] = [dwell.stds[f"{prefix}{name}"] for dwell in dwells]
    labels = {"path": tuple(dwell.pose.path for dwell in dwells)}
    return Table.from_columns("poses", columns, constants or {}, "the run", labels)


def _steady(soak: Soak, forecasts: Mapping[str, ForecastHistory], axis: str) -> dict[str, Result]:
    """The time of the steady state, or its forecast."""
    time, end = soak.time_s(axis), f"-{axis}" if axis else ""
    results = {f"steady-state{end}": Result(float(time is not None), "")}
    if time is not None:
        return results | {f"steady-state-time{end}": Result(time[0] / HOUR_S, "h", time[1] / HOUR_S)}
    bounds = steady_time(forecasts, axis)
    times = {} if bounds is None else {"earliest": bounds.low}
    if bounds is not None and np.isfinite(bounds.high):
        times |= {"expected": bounds.value, "latest": bounds.high}
    return results | {f"steady-state-{name}{end}": Result(s / HOUR_S, "h") for name, s in times.items()}


def _forecast_results(forecasts: Mapping[str, ForecastHistory], output_unit: str) -> dict[str, Result]:
    """The final values at the end of the soak, and the times from which they were known."""
    results: dict[str, Result] = {}
    for name, course in forecasts.items():
        quantity, _, axis = name.partition("-")
        if course.known_s is not None:
            final = course.last.final
            unit = output_unit if quantity == "bias" else f"{output_unit}/g"
            results[f"{quantity}-final-{axis}"] = Result(final.value, unit, final.half / COVERAGE_FACTOR)
            results[f"{quantity}-foreseen-{axis}"] = Result(course.known_s / HOUR_S, "h")
    return results


def _drift(course: QuantityHistory, state: SteadyState, output_unit: str) -> dict[str, Result]:
    unit, full_scale = (output_unit, 1.0) if course.quantity == "bias" else ("", abs(state.final[0]))
    value, std = state.drift
    results = {
        "drift": Result(value / full_scale, unit, std / full_scale),
        "tolerance": Result(state.tolerance / full_scale, unit),
    }
    results_by_name = {f"{course.quantity}-{name}-{course.axis}": result for name, result in results.items()}
    if state.terms:
        tau_s, tau_std = state.terms[0].tau_s
        name = "time-constant" if course.quantity == "bias" else "scale-time-constant"
        results_by_name[f"{name}-{course.axis}"] = Result(tau_s / HOUR_S, "h", tau_std / HOUR_S)
    return results_by_name
