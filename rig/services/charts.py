"""Charts of the record: a run over time, the history of a sensor, and a comparison of two runs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime, timedelta
from types import MappingProxyType

import numpy as np

from calibrations.noise.comparison import DeviationComparison
from calibrations.presentation.chart import (
    CANDIDATE,
    MEASURED,
    Axis,
    Band,
    Chart,
    Dash,
    Line,
    Panel,
    Points,
    Rule,
    Symbol,
    floor_band,
    single_chart,
)
from calibrations.presentation.charts.history import Life
from calibrations.presentation.charts.noise import TIME, Scaling, measured_points
from calibrations.presentation.residual import ChannelResidual, Column
from calibrations.table import in_time
from calibrations.text import add_prefix, axis_label, estimate_in_prefix, estimate_text, minus, unit
from procedures.session import Dwell
from rig.record import Record, Run
from rig.record.measured import MeasuredRun
from rig.services.history import Calibration, Quantity
from rig.services.two_runs import DIFFERENT, Pair, RepeatedPoses

MOST = 1024  # parts: more than a screen has columns for


@dataclass
class Part:
    """Successive dwells: their number `n`, the sums of their values, and extremes by name."""

    n: int = 0
    t_s: float = 0.0
    sums: dict[str, float] = field(default_factory=dict)
    low: dict[str, float] = field(default_factory=dict)
    high: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, dwell: Dwell) -> Part:
        """The part of one dwell."""
        values = dict(dwell.means) | {f"rms {name}": std for name, std in dwell.stds.items()}
        if dwell.temperature_c is not None:
            values["temperature"] = dwell.temperature_c
        return cls(1, dwell.t_s, values, dict(values), dict(values))

    def join(self, other: Part) -> None:
        """Add the dwells of another part."""
        self.n, self.t_s = self.n + other.n, self.t_s + other.t_s
        for name, value in other.sums.items():
            self.sums[name] = self.sums.get(name, 0.0) + value
            self.low[name] = min(self.low.get(name, other.low[name]), other.low[name])
            self.high[name] = max(self.high.get(name, other.high[name]), other.high[name])


@dataclass
class Course:
    """The dwells of one kind of pose; `names` are channels, their noise as `rms vx`, and the temperature."""

    parts: list[Part] = field(default_factory=list)
    dwells_per_part: int = 1  # dwells in a part that is full

    def add(self, dwell: Dwell) -> None:
        """Add a dwell."""
        if not self.parts or self.parts[-1].n >= self.dwells_per_part:
            if len(self.parts) == MOST:
                self._join()
            self.parts.append(Part())
        self.parts[-1].join(Part.of(dwell))

    def _join(self) -> None:
        for first, second in zip(self.parts[::2], self.parts[1::2], strict=True):
            first.join(second)
        self.parts, self.dwells_per_part = self.parts[::2], 2 * self.dwells_per_part

    @property
    def names(self) -> list[str]:
        """The measured values."""
        return list(self.parts[0].sums) if self.parts else []

    def line(self, name: str) -> tuple[list[float], list[float], list[float], list[float]]:
        """(time in s, mean, least, greatest) of each part that has it."""
        parts = [part for part in self.parts if name in part.sums]
        times = [part.t_s / part.n for part in parts]
        means = [part.sums[name] / part.n for part in parts]
        return times, means, [part.low[name] for part in parts], [part.high[name] for part in parts]


def kind_of(dwell: Dwell) -> str:
    """Dwells of numbered paths belong together by name: `hold` of `hold 17`; those of a sweep are of one kind, ""."""
    head, _, number = dwell.pose.path.rpartition(" ")
    return head if number.isdigit() else ""


def kind_label(kind: str) -> str:
    """`up 35 °C` for the paths of a temperature cycle, `up 35 cycle 1`; other kinds by their own name."""
    return re.sub(r"^(up|down) (-?[\d.]+) cycle$", r"\1 \2 °C", kind) or "poses"


# Charts of the record: a run over time, the history of a sensor, and a comparison of two runs.


DAY_S = 86400.0
VOLTS: Mapping[str, str] = MappingProxyType({})  # no channel has another unit than V
FEW = 400  # parts: more would not be distinguishable
ROW, AXIS = 0.27, 0.6  # inches of a difference, and of the axis of a group


@dataclass(frozen=True)
class RunTime:
    """The time axis of a run: `zero_s` on the run's clock, its name, and the time of day at `first_s` of that clock.

    The clock of a run counts from power-on where that is known, maybe long before the run.
    """

    zero_s: float = 0.0
    since: str = " since the first pose"
    begun: datetime | None = None
    first_s: float = 0.0

    @classmethod
    def of(cls, record: Record, run: Run) -> RunTime:
        """Power-on of a run that switches the sensor, else the first pose."""
        start_time = datetime.fromisoformat(run.created)
        on_s = MeasuredRun(record, run, next(iter(run.batch), None)).power_on_s() if run.rows else 0.0
        first = next(record.kept(run.run), None)
        first_s = first.t_s if first is not None else 0.0
        if on_s or run.procedure == "soak":
            return cls(on_s, " since power-on", start_time, first_s)
        return cls(first_s, begun=start_time, first_s=first_s)

    def clock(self, t_s: float) -> str:
        """The time of day, UTC, for the pointer."""
        if self.begun is None:
            return ""
        return f"{self.begun + timedelta(seconds=t_s - self.first_s):%Y-%m-%d %H:%M:%S} UTC"


def course_chart(course: Course, name: str, time: RunTime = RunTime(), units: Mapping[str, str] = VOLTS) -> Chart:
    """One quantity over the time of the run: means of several dwells, with the range of the dwells.

    `units` has those of the channels that are not in V.
    """
    run_s, mean, low, high = course.line(name)
    t_s = [at_s - time.zero_s for at_s in run_s]
    size, unit_s = in_time(t_s[-1] - t_s[0] if t_s else 0.0)
    times, colour = np.array(t_s) / size, CANDIDATE if name == "temperature" else MEASURED
    quantity_unit = "°C" if name == "temperature" else units.get(name.removeprefix("rms "), "V")
    reach = max(high, default=0.0) if name.startswith("rms ") else 1.0  # a mean stays in its unit, also near zero
    factor, spelt = add_prefix(quantity_unit, reach)
    values, lowest, highest = (factor * np.array(ends) for ends in (mean, low, high))
    band = (Band(times, lowest, highest, colour=colour, opacity=0.2),) if course.dwells_per_part > 1 else ()
    hover = f"%{{y:.6g}} at %{{x:.4g}} {unit_s}<br>%{{text}}"
    clock = [time.clock(at_s) for at_s in run_s]
    line = Line(times, values, colour=colour, hover=hover, markers=len(times) < FEW, texts=clock)
    return single_chart(Panel((*band, line), Axis(f"time{time.since} ({unit_s})"), Axis(f"{name} ({spelt})")))


# The history of a sensor


def life_of(q: Quantity) -> Life:
    """One quantity over all calibrations of a sensor, as charts show it."""
    values = [calibration.values[q.name] for calibration in q.calibrations]
    signals = q.chart.signals if q.chart is not None else []
    due = None if q.due is None else (q.due - date(1970, 1, 1)).days
    return Life(
        q.name,
        q.unit,
        [calibration.at.timestamp() / DAY_S for calibration in q.calibrations],
        [value.value for value in values],
        [value.std for value in values],
        q.line,
        q.allowed,
        due,
        f"due {q.due}",
        signals,
        [_quantity_text(q, calibration, k in signals) for k, calibration in enumerate(q.calibrations)],
        [calibration.data for calibration in q.calibrations],
    )


def _quantity_text(q: Quantity, calibration: Calibration, signals: bool) -> str:
    """The text of a calibration under the pointer."""
    value = calibration.values[q.name]
    lines = [
        f"{calibration.day}: {estimate_text(value.value, value.std)} {unit(q.unit)}",
        f"{calibration.data}, rig {calibration.rig}",
    ]
    lines += ["beyond the limits of a control chart"] if signals else []
    lines += [calibration.expired] if calibration.expired else []
    return "<br>".join([*lines, "click: its model"])


# Two runs


def differences(pairs: Sequence[Pair]) -> Chart:
    """The second minus the first, with +- two standard uncertainties; a panel for each unit.

    Diamonds differ by more than that.
    """
    groups: dict[str, list[Pair]] = {}
    for pair in pairs:
        groups.setdefault(pair.unit, []).append(pair)
    panels = tuple((_differences(group),) for group in groups.values())
    return Chart(panels, [ROW * len(group) + AXIS for group in groups.values()])


def _differences(pairs: Sequence[Pair]) -> Panel:
    reach = max(abs(p.difference) + DIFFERENT * (p.std or 0.0) for p in pairs)
    factor, spelt = add_prefix(unit(pairs[0].unit), reach)
    names = tuple(pair.name for pair in pairs)
    dots = Points(
        np.array([factor * pair.difference for pair in pairs]),
        np.arange(len(pairs), dtype=float),
        colour=[CANDIDATE if pair.differ else MEASURED for pair in pairs],
        symbol=["diamond" if pair.differ else "circle" for pair in pairs],
        size=8,
        reach=np.array([DIFFERENT * factor * (pair.std or 0.0) for pair in pairs]),
        hover=[f"{pair.name}: {estimate_in_prefix(pair.difference, pair.std, pair.unit)}" for pair in pairs],
    )
    y = Axis(low=-0.5, high=len(pairs) - 0.5, names=names, reverse=True)
    return Panel((Rule(0.0, "x", width=1.2), dots), Axis(axis_label("difference", spelt)), y)


def residuals(first: ChannelResidual, second: ChannelResidual, x: Column, other_x: Column) -> Chart:
    """Residuals of both, each fitted by itself, on shared axes; the grey band is the larger noise floor."""
    styles: tuple[tuple[ChannelResidual, Column, str, Symbol, str], ...] = (
        (first, x, MEASURED, "circle", "first"),
        (second, other_x, CANDIDATE, "diamond-open", "second"),
    )
    dots = [
        Points(column.values[channel.c, channel.rows], channel.residual, colour=colour, symbol=symbol, size=8,
               hover=[f"{name}: {text}" for text in channel.hover])
        for channel, column, colour, symbol, name in styles
    ]  # fmt: skip
    axis = Axis(x.labels[first.c], ticks="quarters" if x.name == "beta" else "")
    return single_chart(Panel((*floor_band(max(first.floor, second.floor)), *dots), axis, Axis(first.label)))


def difference(first: ChannelResidual, repeated: RepeatedPoses) -> Chart:
    """The second measurement minus the first, at every pose that both have; the band is its noise floor."""
    c, values = first.c, first.factor * repeated.difference[first.c]
    hover = [f"{minus(f'{value:.4g}')} {first.unit}<br>{first.place(int(row))}"
             for value, row in zip(values, repeated.first, strict=True)]  # fmt: skip
    dots = Points(first.fit.table.column("beta_deg")[repeated.first], values, hover=hover)
    y = Axis(f"second − first, {first.fit.channels[c]} ({first.unit})")
    series = (*floor_band(first.factor * float(repeated.floor[c])), dots)
    return single_chart(Panel(series, Axis("β (deg)", ticks="quarters"), y))


def deviations(curves: Sequence[DeviationComparison], scaled: Sequence[Scaling]) -> Chart:
    """The Allan deviations of two still records, bars intervals of 95 %; lines are the model fitted to each."""
    series: list[Line | Points] = []
    styles: tuple[tuple[str, str, Symbol, Dash], ...] = (
        ("first", MEASURED, "circle", "solid"),
        ("second", CANDIDATE, "diamond-open", "dash"),
    )
    for curve, scale, (name, colour, symbol, dash) in zip(curves, scaled, styles, strict=True):
        model = Line(curve.tau_s, scale.factor * curve.modelled, colour=colour, width=1.2, dash=dash)
        values, low, high = (scale.factor * curve_values for curve_values in (curve.measured, curve.low, curve.high))
        dots = measured_points(curve.tau_s, values, low, high, scale.unit, name)
        series += [model, replace(dots, colour=colour, symbol=symbol, size=8)]
    y = Axis(f"Allan deviation ({scaled[0].unit})", log=True)
    return single_chart(Panel(tuple(series), Axis(TIME, log=True), y, legend="upper right"))
