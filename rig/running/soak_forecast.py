"""A soak as it is kept: what bias and scale factor will come to, told after every reversal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from calibrations.evaluations.forecast import FARTHEST_S, STRETCH_S, Forecast, SoakForecast, followed
from calibrations.evaluations.soak import HOLD, HOUR_S, REVERSAL
from calibrations.numerals import plain
from procedures.session import Dwell
from procedures.tumbles import tumble
from rig.record import Kept, Record
from rig.record.measured import Measured, of_sensor, sensors_of
from rig.results.soak import table_of

WHOLE = len(list(tumble(REVERSAL)))  # poses of a reversal


@dataclass
class Follower:
    """Follows one sensor of a run; `on_s` is when it was switched on, on the run's clock, once that is known."""

    sensor: str | None
    constants: Mapping[str, str | float]
    told: SoakForecast
    part: list[Dwell] = field(default_factory=list)  # the reversal or the stretch that is being kept
    length_s: float = 0.0  # of its samples

    @classmethod
    def of(cls, measured: Measured) -> Follower:
        """With all that the record holds of the run already."""
        told = SoakForecast({}, measured.run.settings["oven_c"])
        if measured.run.rows:
            *_, told = [told, *followed(measured.table(), told.oven_c)]
        return cls(measured.sensor, measured.constants, told)

    def kept(self, kept: Kept, on_s: float) -> bool:
        """One more pose; whether it completes a reversal."""
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
        """The part is over: it is told to the filters."""
        rows = table_of(self.part, "", {**self.constants, "sample_rate_hz": rate_hz}, on_s)
        self.told, self.part, self.length_s = self.told.after(rows), [], 0.0


@dataclass
class SoakWatch:
    """Looks on while a soak is kept. Nothing is told before `begun`."""

    run: str = ""
    followers: list[Follower] = field(default_factory=list)
    on_s: float | None = None

    def begun(self, run: str) -> None:
        """The run begins, or goes on: what the record holds of it is followed first."""
        with Record() as record:
            found = record.run(run)
            named = [Measured(record, found, name) for name in sensors_of(found)]
            self.followers = [Follower.of(each) for each in named or [Measured(record, found)]]
        self.run, self.on_s = run, None

    def kept(self, kept: Kept) -> dict[str, Forecast]:
        """What is known of each quantity by name, where a reversal is complete by this pose."""
        if self.on_s is None:
            with Record() as record:
                self.on_s = Measured(record, record.run(self.run)).power_on_s()
        turned = [follower.kept(kept, self.on_s) for follower in self.followers]
        if not any(turned):
            return {}
        return {
            f"{follower.sensor} {name}" if follower.sensor else name: each
            for follower in self.followers
            for name, each in follower.told.forecasts().items()
        }

    def told(self, kept: Kept) -> str:
        """The same in words, a line each; nothing where no reversal is complete by this pose."""
        return lines(forecasts) if (forecasts := self.kept(kept)) else ""


def soak_watch(procedure: str) -> SoakWatch | None:
    """Who follows a run of `procedure`: nobody but a soak's."""
    return SoakWatch() if procedure == "soak" else None


def present(name: str, forecast: Forecast) -> str:
    """The present value in words: 2.49928 V."""
    return f"{forecast.present.value:.5f} {'V/g' if 'scale' in name else 'V'}"


def outlook(name: str, forecast: Forecast) -> str:
    """What it comes to, and when, in words; bounds are those of 95 %, however wide."""
    if forecast.surprised:
        return "what came is no approach to a steady state: nothing is foreseen"
    return f"{_final(name, forecast)}; {_when(forecast)}"


def _final(name: str, forecast: Forecast) -> str:
    """What it comes to."""
    unit, final = ("V/g" if "scale" in name else "V"), forecast.final
    if forecast.known:
        return f"comes to {final.value:.5f} +- {plain(1e6 * final.half, 2)} u{unit} (95 %)"
    return f"not yet known what it comes to: {final.low:.4f} to {final.high:.4f} {unit} (95 %)"


def _when(forecast: Forecast) -> str:
    """When it is steady, from now."""
    if forecast.steady:
        return "steady"
    low_s, value_s, high_s = (max(each - forecast.t_s, 0.0) for each in forecast.steady_s)
    if high_s > FARTHEST_S:
        return f"steady in {_span(low_s)} at the earliest" if low_s else "not yet known when it is steady"
    bounds = f"{_span(low_s)} to {_span(high_s)}" if low_s else f"at most {_span(high_s)}"
    return f"steady in {_span(value_s)} ({bounds})" if forecast.known and value_s else f"steady in {bounds}"


def _span(seconds: float) -> str:
    return f"{plain(seconds / HOUR_S, 2)} h" if seconds >= HOUR_S else f"{seconds / 60:.0f} min"


def lines(forecasts: Mapping[str, Forecast]) -> str:
    """All quantities, a line each, at one time since power-on."""
    hours = max(each.t_s for each in forecasts.values()) / HOUR_S
    words = [f"  {name:<9} {present(name, each)} now; {outlook(name, each)}" for name, each in forecasts.items()]
    return "\n".join([f"{plain(hours)} h after power-on", *words])
