"""Live estimates during a run: of the sensor from the poses so far, or in a soak the forecast of its final values.

The running estimates are recursive least squares, updated with each pose:

    poses          v = bias + s . f              specific force along the sensor's edges: its own is the scale factor
    rates          v = bias + s . w + g . f      rate w and specific force f
    positions      mx^2 + my^2 = 2 c . m + k     a turn with z vertical, and so on: c is the hard iron, k of the turn

The uncertainties follow from the scatter about this formula, so they include all effects that it omits. The results at
the end of the run come from the whole model. The forecast of a soak is updated after every reversal.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from calibrations.analyses.forecast import LATEST_STEADY_S, STRETCH_S, Forecast, SoakForecast, filter_soak
from calibrations.analyses.soak import HOLD, HOUR_S, REVERSAL
from calibrations.estimators.least_squares import Recursive
from calibrations.table import Array
from calibrations.text import count_words, estimate_text, rounded
from procedures.instruments import OUTPUTS
from procedures.questions import EDGES
from procedures.session import Dwell, Pose
from procedures.tumbles import tumble
from rig.planning.plan import turn_words
from rig.record import KeptPose, Record
from rig.record.measured import FIELD, RATE, MeasuredRun, of_sensor, sensor_from_table, specific_force_g
from rig.record.tables import units_of
from rig.results.soak import table_of

NEAR = 0.1  # of the span: distance from a limit below which a value is marked


@dataclass(frozen=True)
class Value:
    """A live value as text, with the `reading` for the comparison with its limits."""

    name: str
    shown: str
    remark: str = ""
    reading: float = 0.0
    limits: tuple[float, float] | None = None

    @property
    def near(self) -> str:
        """A remark if it is near or beyond a limit, else an empty text."""
        return nearness(self.reading, *self.limits) if self.limits else ""


def nearness(value: float, low: float, high: float) -> str:
    """ "" | near its limit | beyond its limit"""
    margin = min(value - low, high - value)
    if not margin >= 0:  # NaN is beyond as well
        return "beyond its limit"
    return "near its limit" if margin < NEAR * (high - low) else ""


# Estimates from the poses so far.

AXES = "xyz"
FORCES = tuple(chain(*OUTPUTS))
Row = tuple[str, Array, float]  # name of the least squares, and one measurement


@dataclass(frozen=True)
class Law:
    """The formula of a kind of table: the rows of a dwell, and the parameters with their place and unit.

    In a unit, `{out}` is that of the outputs.
    """

    channels: Sequence[str]
    rows: Callable[[Dwell], Iterator[Row]]
    parameters: Callable[[str], Mapping[str, tuple[int, str]]]


@dataclass
class RunningEstimates:
    """Estimates of the sensor from the poses of a run so far. There are none before `begun`."""

    law: Law | None = None
    estimators: dict[str, Recursive] = field(default_factory=dict)
    pose: Pose | None = None  # the last one
    units: Mapping[str, str] = field(default_factory=dict)  # of the channels that are not in V

    def begun(self, run: str) -> None:
        """The run begins or continues: take the poses in the record."""
        with Record() as record:
            run_row = record.run(run)
            self.law, self.estimators = LAWS.get(run_row.kind), {}
            self.units = units_of(run_row, self.law.channels) if self.law and run_row.bench else {}
            for _, dwell in record.dwells(run) if self.law else ():
                self._take(dwell)

    def values(self, recorded: KeptPose) -> list[Value]:
        """The estimates after one more pose."""
        self._take(recorded.dwell)
        self.pose = recorded.pose
        return list(self._estimates())

    def report(self, recorded: KeptPose) -> str:
        """The estimates in lines, if this pose begins a new path; they do not include this pose."""
        previous = self.pose
        turn_text = (
            turn_words(previous) if previous is not None and previous.path not in ("", recorded.pose.path) else ""
        )
        estimates = list(self._estimates()) if turn_text else []
        self.values(recorded)
        lines = [f"  {value.name:<12} {value.shown}" for value in estimates]
        return "\n".join([f"after {turn_text}", *lines]) if lines else ""

    def _take(self, dwell: Dwell) -> None:
        for name, row, value in self.law.rows(dwell) if self.law else ():
            self.estimators[name] = self.estimators.get(name, Recursive.of(len(row))).after(row, value)

    def _estimates(self) -> Iterator[Value]:
        for name, squares in self.estimators.items():
            estimate, (sensor, _, channel) = squares.estimate(), name.rpartition(".")
            output_unit = self.units.get(channel, "V")
            for parameter, (place, unit) in self.law.parameters(name).items() if self.law else ():
                value, std = float(estimate.values[place]), float(estimate.scattered[place])
                if np.isfinite(std):
                    value_text = f"{estimate_text(value, std)} {unit.replace('{out}', output_unit)}"
                    poses = count_words(squares.count, "pose", "poses")
                    yield Value(f"{sensor} {parameter}".strip(), value_text, f"from {poses}")


def _rows_by_load(outputs: Collection[str], load: Callable[[Pose], Array]) -> Callable[[Dwell], Iterator[Row]]:
    """Rows of outputs that are linear in loads."""

    def rows(dwell: Dwell) -> Iterator[Row]:
        row = np.append(1.0, load(dwell.pose))
        yield from ((name, row, v) for name, v in dwell.means.items() if name.rpartition(".")[2] in outputs)

    return rows


def _rate_and_force(pose: Pose) -> Array:
    """Rate in deg/s and specific force in g along the sensor's axes, shape (6,): negative while beta rises."""
    rate_deg_s = np.round(-pose.rate_deg_s * sensor_from_table(pose)[:, 2], 12)
    return np.concatenate([rate_deg_s, specific_force_g(pose)])


