"""Patterns that no noise process makes: a step, a drift, a settling, a followed column.

They look like a random walk in a spectrum. In the cosine transform of the means each has a form of its own, and
its coefficients are independent: the amplitude that fits best, and its gain, are those of a matched filter, for a step
at every place at once. Where a column and the output both wander, the gain is computed beside noise that wanders too,
so that a chance likeness is not taken for a cause.

Source  Van Trees, Detection, Estimation, and Modulation Theory, part I, 4.3: a known signal in coloured noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from scipy.fft import dct, dst
from scipy.optimize import minimize_scalar

from calibrations.criteria import INSEPARABLE, PATTERN_AMPLITUDE, PATTERN_CERTAIN
from calibrations.noise.kernels import first_order_lag, matched_sums, play
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.lines import means_without
from calibrations.noise.record import Channel
from calibrations.noise.samples import hidden_in
from calibrations.table import Array

STEP, DRIFT, SETTLING, FOLLOWS = "step", "drift", "settling", "follows"
TIMES = np.geomspace(1 / 50, 1 / 2, 16)  # time constants of a settling that are tried, of the record
LAGS = (0.0, *np.geomspace(1 / 400, 1 / 5, 10).tolist())  # of an output behind a column, of the record
EDGE = 8  # means from either end within which a step would be one odd value
LAG_PRECISION = 0.02  # of a lag
PER = {"temperature_c": "K", "supply_v": "V"}  # units of columns
POWERS = {2: "square", 3: "cube"}  # of a column, about its mean: a polynomial beside a straight line
PLAYS = (0.03, 0.1, 0.3)  # widths of a hysteresis that are tried, of the range of a column


@dataclass(frozen=True)
class Pattern:
    """A part of one channel's means that is not noise: a form (m,), its amount, and how uncertain that is.

    `make` computes the form, which few patterns need. `words` has a place for the amount. `gain` is twice the gain in
    log-likelihood, `price` that of the search for it. `cause` is the logged column that it follows; `rivals` are the
    other patterns that explain as much. `doubt` is the uncertainty of the amount that comes from its form, as a share
    of the amount.
    """

    kind: str
    axis: str
    words: str
    make: Callable[[], Array] = field(repr=False)
    size: float
    std: float
    gain: float
    price: float
    cause: str = ""
    doubt: float = 0.0
    rivals: tuple[Pattern, ...] = ()
    lag_s: float = 0.0  # behind the column
    further: bool = False  # a curvature or a branch beside a straight line over the same column

    @cached_property
    def form(self) -> Array:
        """The pattern's form, of mean 0, shape (m,)."""
        form = self.make()
        return np.asarray(form - form.mean())

    @property
    def net_gain(self) -> float:
        """Gain beyond the price."""
        return self.gain - self.price

    @property
    def plain(self) -> str:
        """The pattern in words."""
        return self.words.replace("{}", f"{self.size:+.4g} +- {self.std:.1g}")

    @property
    def certain(self) -> bool:
        """Whether chance is excluded, with any other pattern in the fit."""
        return self.net_gain > (0.0 if self.kind == FOLLOWS else PATTERN_CERTAIN)

    @property
    def needless(self) -> bool:
        """Whether a curvature or a branch is chance, once all amounts are fitted together."""
        return self.further and (self.size / self.std) ** 2 < PATTERN_AMPLITUDE

    @property
    def text(self) -> str:
        """The pattern in words, with the patterns that the record cannot separate from it."""
        if not self.rivals:
            return self.plain
        return f"{self.plain} (this record cannot separate it from {' or '.join(rival.plain for rival in self.rivals)})"

    def remove_from(self, channel: Channel) -> Channel:
        """The record without it."""
        return replace(channel, means=channel.means - self.size * self.form) if channel.axis == self.axis else channel


def pattern_of(fit: ChannelFit, removed_patterns: Iterable[Pattern] = ()) -> Pattern | None:
    """The pattern with the greatest gain in one channel; None where chance explains it."""
    if hidden_in(fit.channel.oddities) is not None:
        return None  # rounding makes steps and slopes
    spectrum, unit = _Ordinates.of(fit), fit.channel.unit
    candidates = [
        _step(fit.channel, spectrum, unit), *_courses(fit.channel, spectrum, unit),
        *_find_followed_columns(fit.channel, spectrum, unit, removed_patterns),
        *_further(fit.channel, spectrum, unit, removed_patterns),
    ]  # fmt: skip
    kinds = {(pattern.kind, pattern.cause) for pattern in candidates}
    best, *weaker = sorted((_best(candidates, *kind) for kind in kinds), key=lambda pattern: -pattern.net_gain)
    if best.net_gain <= 0:
        return None
    return replace(best, rivals=tuple(pattern for pattern in weaker if best.net_gain - pattern.net_gain < INSEPARABLE))


def _best(candidates: Iterable[Pattern], kind: str, cause: str) -> Pattern:
    """The best pattern of one kind."""
    return max(
        (pattern for pattern in candidates if (pattern.kind, pattern.cause) == (kind, cause)),
        key=lambda pattern: pattern.net_gain,
    )


