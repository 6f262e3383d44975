"""soak: when bias and scale factor come to rest, how far they drift until then, and how fast."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from calibrations.analyses.forecast import ForecastHistory, forecast_history, steady_time
from calibrations.analyses.soak import AXES, HOUR_S, Course, Soak, SteadyState
from calibrations.analyses.soak import analyse_soak as soak_of
from calibrations.criteria import COVERAGE_FACTOR, FEWEST_APPROACH_VALUES
from calibrations.table import Table
from procedures.session import Dwell
from procedures.soak import REVERSAL
from rig.record.measured import Measured
from rig.results.result import Result

SEEN = 3  # reversals after the steady state before a soak is ended by it
NAMES = (
    *("steady-state", "steady-state-time", "steady-state-{axis}", "steady-state-time-{axis}"),
    *("steady-state-earliest", "steady-state-expected", "steady-state-latest"),
    *("steady-state-earliest-{axis}", "steady-state-expected-{axis}", "steady-state-latest-{axis}"),
    *("bias-drift-{axis}", "scale-drift-{axis}", "bias-tolerance-{axis}", "scale-tolerance-{axis}"),
    *("time-constant-{axis}", "scale-time-constant-{axis}", "temperature-wander", "gap"),
    *("bias-final-{axis}", "scale-final-{axis}", "bias-foreseen-{axis}", "scale-foreseen-{axis}"),
)


def evaluate(measured: Measured) -> dict[str, Result]:
    """Of each axis, and of all:

    steady-state           1 where it is reached within the soak, 0 where it is not
    steady-state-time      h since power-on, where it is reached: the later one of bias and scale factor
    steady-state-earliest  h since power-on, where it is not reached: it is later than that, by 97.5 %, as foreseen
    steady-state-latest    the same: it is sooner than that, by 97.5 %; where that is within two days
    steady-state-expected  the median, where there is a latest
    bias-drift             V, the fitted bias at the last reversal less that at the first
    scale-drift            the same of the scale factor, over its final value
    time-constant          h, of the slowest exponential of the bias, where there is one
    scale-time-constant    the same of the scale factor
    bias-tolerance         V, within which a bias is called steady; so for the scale factor, over its final value
    temperature-wander     K, peak to peak, of the temperature about the sensor's own warming
    gap                    s, of which nothing was kept
    bias-final             V, what the bias comes to, as followed by the filter: where that is known
    scale-final            V/g, the same of the scale factor
    bias-foreseen          h since power-on, from which on the filter knew it; so for the scale factor

    A soak with too few reversals to tell drift from noise has its gaps only.
    """
    found, ahead = night(measured), foreseen_of(measured)
    results: dict[str, Result] = {}
    for axis in ("", *found.axes) if all(course.state for course in found.courses.values()) else ():
        results |= _steady(found, ahead, axis)
    for course in found.courses.values():
        if course.state is not None:
            results |= _drift(course, course.state)
    if (wander_k := found.temperature_wander_k) is not None:
        results["temperature-wander"] = Result(wander_k, "K")
    results |= _foreseen(ahead)
    return results | {"gap": Result(sum(gap.length_s for gap in found.gaps), "s")}


def night(measured: Measured) -> Soak:
    """The run as a soak; its times are counted from power-on, or from its beginning where that is not known."""
    return soak_of(measured.table(), measured.run.settings["oven_c"])


def foreseen_of(measured: Measured) -> dict[str, ForecastHistory]:
    """What was known of each quantity in the course of the run."""
    return forecast_history(measured.table(), measured.run.settings["oven_c"])


def steady(dwells: Sequence[Dwell], oven_c: float) -> bool:
    """Whether every axis of every sensor has come to rest, seen for a while: what ends a soak early.

    `oven_c` is the temperature of the oven that it is in (0: none).
    """
    reversals = [dwell for dwell in dwells if dwell.pose.path.startswith(REVERSAL)]
    if len(list(groupby(reversals, lambda dwell: dwell.pose.path))) < FEWEST_APPROACH_VALUES:
        return False
    sensors = dict.fromkeys(name.rpartition(".")[0] for name in dwells[0].means if name[-2:] in ("vx", "vy"))
    return all(_at_rest(soak_of(table_of(reversals, sensor), oven_c)) for sensor in sensors)


def _at_rest(found: Soak) -> bool:
    for course in found.courses.values():
        state, last_s = course.state, course.t_s[-1]
        time = course.time_s
        if (
            state is None
            or time is None
            or time[0] + COVERAGE_FACTOR * time[1] > last_s
            or np.sum(course.t_s > time[0]) < SEEN
        ):
            return False
    return True


def table_of(
    dwells: Sequence[Dwell], sensor: str = "", constants: Mapping[str, str | float] | None = None, on_s: float = 0.0
) -> Table:
    """The dwells of one sensor, "" where there is only one, as a table with what is known of it; on since `on_s`."""
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
    for axis in AXES:
        if (channel := f"{prefix}v{axis}") in dwells[0].means:
            columns[f"v{axis}_v"] = [dwell.means[channel] for dwell in dwells]
            columns[f"v{axis}_std_v"] = [dwell.stds[channel] for dwell in dwells]
    labels = {"path": tuple(dwell.pose.path for dwell in dwells)}
    return Table.from_columns("poses", columns, constants or {}, "the run", labels)


def _steady(found: Soak, ahead: Mapping[str, ForecastHistory], axis: str) -> dict[str, Result]:
    """When it was reached; else when it will be."""
    time, end = found.time_s(axis), f"-{axis}" if axis else ""
    results = {f"steady-state{end}": Result(float(time is not None), "")}
    if time is not None:
        return results | {f"steady-state-time{end}": Result(time[0] / HOUR_S, "h", time[1] / HOUR_S)}
    bounds = steady_time(ahead, axis)
    shown = {} if bounds is None else {"earliest": bounds.low}
    if bounds is not None and np.isfinite(bounds.high):
        shown |= {"expected": bounds.value, "latest": bounds.high}
    return results | {f"steady-state-{name}{end}": Result(s / HOUR_S, "h") for name, s in shown.items()}


def _foreseen(found: Mapping[str, ForecastHistory]) -> dict[str, Result]:
    """What was known at the end, and since when."""
    results: dict[str, Result] = {}
    for name, course in found.items():
        quantity, _, axis = name.partition("-")
        if course.known_s is not None:
            final = course.last.final
            unit = "V" if quantity == "bias" else "V/g"
            results[f"{quantity}-final-{axis}"] = Result(final.value, unit, final.half / COVERAGE_FACTOR)
            results[f"{quantity}-foreseen-{axis}"] = Result(course.known_s / HOUR_S, "h")
    return results


def _drift(course: Course, state: SteadyState) -> dict[str, Result]:
    unit, whole = ("V", 1.0) if course.quantity == "bias" else ("", abs(state.final[0]))
    value, std = state.drift
    results = {"drift": Result(value / whole, unit, std / whole), "tolerance": Result(state.tolerance / whole, unit)}
    found = {f"{course.quantity}-{name}-{course.axis}": result for name, result in results.items()}
    if state.terms:
        tau_s, tau_std = state.terms[0].tau_s
        name = "time-constant" if course.quantity == "bias" else "scale-time-constant"
        found[f"{name}-{course.axis}"] = Result(tau_s / HOUR_S, "h", tau_std / HOUR_S)
    return found
