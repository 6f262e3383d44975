"""What bias and scale factor of a soak will come to, said while they are still on their way, with 95 % bounds.

Every reversal, and every few minutes of the still record in between, goes into a bank of Kalman filters for each
quantity of each axis. The still record shows the bias shifted by a constant, that of the load along z.

A final value is known once its bounds are narrow beside the whole change, or beside the tolerance within which a value
is called steady; until then it is not. Nor is it where what came is not what any of the filters foresaw.

Source  Barshan and Durrant-Whyte, IEEE Trans. Robotics and Automation 11 (1995) 328; JCGM 101, 7.7: coverage interval.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from calibrations.errors import DataError
from calibrations.estimators.approach import HOUR_S, LEVEL, LN_TAU, REST, SLOW, Bank, bank
from calibrations.evaluations.soak import AXES, HOLD, LONGEST_MOVE_S, REACHED_K, REVERSAL
from calibrations.evaluations.steady_state import COVERAGE
from calibrations.evaluations.tumble import tumbles
from calibrations.noise_estimation.mean_noise import white_std
from calibrations.table import Array, Table

STRETCH_S, STRETCHES = 300.0, 3  # of the still record: a value is the mean of so much, or of a third of a hold
MOST = 4e-3  # of a drift beforehand, over the scale factor: in g, and as a fraction
QUIET = 2e-5  # white standard error over the scale factor, where it is not known
DRAWS = 1000
LOOKS = 24
NARROW = 0.25  # of the whole change: half the width of the bounds of what is known
SURPRISED = 3.0  # mean normalised innovation squared beyond which no filter's model holds
TINY = 1e-12  # of a unit
FARTHEST_S = 48 * HOUR_S  # from now: a bound beyond it is none
AHEAD_S = np.concatenate([[0.0], np.geomspace(60.0, 100 * HOUR_S, 60)])


class Bounds(NamedTuple):
    """A median, and the 95 % bounds about it."""

    low: float
    value: float
    high: float

    @property
    def half(self) -> float:
        """Half of their width."""
        return (self.high - self.low) / 2


@dataclass(frozen=True)
class Forecast:
    """Of one quantity at `t_s`, since power-on: V or V/g, and s since power-on.

    present    where the drift is now, slow noise apart
    final      what it comes to
    steady_s   when what is left to come falls within the tolerance for good
    """

    t_s: float
    present: Bounds
    final: Bounds
    steady_s: Bounds
    tolerance: float
    change: float  # of the whole approach, as foreseen
    surprise: float  # see `Bank.surprise`

    @property
    def known(self) -> bool:
        """Whether the final value is."""
        return not self.surprised and self.final.half <= max(self.tolerance, NARROW * abs(self.change))

    @property
    def surprised(self) -> bool:
        """Whether what came is not what any filter foresaw: then its bounds hold nothing."""
        return self.surprise >= SURPRISED

    @property
    def steady(self) -> bool:
        """Whether nothing is left to come."""
        return self.steady_s.high <= self.t_s


@dataclass(frozen=True)
class Followed:
    """One quantity: its first value, the white standard error of one value, and the bank, in units of it."""

    first: float
    unit: float
    bank: Bank

    @classmethod
    def of(cls, t_s: float, value: float, std: float, scale: float) -> Followed:
        """Begin with the first value; `scale` is the scale factor."""
        unit = std or QUIET * abs(scale)
        return cls(value, unit, bank(t_s, 0.0, MOST * abs(scale) / unit)).after(t_s, value, std)

    def after(self, t_s: float, value: float, std: float, *, offset: bool = False) -> Followed:
        """One more value."""
        done = self.bank.after(t_s, (value - self.first) / self.unit, (std or self.unit) / self.unit, offset=offset)
        return replace(self, bank=done)

    def forecast(self) -> Forecast:
        """What is known by now."""
        states = self.bank.drawn(DRAWS)
        rest, taus_s = states[:, REST:LN_TAU], np.exp(states[:, LN_TAU:SLOW])
        final, present = states[:, LEVEL], states[:, LEVEL] + rest.sum(axis=1)
        tolerance = COVERAGE * self.bank.noise
        steady_s = self.bank.t_s + _left_s(rest, taus_s, tolerance)
        median = float(np.median(final))
        return Forecast(
            self.bank.t_s,
            self._bounds(present),
            self._bounds(final),
            _bounds(steady_s),
            tolerance * self.unit,
            median * self.unit,
            self.bank.surprise,
        )

    def _bounds(self, draws: Array) -> Bounds:
        return Bounds(*(self.first + self.unit * each for each in _bounds(draws)))


@dataclass(frozen=True)
class SoakForecast:
    """All quantities by name, as `bias-x`; none before the first reversal. `oven_c` is the oven's temperature, or 0."""

    followed: Mapping[str, Followed]
    oven_c: float = 0.0

    def after(self, part: Table) -> SoakForecast:
        """With one more reversal, or one more stretch of the still record: see `parts`.

        A reversal that was interrupted, or is not whole, tells nothing; while the oven heats, all begins anew.
        """
        if self.oven_c and np.abs(part.optional("temperature_c", self.oven_c) - self.oven_c).max() > REACHED_K:
            return replace(self, followed={})
        found: dict[str, Followed] = dict(self.followed)
        for axis in (axis for axis in part.axes if axis in AXES):
            found |= self._held(part, axis) if part.labels["path"][0].startswith(HOLD) else self._turned(part, axis)
        return replace(self, followed=found)

    def forecasts(self) -> dict[str, Forecast]:
        """What is known of each quantity."""
        return {name: each.forecast() for name, each in self.followed.items()}

    def _held(self, part: Table, axis: str) -> dict[str, Followed]:
        before = self.followed.get(name := f"bias-{axis}")
        if before is None:
            return {}
        n, white = part.column("n"), white_std(part)
        t_s, value = float(np.average(part.time_s, weights=n)), float(np.average(part.column(f"v{axis}_v"), weights=n))
        std = 0.0 if white is None else float(1 / np.sqrt(np.sum(white[:, part.axes.index(axis)] ** -2)))
        return {name: before.after(t_s, value, std, offset=True)}

    def _turned(self, part: Table, axis: str) -> dict[str, Followed]:
        if np.diff(part.time_s, prepend=part.time_s[0]).max() > LONGEST_MOVE_S:
            return {}
        try:
            (done,) = tumbles(part, axis)
        except DataError:
            return {}
        scale = done.scale_v_per_g
        values = {"bias": (done.bias_v, done.bias_std_v), "scale": (scale, abs(scale) * done.scale_std)}
        return {
            name: before.after(done.t_s, *value) if before else Followed.of(done.t_s, *value, scale)
            for name, value, before in ((f"{q}-{axis}", v, self.followed.get(f"{q}-{axis}")) for q, v in values.items())
        }