@dataclass(frozen=True)
class _Ordinates:
    """Cosine coefficients of the means below the filter, (k,), and their variances by the model."""

    measured: Array
    variance: Array
    n: int

    @classmethod
    def of(cls, fit: ChannelFit) -> _Ordinates:
        channel = fit.channel
        n, step_s = len(channel.means), channel.sampling.interval_s
        last = min(n, 2 + int(channel.corner_hz * n * step_s)) if np.isfinite(channel.corner_hz) else n
        f = np.arange(1, last) / (2 * n * step_s)
        coefficients = dct(means_without(channel, fit.lines), type=2, norm="ortho")[1:last]
        return cls(coefficients, fit.level(f) / step_s, n)

    def coefficients(self, form: Array) -> Array:
        """Cosine coefficients (k,) of a form of the means (n,)."""
        return np.asarray(dct(form, type=2, norm="ortho")[1 : len(self.measured) + 1])

    def matched(self, form: Array) -> tuple[float, float, float]:
        """(amplitude, its standard deviation, gain) of a form of the means (n,)."""
        c = self.coefficients(form)
        weight = float(np.sum(c * c / self.variance))
        amplitude = float(np.sum(c * self.measured / self.variance)) / weight
        return amplitude, weight**-0.5, amplitude**2 * weight


def _step(channel: Channel, ordinates: _Ordinates, unit: str) -> Pattern:
    """The step with the greatest gain, over all places."""
    n, k = ordinates.n, len(ordinates.measured)
    per_step = _per_step(n, k)
    gain_terms, power = np.zeros(n - 1), np.zeros(n + 1)
    gain_terms[: min(k, n - 1)] = (ordinates.measured * per_step / ordinates.variance)[: n - 1]
    power[1 : k + 1] = per_step**2 / ordinates.variance
    top = dst(gain_terms, type=1) / 2
    turned = dct(power, type=1) + power[0]
    turned[::2] += power[-1]
    turned[1::2] -= power[-1]
    up = turned[2::2] / 2  # at 2, 4 .. n, and back
    bottom = (power.sum() - np.concatenate([up, up[::-1][1 - n % 2 :]])) / 2
    gain = np.where(bottom > 0, top**2 / np.maximum(bottom, np.finfo(float).tiny), 0.0)
    gain[: EDGE - 1] = gain[n - EDGE :] = 0.0
    row = int(np.argmax(gain))
    text = f"a step of {{}} {unit} of {channel.axis} at t = {(row + 1) * channel.sampling.interval_s:.6g} s"
    price = PATTERN_AMPLITUDE + 2 * float(np.log(n))
    size, std = float(top[row] / bottom[row]), float(bottom[row] ** -0.5)
    return Pattern(STEP, channel.axis, text, partial(_step_form, n, row), size, std, float(gain[row]), price)


def _step_form(n: int, row: int) -> Array:
    return np.asarray(np.arange(n) > row, dtype=float)


@lru_cache(maxsize=2)
def _per_step(n: int, k: int) -> Array:
    """Cosine coefficients (k,) of a step at mean m of n, over sin(pi k m / n)."""
    return np.asarray(-np.sqrt(2 / n) / (2 * np.sin(np.pi * np.arange(1, k + 1) / (2 * n))))


def _courses(channel: Channel, ordinates: _Ordinates, unit: str) -> Iterator[Pattern]:
    """A straight drift, and the settling with the greatest gain."""
    n, axis = ordinates.n, channel.axis
    tops, bottoms = matched_sums(
        _course_coefficients(n, len(ordinates.measured)),
        ordinates.measured / ordinates.variance,
        1 / ordinates.variance,
    )
    sizes, stds, gains = (values.tolist() for values in (tops / bottoms, bottoms**-0.5, tops**2 / bottoms))
    hours = channel.sampling.interval_s / 3600
    yield Pattern(
        DRIFT, axis, f"a drift of {axis} by {{}} {unit}/h", partial(_ramp, n, hours), sizes[0] / hours,
        stds[0] / hours, gains[0], PATTERN_AMPLITUDE,
    )  # fmt: skip
    best = int(np.argmax(gains[1:]))
    share, price = float(TIMES[best]), PATTERN_AMPLITUDE + 2 * float(np.log(len(TIMES)))
    text = f"{axis} settles by {{}} {unit}, with a time constant of about {share * channel.length_s:.2g} s"
    make = partial(_settling_curve, n, share)
    yield Pattern(SETTLING, axis, text, make, sizes[1 + best], stds[1 + best], gains[1 + best], price)


def _ramp(n: int, per_mean: float) -> Array:
    return np.asarray((np.arange(n) + 0.5) * per_mean)


def _settling_curve(n: int, share: float) -> Array:
    return np.asarray(-np.exp(-(np.arange(n) + 0.5) / n / share))


