"""The control charts of a record: every complete check-standard run, in the order of time, a chart for each quantity.

A chart belongs to one sensor, by its serial number: another sensor's values are not comparable.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibrations.analyses.control_chart import Chart, control_chart
from calibrations.criteria import BASELINE_RUNS, FEWEST_RUNS
from calibrations.text import add_prefix, concise, concise_in_prefix
from drivers.errors import did_you_mean
from rig.errors import RecordError, UnknownRun
from rig.record import Run

PROCEDURE = "check-standard"
OUT = "out of control"
ZERO_SCATTER = (
    "the scatter of the baseline is zero, and the uncertainty of its values is unknown: any other value is outside the "
    "limits; record more digits or more samples"
)
HEAD = ("sensor", "quantity", "runs", "centre", "sigma", "last", "verdict")


@dataclass(frozen=True)
class ControlledQuantity:
    """One quantity of one check standard: its chart, and the runs that its values are of, in order."""

    sensor: str
    quantity: str
    unit: str
    runs: tuple[str, ...]
    chart: Chart


def make_charts(
    runs: Iterable[Run], sensor: str | None = None, baseline: int = BASELINE_RUNS, since: str | None = None
) -> list[ControlledQuantity]:
    """The charts of `runs` (newest first, as the record gives them), of one `sensor` or of all; from run `since` on.

    Raises RecordError where there is nothing to chart, UnknownRun where `since` is none of the check-standard runs.
    """
    checks = [run for run in reversed(list(runs)) if run.procedure == PROCEDURE and run.state == "complete"]
    points = [point for run in _runs_from(checks, since) for point in _points(run)]
    sensor_names = list(dict.fromkeys(point.sensor for point in points))
    if sensor is not None and sensor not in sensor_names:
        raise RecordError(f"no check-standard run of the sensor {sensor!r}.{did_you_mean(sensor, sensor_names)}")
    points_by_key: dict[tuple[str, str], list[_Point]] = {}
    for point in points:
        if sensor in (None, point.sensor):
            points_by_key.setdefault((point.sensor, point.quantity), []).append(point)
    if not points_by_key:
        raise RecordError("no check-standard run is complete yet; `rig run check-standard` makes one")
    charted = {key: own_points for key, own_points in points_by_key.items() if len(own_points) >= FEWEST_RUNS}
    if not charted:
        names = ", ".join(dict.fromkeys(sensor for sensor, _ in points_by_key))
        raise RecordError(f"{names}: {FEWEST_RUNS} check-standard runs are needed for a chart; there is one")
    return [_control(*key, own_points, baseline) for key, own_points in charted.items()]


# In words, for the command and the page.


def worst(charts: Iterable[ControlledQuantity]) -> str:
    """The worst verdict of all charts."""
    verdicts = {chart.chart.verdict for chart in charts}
    return next(verdict for verdict in (OUT, "in control", "baseline") if verdict in verdicts)


def row(quantity: ControlledQuantity) -> tuple[str, ...]:
    """The cells below `HEAD`."""
    chart = quantity.chart
    last = concise(float(chart.values[-1]), chart.sigma, quantity.unit)
    progress = f"{len(chart.values)} of {chart.judged}" if chart.verdict == "baseline" else str(len(chart.values))
    factor, unit = add_prefix(quantity.unit, chart.sigma)
    centre, sigma = f"{chart.centre:.7g} {quantity.unit}", f"{factor * chart.sigma:.2g} {unit.replace('µ', 'u')}"
    return quantity.sensor, quantity.quantity, progress, centre, sigma, last, chart.verdict


def signals(quantity: ControlledQuantity) -> list[str]:
    """A line for every run outside a limit, and one for limits without a width."""
    chart, name = quantity.chart, f"{quantity.sensor} {quantity.quantity}"
    jumps = [f"{quantity.runs[k]}: {name} is {_distance(quantity, k)} from the centre" for k in chart.jumps]
    first = chart.drifts[:1]
    drifts = [f"{quantity.runs[k]}: {name} has drifted: its weighted mean is outside the limit" for k in first]
    return [*([] if chart.sigma > 0 else [f"{name}: {ZERO_SCATTER}"]), *jumps, *drifts]


def _distance(quantity: ControlledQuantity, k: int) -> str:
    """The distance of a run from the centre, in sigma, or in the unit of the quantity where sigma is 0."""
    chart = quantity.chart
    distance = float(chart.values[k] - chart.centre)
    if chart.sigma > 0:
        return f"{distance / chart.sigma:+.1f} sigma"
    return f"{'+' if distance > 0 else ''}{concise_in_prefix(distance, None, quantity.unit)}"


@dataclass(frozen=True)
class _Point:
    """One result of one run."""

    sensor: str
    quantity: str
    run: str
    result: Mapping[str, Any]


def _runs_from(checks: list[Run], first_run: str | None) -> list[Run]:
    names = [run.run for run in checks]
    if first_run is not None and first_run not in names:
        raise UnknownRun(f"no complete check-standard run {first_run!r}.{did_you_mean(first_run, names[-20:])}")
    return checks if first_run is None else checks[names.index(first_run) :]


def _points(run: Run) -> Iterator[_Point]:
    """The results of a run, each under its sensor's serial number; those of a batch are named `a1/bias-x`."""
    for name, result in run.results.items():
        member, _, quantity = name.rpartition("/")
        sensor = run.bench["sensors"][member] if member else run.bench["sensor"]
        yield _Point(sensor.get("serial") or sensor["name"], quantity, run.run, result)


def _control(sensor: str, quantity: str, points: list[_Point], baseline: int) -> ControlledQuantity:
    stds = [point.result["std"] or 0.0 for point in points]
    least_sigma = float(np.sqrt(np.mean(np.square(stds[:baseline]))))
    chart = control_chart([point.result["value"] for point in points], baseline, least_sigma)
    return ControlledQuantity(sensor, quantity, points[0].result["unit"], tuple(point.run for point in points), chart)
