"""Forecast of the final bias and scale factor during a soak, with 95 % bounds.

A bank of Kalman filters for each quantity of each axis takes every reversal, and means over minutes of the still record
in between. The still record shows the bias with a constant offset, due to the load along z.

A final value counts as known if its bounds are narrow relative to the whole change, or to the tolerance of the steady
state. It is unknown if the measured drift agrees with none of the filters.

Source  Barshan and Durrant-Whyte, IEEE Trans. Robotics and Automation 11 (1995) 328; JCGM 101, 7.7: coverage
interval.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from calibrations.analyses.soak import AXES, HOLD, REVERSAL
from calibrations.analyses.tumble import estimate_tumbles
from calibrations.criteria import COVERAGE_FACTOR, LONGEST_MOVE_S, MOST_KNOWN_WIDTH, MOST_SURPRISE, REACHED_K
from calibrations.errors import DataError
from calibrations.estimators.approach import HOUR_S, LEVEL, LN_TAU, REST, SLOW, Bank, make_bank
from calibrations.means.noise import white_std
from calibrations.table import Array, Table

STRETCH_S, STRETCHES = 300.0, 3  # of the still record: a value is the mean of so much, or of a third of a hold
TYPICAL_DRIFT = 4e-3  # expected size of a drift over the scale factor: in g, and as a fraction
DEFAULT_NOISE = 2e-5  # white standard error over the scale factor, where it is not known
DRAWS = 1000
FORECASTS = 24
SMALLEST = 1e-12  # of a unit
LATEST_STEADY_S = 48 * HOUR_S  # from now: a later steady state cannot be foreseen
HORIZON_S = np.concatenate([[0.0], np.geomspace(60.0, 100 * HOUR_S, 60)])


class Bounds(NamedTuple):
    """A median with its 95 % bounds."""

    low: float
    value: float
    high: float

    @property
    def half(self) -> float:
        """Half of their width."""
        return (self.high - self.low) / 2


@dataclass(frozen=True)
class Forecast:
    """Forecast of one quantity at `t_s` since power-on: V or V/g, and s since power-on.

    present    the drift now, without slow noise
    final      the final value
    steady_s   the time from which the remaining drift stays within the tolerance
    """

    t_s: float
    present: Bounds
    final: Bounds
    steady_s: Bounds
    tolerance: float
    change: float  # of the whole approach, by the forecast
    innovation_ratio: float  # see `Bank.innovation_ratio`

    @property
    def known(self) -> bool:
        """Whether the final value is known."""
        return not self.contradicted and self.final.half <= max(self.tolerance, MOST_KNOWN_WIDTH * abs(self.change))

    @property
    def contradicted(self) -> bool:
        """Whether the measured drift agrees with no filter; the bounds are then invalid."""
        return self.innovation_ratio >= MOST_SURPRISE

    @property
    def steady(self) -> bool:
        """Whether no drift remains."""
        return self.steady_s.high <= self.t_s


@dataclass(frozen=True)
class QuantityFilter:
    """Filters of one quantity: its first value, the white standard error of one value, and the bank in this unit."""

    first: float
    unit: float
    bank: Bank

    @classmethod
    def of(cls, t_s: float, value: float, std: float, scale: float) -> QuantityFilter:
        """Start with the first value; `scale` is the scale factor."""
        unit = std or DEFAULT_NOISE * abs(scale)
        return cls(value, unit, make_bank(t_s, 0.0, TYPICAL_DRIFT * abs(scale) / unit)).after(t_s, value, std)

    def after(self, t_s: float, value: float, std: float, *, offset: bool = False) -> QuantityFilter:
        """Add a value."""
        bank = self.bank.after(t_s, (value - self.first) / self.unit, (std or self.unit) / self.unit, offset=offset)
        return replace(self, bank=bank)

    def forecast(self) -> Forecast:
        """The present forecast."""
        states = self.bank.drawn(DRAWS)
        remaining, taus_s = states[:, REST:LN_TAU], np.exp(states[:, LN_TAU:SLOW])
        final, present = states[:, LEVEL], states[:, LEVEL] + remaining.sum(axis=1)
        tolerance = COVERAGE_FACTOR * self.bank.noise
        steady_s = self.bank.t_s + _time_to_tolerance_s(remaining, taus_s, tolerance)
        median = float(np.median(final))
        return Forecast(
            self.bank.t_s,
            self._bounds(present),
            self._bounds(final),
            _bounds(steady_s),
            tolerance * self.unit,
            median * self.unit,
            self.bank.innovation_ratio,
        )

    def _bounds(self, draws: Array) -> Bounds:
        return Bounds(*(self.first + self.unit * bound for bound in _bounds(draws)))


@dataclass(frozen=True)
class SoakForecast:
    """Filters of all quantities by name, such as `bias-x`; empty before the first reversal. `oven_c`: oven temperature,
    or 0.
    """

    followed: Mapping[str, QuantityFilter]
    oven_c: float = 0.0

    def after(self, part: Table) -> SoakForecast:
        """Add a reversal, or a stretch of the still record (see `soak_parts`).

        An incomplete reversal is ignored. While the oven heats, all filters restart.
        """
        if self.oven_c and np.abs(part.optional("temperature_c", self.oven_c) - self.oven_c).max() > REACHED_K:
            return replace(self, followed={})
        filters: dict[str, QuantityFilter] = dict(self.followed)
        for axis in (axis for axis in part.axes if axis in AXES):
            filters |= (
                self._follow_holds(part, axis)
                if part.labels["path"][0].startswith(HOLD)
                else self._tumble_filters(part, axis)
            )
        return replace(self, followed=filters)

    def forecasts(self) -> dict[str, Forecast]:
        """The present forecast of each quantity."""
        return {name: quantity_filter.forecast() for name, quantity_filter in self.followed.items()}

    def _follow_holds(self, part: Table, axis: str) -> dict[str, QuantityFilter]:
        previous = self.followed.get(name := f"bias-{axis}")
        if previous is None:
            return {}
        n, white = part.column("n"), white_std(part)
        t_s, value = float(np.average(part.time_s, weights=n)), float(np.average(part.output(axis), weights=n))
        std = 0.0 if white is None else float(1 / np.sqrt(np.sum(white[:, part.axes.index(axis)] ** -2)))
        return {name: previous.after(t_s, value, std, offset=True)}

    def _tumble_filters(self, part: Table, axis: str) -> dict[str, QuantityFilter]:
        if np.diff(part.time_s, prepend=part.time_s[0]).max() > LONGEST_MOVE_S:
            return {}
        try:
            (tumble,) = estimate_tumbles(part, axis)
        except DataError:
            return {}
        scale = tumble.scale_v_per_g
        values = {"bias": (tumble.bias_v, tumble.bias_std_v), "scale": (scale, abs(scale) * tumble.scale_std)}
        return {
            name: previous.after(tumble.t_s, *value) if previous else QuantityFilter.of(tumble.t_s, *value, scale)
            for name, value, previous in (
                (f"{q}-{axis}", v, self.followed.get(f"{q}-{axis}")) for q, v in values.items()
            )
        }


@dataclass(frozen=True)
class ForecastHistory:
    """The forecasts of one quantity during a soak, in order of time."""

    forecasts: tuple[Forecast, ...]

    @property
    def last(self) -> Forecast:
        """The forecast at the end."""
        return self.forecasts[-1]

    @property
    def known_s(self) -> float | None:
        """The time since power-on from which the final value is known to the end; None if it is not."""
        known_from_s = None
        for forecast in reversed(self.forecasts):
            if not forecast.known:
                break
            known_from_s = forecast.t_s
        return known_from_s


def steady_time(histories: Mapping[str, ForecastHistory], axis: str = "") -> Bounds | None:
    """The time at which all quantities of an axis, or of all axes, are steady by the last forecasts, s since power-on.

    Each bound is the latest of all quantities, and infinite if it is more than LATEST_STEADY_S after the forecast. None
    without a forecast, and where a measured drift agrees with no filter.
    """
    last = [history.last for name, history in histories.items() if name.endswith(axis)]
    if not last or any(forecast.contradicted for forecast in last):
        return None
    steady_times = [
        [s if s - forecast.t_s < LATEST_STEADY_S else np.inf for s in forecast.steady_s] for forecast in last
    ]
    return Bounds(*np.max(steady_times, axis=0).tolist())


def forecast_history(table: Table, oven_c: float = 0.0) -> dict[str, ForecastHistory]:
    """Forecasts of every quantity of a soak's table, by name.

    There are at most FORECASTS of them, each after a part of the table. They are denser at the beginning, where the
    drift is fastest.
    """
    parts = list(soak_parts(table))
    shown_parts = set(np.rint(np.geomspace(1, len(parts), FORECASTS)).astype(int).tolist()) if parts else set()
    histories: dict[str, list[Forecast]] = {}
    for number, state in enumerate(filter_soak(table, oven_c), 1):
        for name, forecast in state.forecasts().items() if number in shown_parts else ():
            earlier = histories.setdefault(name, [])
            if not earlier or earlier[-1].t_s < forecast.t_s:
                earlier.append(forecast)
    return {name: ForecastHistory(tuple(forecasts)) for name, forecasts in histories.items()}


def filter_soak(table: Table, oven_c: float = 0.0) -> Iterator[SoakForecast]:
    """The filters after each part of a soak's table."""
    state = SoakForecast({}, oven_c)
    for part in soak_parts(table):
        state = state.after(part)
        yield state