@lru_cache(maxsize=2)
def _course_coefficients(n: int, k: int) -> Array:
    """Cosine coefficients of a ramp by 1 from mean to mean, and of settlings with TIMES; shape (1 + times, k).

    The sum of exp(-a (j + 1/2)) cos(2 y (j + 1/2)) over j < n is geometric, with y = pi k / (2 n); that of the ramp is
    its derivative at a = 0.
    """
    number = np.arange(1, k + 1)
    y = np.pi * number / (2 * n)
    cosine, square, odd = np.cos(y), np.sin(y) ** 2, number % 2 == 1
    coefficients = np.empty((1 + len(TIMES), k))
    coefficients[0] = np.where(odd, -cosine / square, 0.0)
    for row, share in zip(coefficients[1:], TIMES.tolist(), strict=True):
        half, end = np.sinh(1 / (2 * n * share)), np.exp(-1 / share)
        row[:] = -half * cosine / (square + half**2) * np.where(odd, 1 + end, 1 - end)
    return np.asarray(coefficients / np.sqrt(2 * n))


def _find_followed_columns(
    channel: Channel, ordinates: _Ordinates, unit: str, removed_patterns: Iterable[Pattern]
) -> Iterator[Pattern]:
    """Outputs that follow a column, as read or without its scatter, at once or with a lag; each column once."""
    price = PATTERN_AMPLITUDE + 2 * float(np.log(len(LAGS) * max(1, len(channel.logged))))
    removed_causes = {pattern.cause for pattern in removed_patterns if pattern.axis == channel.axis}
    for name, column in channel.logged.items():
        if name in removed_causes:
            continue
        for values, doubt in ((column.read, 0.0), (column.level, column.doubt)):
            share = _best_lag(values, ordinates)
            lag_words = f", with a lag of {share * channel.length_s:.2g} s" if share else ""
            text = f"{channel.axis} follows {name} by {{}} {unit}/{PER.get(name, name)}{lag_words}"
            make = partial(_lag, values, share)
            lag_s = share * channel.length_s
            yield Pattern(
                FOLLOWS, channel.axis, text, make, *ordinates.matched(make()), price, name, doubt, lag_s=lag_s
            )


def _lag(values: Array, share: float) -> Array:
    """Values (n,) behind a first-order lag, its time constant a share of the record."""
    return values if share == 0 else np.asarray(first_order_lag(values, share * len(values)))


def _best_lag(values: Array, ordinates: _Ordinates) -> float:
    """The lag with the greatest gain: the best of LAGS, refined; 0 where the data cannot separate it from none."""

    def loss(share: float) -> float:
        return -ordinates.matched(_lag(values, share))[2]

    losses = [loss(share) for share in LAGS]
    best = int(np.argmin(losses))
    if losses[0] - losses[best] < INSEPARABLE or -losses[best] < PATTERN_AMPLITUDE:
        return 0.0
    ends = LAGS[max(1, best - 1)], LAGS[min(len(LAGS) - 1, best + 1)]
    optimum = minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": LAG_PRECISION * LAGS[best]})
    return float(optimum.x if optimum.fun < losses[best] else LAGS[best])


def _further(
    channel: Channel, ordinates: _Ordinates, unit: str, removed_patterns: Iterable[Pattern]
) -> Iterator[Pattern]:
    """Curvature and branches of an output that follows a column, with the lag that was found: its square and cube, and
    a hysteresis, which depends on the direction in which the column changes."""
    price = PATTERN_AMPLITUDE + 2 * float(np.log(len(POWERS) + len(PLAYS)))
    for line in removed_patterns:
        if line.kind != FOLLOWS or line.further or line.axis != channel.axis:
            continue
        per, span = PER.get(line.cause, line.cause), float(np.ptp(line.form))
        forms = [(f"the {name} of {line.cause} by {{}} {unit}/{per}^{k}", line.form**k) for k, name in POWERS.items()]
        branch = f"the direction in which {line.cause} changes by {{}} {unit} (hysteresis)"
        forms += [(branch, play(line.form, share * span)) for share in PLAYS]
        for words, form in forms:
            make, text = partial(np.asarray, form), f"{channel.axis} follows {words}"
            yield Pattern(FOLLOWS, channel.axis, text, make, *ordinates.matched(form), price, line.cause, further=True)


def refit_patterns(patterns: tuple[Pattern, ...], fit: ChannelFit, channel: Channel) -> tuple[Pattern, ...]:
    """The patterns of one channel, their sizes fitted together to its whole record with a fit's effects."""
    ordinates = _Ordinates.of(replace(fit, channel=channel))
    forms = (
        np.column_stack([ordinates.coefficients(pattern.form) for pattern in patterns])
        / np.sqrt(ordinates.variance)[:, None]
    )
    size, *_ = np.linalg.lstsq(forms, ordinates.measured / np.sqrt(ordinates.variance), rcond=None)
    std = np.sqrt(np.diag(np.linalg.pinv(forms.T @ forms)))
    std = np.hypot(std, [pattern.doubt * a for pattern, a in zip(patterns, size, strict=True)])
    return tuple(replace(p, size=float(a), std=float(s)) for p, a, s in zip(patterns, size, std, strict=True))
