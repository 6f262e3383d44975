"""Forecast during a soak: the final values of bias and scale factor, updated after every reversal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from calibrations.analyses.forecast import LATEST_STEADY_S, STRETCH_S, Forecast, SoakForecast, filter_soak
from calibrations.analyses.soak import HOLD, HOUR_S, REVERSAL
from calibrations.text import rounded
from procedures.session import Dwell
from procedures.tumbles import tumble
from rig.record import Kept, Record
from rig.record.measured import Measured, of_sensor, sensors_of
from rig.results.soak import table_of

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
    def of(cls, measured: Measured) -> Follower:
        """With the poses in the record."""
        forecast = SoakForecast({}, measured.run.settings["oven_c"])
        if measured.run.rows:
            *_, forecast = [forecast, *filter_soak(measured.table(), forecast.oven_c)]
        return cls(measured.sensor, measured.constants, forecast)

    def kept(self, kept: Kept, on_s: float) -> bool:
        """Take one more pose; `on_s` is the time of power-on. Returns whether the pose completes a reversal."""
        dwell = of_sensor(kept, self.sensor).dwell
        if self.part and self.part[0].pose.path != dwell.pose.path:
            self._end(kept.samples.rate_hz, on_s)
        self.part.append(dwell)
        self.length_s += dwell.n / kept.samples.rate_hz
        turned = dwell.pose.path.startswith(REVERSAL) and len(self.part) == WHOLE
        if turned or (dwell.pose.path.startswith(HOLD) and self.length_s >= STRETCH_S):
            self._end(kept.samples.rate_hz, on_s)
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
            found = record.run(run)
            named = [Measured(record, found, name) for name in sensors_of(found)]
            self.followers = [Follower.of(each) for each in named or [Measured(record, found)]]
        self.run, self.on_s = run, None
        self.unit = str(found.constants.get("unit", "V"))

    def kept(self, kept: Kept) -> dict[str, Forecast]:
        """The forecast of each quantity by name, if this pose completes a reversal."""
        if self.on_s is None:
            with Record() as record:
                self.on_s = Measured(record, record.run(self.run)).power_on_s()
        turned = [follower.kept(kept, self.on_s) for follower in self.followers]
        if not any(turned):
            return {}
        return {
            f"{follower.sensor} {name}" if follower.sensor else name: forecast
            for follower in self.followers
            for name, forecast in follower.forecast.forecasts().items()
        }

    def told(self, kept: Kept) -> str:
        """The forecasts in lines; empty if this pose does not complete a reversal."""
        return lines(forecasts, self.unit) if (forecasts := self.kept(kept)) else ""


def soak_forecaster(procedure: str) -> SoakForecaster | None:
    """The forecasts for a run of `procedure`; None if it is not a soak."""
    return SoakForecaster() if procedure == "soak" else None


def present(name: str, forecast: Forecast, of: str) -> str:
    """The present value with its unit: 2.49928 V. `of` is the unit of the outputs."""
    return f"{forecast.present.value:.5f} {_unit(name, of)}"


def outlook(name: str, forecast: Forecast, of: str) -> str:
    """The final value and the time of the steady state, with bounds of 95 %."""
    if forecast.surprised:
        return "the drift does not look like a warm-up, so there is no forecast"
    return f"{_final(forecast, _unit(name, of))}; {_when(forecast)}"


def _unit(name: str, of: str) -> str:
    """The unit of a bias or a scale factor."""
    return f"{of}/g" if "scale" in name else of


def _final(forecast: Forecast, unit: str) -> str:
    """The final value."""
    final = forecast.final
    if forecast.known:
        factor, small = (1e6, f"u{unit}") if unit.startswith(("V", "g")) else (1.0, unit)
        return f"final value {final.value:.5f} +- {rounded(factor * final.half, 2)} {small} (95 %)"
    return f"final value not yet known: {final.low:.4f} to {final.high:.4f} {unit} (95 %)"


def _when(forecast: Forecast) -> str:
    """The time until the steady state."""
    if forecast.steady:
        return "steady"
    low_s, value_s, high_s = (max(each - forecast.t_s, 0.0) for each in forecast.steady_s)
    if high_s > LATEST_STEADY_S:
        return f"steady in {_span(low_s)} at the earliest" if low_s else "time of steady state not yet known"
    bounds = f"{_span(low_s)} to {_span(high_s)}" if low_s else f"at most {_span(high_s)}"
    return f"steady in {_span(value_s)} ({bounds})" if forecast.known and value_s else f"steady in {bounds}"


def _span(seconds: float) -> str:
    return f"{rounded(seconds / HOUR_S, 2)} h" if seconds >= HOUR_S else f"{seconds / 60:.0f} min"


def lines(forecasts: Mapping[str, Forecast], of: str) -> str:
    """The forecasts of all quantities in lines, with the time since power-on; `of` is the unit of the outputs."""
    hours = max(each.t_s for each in forecasts.values()) / HOUR_S
    shown = {name: f"{present(name, each, of)} now; {outlook(name, each, of)}" for name, each in forecasts.items()}
    words = [f"  {name:<9} {text}" for name, text in shown.items()]
    return "\n".join([f"{rounded(hours)} h after power-on", *words])
