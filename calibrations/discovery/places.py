"""Where a model of rows fails: places whose residual is more than noise.

A place is a stretch of a column (an angle, time, temperature, direction) of one axis whose residual has a mean too far
from zero to be noise, or a scatter too large. Places are ranked by the excess there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from calibrations.criteria import MATERIAL, MOST_SLOW_NOISE, ONE_SIDED, SIGNIFICANT, STANDS_OUT
from calibrations.discovery.findings import Place
from calibrations.fitting.fit import Fit, axis_of, milli_unit, scales
from calibrations.means.noise import most_scatter, rms
from calibrations.model.chain import backward
from calibrations.table import Array, Table, in_time, time_origin
from calibrations.text import interval, milli_amount, to_hundredth

MOST_PLACES = 8
PARTS = 8  # of a column without a natural grid

WORDS: Mapping[str, tuple[str, str]] = {
    "alpha": ("alpha_deg", "deg"),
    "beta": ("beta_deg", "deg"),
    "direction": ("direction", ""),
    "time": ("t_s", "s"),
    "temperature": ("temperature_c", "degC"),
    "rate": ("rate_deg_s", "deg/s"),
}
SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")  # of the sensor, that gravity or the field points along


@dataclass(frozen=True)
class _Stretch:
    """Rows of a table in which a column lies between `low` and `high`, and the residual of one channel there."""

    coordinate: str
    low: float
    high: float
    channel: str
    excess: float
    mean: float
    unit: str
    scale: float  # output per g, field or deg/s of that channel; 1 for a residual in those
    milli: str  # a thousandth of the sensed unit
    words: str  # the stretch in words

    @property
    def place(self) -> Place:
        """The stretch as a place of a comparison."""
        return Place(self.coordinate, self.low, self.high, axis_of(self.channel), self.excess, self._text)

    @property
    def _text(self) -> str:
        """The place in words, with the mean residual there in the output's unit and in the sensed unit."""
        sensed_text = _signed(1e3 * self.mean / self.scale, self.milli)
        output_text = _signed(1e3 * self.mean, "mV") if self.unit == "V" else f"{self.mean:+.3g} {self.unit}"
        sensed = self.unit in ("g", "field") or self.milli == f"m{self.unit}"
        value = sensed_text if sensed else f"{output_text} ({sensed_text})"
        channel = "the magnitude" if self.channel == "norm" else self.channel
        return f"{self.words}: {channel} is off by {value} on average, rms {self.excess:.3g} x the noise floor"


def _signed(value: float, unit_name: str) -> str:
    """A value with its sign, in ASCII: `+12.0 mV`, `-9.45 uV`."""
    return f"{'+' if value > 0 else ''}{milli_amount(value, unit_name)}".replace("−", "-").replace("µ", "u")


def places(fit: Fit) -> tuple[Place, ...]:
    """The worst places where a model fails."""
    return tuple(stretch.place for stretch in _find_failing_stretches(fit, _by_noise(fit))[:MOST_PLACES])


def fails_by_scatter_only(fit: Fit) -> bool:
    """Whether a model fails nowhere if the scatter from row to row counts as noise, as far as a sensor has it.

    The scatter is estimated from the residual and may be an effect without a smooth form: a search has to decide.
    """
    if not fit.noise.known or fit.noise.given or not np.any(fit.noise.scatter):
        return False
    most = MOST_SLOW_NOISE * most_scatter(fit.table) * fit.noise.floor
    beyond_white = np.minimum(np.hypot(fit.noise.slow, fit.noise.scatter), most)
    return not _find_failing_stretches(fit, fit.residual / np.hypot(fit.noise.floor, beyond_white)[:, None])


def rows_at(fit: Fit, place: Place) -> NDArray[np.intp]:
    """The rows of a place, as indices of the fit's table; empty for a place of another fit."""
    for coordinate, low, high, rows in (*_parts(fit.table), *_sides(fit)):
        if (coordinate, low, high) == (place.where, place.low, place.high):
            return rows
    return np.zeros(0, np.intp)