def soak_parts(table: Table) -> Iterator[Table]:
    """Reversals and stretches of the still record, in order."""
    paths = np.array(table.labels["path"])
    edges = [0, *(np.flatnonzero(paths[1:] != paths[:-1]) + 1), len(paths)]
    for begin, end in pairwise(edges):
        rows, count = np.arange(begin, end), 1
        if paths[begin].startswith(HOLD):
            length_s = float(np.ptp(table.time_s[rows]))
            count = min(len(rows), max(STRETCHES, int(np.ceil(length_s / STRETCH_S))))
        if paths[begin].startswith((HOLD, REVERSAL)):
            yield from (table.rows(part) for part in np.array_split(rows, count))


def _time_to_tolerance_s(remaining: Array, taus_s: Array, tolerance: float) -> Array:
    """For each draw, the time after which the remaining drift stays within the tolerance; inputs have shape (n, 2)."""
    future_drift = np.abs(
        np.sum(remaining[:, None, :] * np.exp(-HORIZON_S[None, :, None] / taus_s[:, None, :]), axis=2)
    )
    log_excess = np.log(np.maximum(future_drift, SMALLEST) / tolerance)
    last = len(HORIZON_S) - 1 - np.argmax(log_excess[:, ::-1] > 0, axis=1)  # the last time at which it is beyond
    last, draw = np.minimum(last, len(HORIZON_S) - 2), np.arange(len(log_excess))
    excess_before, excess_after = log_excess[draw, last], log_excess[draw, last + 1]
    share = np.clip(excess_before / np.maximum(excess_before - excess_after, SMALLEST), 0.0, 1.0)
    crossed = HORIZON_S[last] + share * (HORIZON_S[last + 1] - HORIZON_S[last])
    return np.where((log_excess > 0).any(axis=1), crossed, 0.0)


def _bounds(draws: Array) -> Bounds:
    return Bounds(*np.quantile(draws, [0.025, 0.5, 0.975]).tolist())