@dataclass(frozen=True)
class Foreseen:
    """What was known of one quantity in the course of a soak, in order of time."""

    forecasts: tuple[Forecast, ...]

    @property
    def last(self) -> Forecast:
        """What is known at the end."""
        return self.forecasts[-1]

    @property
    def known_s(self) -> float | None:
        """From when on the final value was known, since power-on; None where it is not at the end."""
        since = None
        for each in reversed(self.forecasts):
            if not each.known:
                break
            since = each.t_s
        return since


def steady_from(found: Mapping[str, Foreseen], axis: str = "") -> Bounds | None:
    """When all quantities of an axis, or of all axes, are steady by the last forecasts, s since power-on: the latest of
    each bound, infinite beyond FARTHEST_S. None where one of them is no approach."""
    last = [course.last for name, course in found.items() if name.endswith(axis)]
    if not last or any(each.surprised for each in last):
        return None
    within = [[s if s - each.t_s < FARTHEST_S else np.inf for s in each.steady_s] for each in last]
    return Bounds(*np.max(within, axis=0).tolist())


def foreseen(table: Table, oven_c: float = 0.0) -> dict[str, Foreseen]:
    """Every quantity of a soak's table by name, as known after LOOKS parts of it, closer together at the beginning."""
    whole = list(parts(table))
    looks = set(np.rint(np.geomspace(1, len(whole), LOOKS)).astype(int).tolist()) if whole else set()
    seen: dict[str, list[Forecast]] = {}
    for number, told in enumerate(followed(table, oven_c), 1):
        for name, each in told.forecasts().items() if number in looks else ():
            before = seen.setdefault(name, [])
            if not before or before[-1].t_s < each.t_s:
                before.append(each)
    return {name: Foreseen(tuple(forecasts)) for name, forecasts in seen.items()}


def followed(table: Table, oven_c: float = 0.0) -> Iterator[SoakForecast]:
    """After each part of a soak's table: what was known while it lasted."""
    told = SoakForecast({}, oven_c)
    for part in parts(table):
        told = told.after(part)
        yield told


def parts(table: Table) -> Iterator[Table]:
    """Reversals and stretches of the still record, in order."""
    paths = np.array(table.labels["path"])
    edges = [0, *(np.flatnonzero(paths[1:] != paths[:-1]) + 1), len(paths)]
    for begin, end in pairwise(edges):
        rows, count = np.arange(begin, end), 1
        if paths[begin].startswith(HOLD):
            length_s = float(np.ptp(table.time_s[rows]))
            count = min(len(rows), max(STRETCHES, int(np.ceil(length_s / STRETCH_S))))
        if paths[begin].startswith((HOLD, REVERSAL)):
            yield from (table.rows(each) for each in np.array_split(rows, count))


def _left_s(rest: Array, taus_s: Array, tolerance: float) -> Array:
    """How long what is left to come stays beyond the tolerance, of each draw; `rest` and `taus_s` (n, 2)."""
    ahead = np.abs(np.sum(rest[:, None, :] * np.exp(-AHEAD_S[None, :, None] / taus_s[:, None, :]), axis=2))
    over = np.log(np.maximum(ahead, TINY) / tolerance)
    last = len(AHEAD_S) - 1 - np.argmax(over[:, ::-1] > 0, axis=1)  # the last time at which it is beyond
    last, each = np.minimum(last, len(AHEAD_S) - 2), np.arange(len(over))
    before, after = over[each, last], over[each, last + 1]
    share = np.clip(before / np.maximum(before - after, TINY), 0.0, 1.0)
    crossed = AHEAD_S[last] + share * (AHEAD_S[last + 1] - AHEAD_S[last])
    return np.where((over > 0).any(axis=1), crossed, 0.0)


def _bounds(draws: Array) -> Bounds:
    return Bounds(*np.quantile(draws, [0.025, 0.5, 0.975]).tolist())