def _level_rows(dwell: Dwell) -> Iterator[Row]:
    """The two horizontal axes of a magnetometer, for hard iron and the square of the circle of this turn.

    Positions by hand have no such turns, and no rows.
    """
    if FIELD[0] not in dwell.means or not dwell.pose.direction:
        return
    pose, m = dwell.pose, np.array([dwell.means[name] for name in FIELD])
    level = np.array([axis != pose.up for axis in AXES], dtype=float)
    turns = np.zeros(2 * len(EDGES))
    turns[2 * EDGES.index(pose.up) + (pose.alpha_deg > 0)] = 1.0
    yield FIELD[0], np.concatenate([2 * level * m, turns]), float(np.sum(level * m**2))


def _line(prefix: str, unit: str) -> Callable[[str], Mapping[str, tuple[int, str]]]:
    def parameters(output: str) -> Mapping[str, tuple[int, str]]:
        axis = output[-1]
        return {f"{prefix}bias-{axis}": (0, "{out}"), f"{prefix}scale-{axis}": (1 + AXES.index(axis), unit)}

    return parameters


LAWS = {
    "poses": Law(FORCES, _rows_by_load(FORCES, specific_force_g), _line("", "{out}/g")),
    "rates": Law(RATE, _rows_by_load(RATE, _rate_and_force), _line("gyro-", "{out}/(deg/s)")),
    "positions": Law(FIELD, _level_rows, lambda _: {f"hard-iron-{axis}": (k, "{out}") for k, axis in enumerate(AXES)}),
}


# Forecast of the final values in a soak.

WHOLE = len(list(tumble(REVERSAL)))  # poses of a reversal


@dataclass
class Follower:
    """The forecast of one sensor of a run."""

    sensor: str | None
    constants: Mapping[str, str | float]
    forecast: SoakForecast
    part: list[Dwell] = field(default_factory=list)  # dwells of the present reversal or stretch
    length_s: float = 0.0  # of its samples

    @classmethod
    def of(cls, measured: MeasuredRun) -> Follower:
        """With the poses in the record."""
        forecast = SoakForecast({}, measured.run.settings["oven_c"])
        if measured.run.rows:
            *_, forecast = [forecast, *filter_soak(measured.table(), forecast.oven_c)]
        return cls(measured.sensor, measured.constants, forecast)

    def kept(self, recorded: KeptPose, on_s: float) -> bool:
        """Take one more pose; `on_s` is the time of power-on. Returns whether the pose completes a reversal."""
        dwell = of_sensor(recorded, self.sensor).dwell
        if self.part and self.part[0].pose.path != dwell.pose.path:
            self._end(recorded.samples.rate_hz, on_s)
        self.part.append(dwell)
        self.length_s += dwell.n / recorded.samples.rate_hz
        turned = dwell.pose.path.startswith(REVERSAL) and len(self.part) == WHOLE
        if turned or (dwell.pose.path.startswith(HOLD) and self.length_s >= STRETCH_S):
            self._end(recorded.samples.rate_hz, on_s)
        return turned

    def _end(self, rate_hz: float, on_s: float) -> None:
        """The part is complete: update the filters."""
        rows = table_of(self.part, "", {**self.constants, "sample_rate_hz": rate_hz}, on_s)
        self.forecast, self.part, self.length_s = self.forecast.after(rows), [], 0.0