def _find_failing_stretches(fit: Fit, by_noise: Array) -> list[_Stretch]:
    """Places where the residual is more than noise, worst first; at most one for each column and channel.

    `by_noise` is the residual over its noise, (channels, n).
    """
    stretches: list[_Stretch] = []
    chances: list[float] = []
    scale = scales(fit)
    unit, milli = fit.problem.unit, milli_unit(fit)
    floor = fit.noise.floor
    for coordinate, low, high, rows in (*_parts(fit.table), *_sides(fit)):
        for c, channel in enumerate(fit.channels):
            r = fit.residual[c, rows]
            excess = float(rms(r) / floor[c])
            words = _stretch_words(fit.table, coordinate, low, high)
            mean, size = float(r.mean()), float(scale[c])
            stretches.append(_Stretch(coordinate, low, high, channel, excess, mean, unit, size, milli, words))
            chances.append(float(chdtrc(len(r), np.sum(by_noise[c, rows] ** 2))))
    if not stretches:
        return []
    limit = SIGNIFICANT / len(stretches)
    failing = [k for k, p in enumerate(stretches) if chances[k] < limit and p.excess > MATERIAL]
    overall = {channel: (fit.excess[c], floor[c]) for c, channel in enumerate(fit.channels)}
    failing = [k for k in failing if _stands_out(stretches[k], *overall[stretches[k].channel])] or failing[:1]
    failing.sort(key=lambda k: stretches[k].excess, reverse=True)
    first = {(stretches[k].coordinate, stretches[k].channel): k for k in reversed(failing)}
    return [stretches[k] for k in failing if first[stretches[k].coordinate, stretches[k].channel] == k]


def _stretch_words(table: Table, coordinate: str, low: float, high: float) -> str:
    """A stretch in words; times of a run as its pictures show them."""
    if coordinate == "side":
        return f"side {SIDES[round(low)]}"
    if coordinate == "direction":
        return {1: "turning clockwise", -1: "turning anticlockwise", 0: "direction unknown"}[round(low)]
    column, unit = WORDS[coordinate]
    size, zero, origin_words, reach = 1.0, 0.0, "", float(np.ptp(table.column(column)))
    if coordinate == "time":
        size, unit = in_time(reach)
        zero, origin_words = time_origin(table)
    low, high = (low - zero) / size, (high - zero) / size
    if low != high:
        text = interval(low, high)
    else:  # one of few values: angles and rates as they were set, times and temperatures as they were measured
        text = to_hundredth(low, reach / size) if coordinate in ("time", "temperature") else f"{low:g}"
    return f"{coordinate} {text} {unit}{origin_words}"


def _by_noise(fit: Fit) -> Array:
    """The residual over its noise, (channels, n): rows made independent where the slow noise is known beforehand.

    Slow noise that was only found in the residual counts as far as a sensor may have it; beyond, it is a misfit.
    """
    if fit.noise.given:
        return fit.whitened[:, 0].reshape(fit.residual.shape)
    slow = np.minimum(fit.noise.slow, MOST_SLOW_NOISE * fit.noise.floor)
    noise = np.hypot(fit.noise.floor, slow) if fit.noise.known else fit.noise.floor
    return np.asarray(fit.residual / noise[:, None])


def _stands_out(place: _Stretch, excess: float, floor: float) -> bool:
    """Whether the residual there is larger than everywhere, or lies to one side."""
    return place.excess > STANDS_OUT * excess or abs(place.mean) > ONE_SIDED * excess * floor


def _sides(fit: Fit) -> Iterator[tuple[str, float, float, NDArray[np.intp]]]:
    """Positions by the side of the sensor that gravity, or the field, came from."""
    if not fit.table.type.magnitude:
        return
    a = backward(fit.table, fit.problem.layout.steps(fit.theta))
    axis = np.argmax(np.abs(a), axis=1)
    side = 2 * axis + (a[np.arange(len(a)), axis] < 0)
    for k in range(len(SIDES)):
        if len(rows := np.flatnonzero(side == k)):
            yield "side", float(k), float(k), rows


def _parts(table: Table) -> Iterator[tuple[str, float, float, NDArray[np.intp]]]:
    """Stretches of each column: its own values where they are few, else parts with equal numbers of rows."""
    for coordinate, (name, _) in WORDS.items():
        if name not in table:
            continue
        values = table.column(name)
        grid = np.unique(values)
        if len(grid) < 2:
            continue
        if len(grid) <= PARTS + 4:
            yield from ((coordinate, float(v), float(v), np.flatnonzero(values == v)) for v in grid)
            continue
        edges = np.quantile(values, np.linspace(0, 1, PARTS + 1))
        part = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, PARTS - 1)
        for k in range(PARTS):
            rows = np.flatnonzero(part == k)
            if len(rows):
                yield coordinate, float(values[rows].min()), float(values[rows].max()), rows