@dataclass
class SoakForecaster:
    """The forecasts of all sensors of a soak. There are none before `begun`."""

    run: str = ""
    followers: list[Follower] = field(default_factory=list)
    on_s: float | None = None
    unit: str = "V"  # of the outputs

    def begun(self, run: str) -> None:
        """The run begins or continues: take the poses in the record."""
        with Record() as record:
            run_row = record.run(run)
            sensors = [MeasuredRun(record, run_row, name) for name in run_row.batch] or [MeasuredRun(record, run_row)]
            self.followers = [Follower.of(sensor) for sensor in sensors]
        self.run, self.on_s = run, None
        self.unit = str(run_row.constants.get("unit", "V"))

    def values(self, recorded: KeptPose) -> list[Value]:
        """The forecast of each quantity, if this pose completes a reversal."""
        forecasts = self.forecasts(recorded)
        return [Value(name, present(name, f, self.unit), outlook(name, f, self.unit)) for name, f in forecasts.items()]

    def forecasts(self, recorded: KeptPose) -> dict[str, Forecast]:
        """The forecast of each quantity by name, if this pose completes a reversal."""
        if self.on_s is None:
            with Record() as record:
                self.on_s = MeasuredRun(record, record.run(self.run)).power_on_s()
        turned = [follower.kept(recorded, self.on_s) for follower in self.followers]
        if not any(turned):
            return {}
        return {
            f"{follower.sensor} {name}" if follower.sensor else name: forecast
            for follower in self.followers
            for name, forecast in follower.forecast.forecasts().items()
        }

    def report(self, recorded: KeptPose) -> str:
        """The forecasts in lines; empty if this pose does not complete a reversal."""
        return lines(forecasts, self.unit) if (forecasts := self.forecasts(recorded)) else ""


def live_estimates(procedure: str) -> SoakForecaster | RunningEstimates:
    """The estimates to show during a run of `procedure`. They have the methods `begun`, `values` and `report`."""
    return SoakForecaster() if procedure == "soak" else RunningEstimates()


def present(name: str, forecast: Forecast, output_unit: str) -> str:
    """The present value with its unit: 2.49928 V. `output_unit` is the unit of the outputs."""
    return f"{forecast.present.value:.5f} {_unit(name, output_unit)}"


def outlook(name: str, forecast: Forecast, output_unit: str) -> str:
    """The final value and the time of the steady state, with bounds of 95 %."""
    if forecast.contradicted:
        return "the drift does not look like a warm-up, so there is no forecast"
    return f"{_final(forecast, _unit(name, output_unit))}; {_time_to_steady(forecast)}"


def _unit(name: str, output_unit: str) -> str:
    """The unit of a bias or a scale factor."""
    return f"{output_unit}/g" if "scale" in name else output_unit


def _final(forecast: Forecast, unit: str) -> str:
    """The final value."""
    final = forecast.final
    if forecast.known:
        factor, small = (1e6, f"u{unit}") if unit.startswith(("V", "g")) else (1.0, unit)
        return f"final value {final.value:.5f} +- {rounded(factor * final.half, 2)} {small} (95 %)"
    return f"final value not yet known: {final.low:.4f} to {final.high:.4f} {unit} (95 %)"


def _time_to_steady(forecast: Forecast) -> str:
    """The time until the steady state."""
    if forecast.steady:
        return "steady"
    low_s, value_s, high_s = (max(time_s - forecast.t_s, 0.0) for time_s in forecast.steady_s)
    if high_s > LATEST_STEADY_S:
        return f"steady in {_span(low_s)} at the earliest" if low_s else "time of steady state not yet known"
    bounds = f"{_span(low_s)} to {_span(high_s)}" if low_s else f"at most {_span(high_s)}"
    return f"steady in {_span(value_s)} ({bounds})" if forecast.known and value_s else f"steady in {bounds}"


def _span(seconds: float) -> str:
    return f"{rounded(seconds / HOUR_S, 2)} h" if seconds >= HOUR_S else f"{seconds / 60:.0f} min"


def lines(forecasts: Mapping[str, Forecast], output_unit: str) -> str:
    """The forecasts of all quantities in lines, with the time since power-on."""
    hours = max(forecast.t_s for forecast in forecasts.values()) / HOUR_S
    texts = {
        name: f"{present(name, f, output_unit)} now; {outlook(name, f, output_unit)}" for name, f in forecasts.items()
    }
    words = [f"  {name:<9} {text}" for name, text in texts.items()]
    return "\n".join([f"{rounded(hours)} h after power-on", *words])
