"""Random telegraph noise of one channel: two levels, and the likeliest path between them.

Random telegraph noise (burst noise, popcorn), of one trap of a charge, has the spectrum of a Gauss-Markov process,
which has any level. The samples separate the two: the likeliest path of two levels (Viterbi's) is removed. The rest has
to be so much more likely with the same processes that it pays for the path and a surplus, and one of these processes
has to be needless. Path and surplus are twice the logarithm of a ratio of two likelihoods, which chance makes c with a
probability of exp(-c / 2) at most (Markov's inequality).

Source  Kirton and Uren, Adv. Phys. 38 (1989), on single traps; Viterbi, IEEE Trans. Inform. Theory 13 (1967).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import xlogy

from calibrations.criteria import FEWEST_JUMPS, TWO_LEVELS_BETTER
from calibrations.noise.fit import fit_effects, without_effects
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.lines import means_without
from calibrations.noise.samples import FASTEST, hidden_in
from calibrations.table import Array

TWO_LEVELS = "two-levels"
WIDTHS = (1, 8, 64, 512)  # means over which levels are looked for
ROUNDS = 6  # of path and levels in turn
LEAST = 1e-6  # noise beside the levels, as a share of their distance: rounding
Path = NDArray[np.int64]


@dataclass(frozen=True)
class Telegraph:
    """Two levels of one channel: their distance, the number of jumps, and the mean time at each level, s."""

    axis: str
    unit: str
    apart: float
    times: int
    upper_s: float
    lower_s: float

    @property
    def text(self) -> str:
        """In words."""
        return (
            f"random telegraph noise (burst noise, popcorn): {self.axis} jumps between two levels {self.apart:.3g} "
            f"{self.unit} apart, {self.times} times. It stays at the upper level for {self.upper_s:.3g} s and at the "
            f"lower level for {self.lower_s:.3g} s on average. Its spectrum is that of a Gauss-Markov process"
        )


def telegraph_of(fit: ChannelFit) -> Telegraph | None:
    """The two levels of a channel; None where its processes explain it without them."""
    if hidden_in(fit.channel.oddities) is not None:
        return None  # rounding makes levels
    values = means_without(fit.channel, fit.lines)
    widths = [width for width in WIDTHS if width <= len(values)]
    paths = [path for width in widths if (path := _path(values, width)) is not None]
    if not paths:
        return None
    best = min(paths, key=lambda path: _path_price(path) + _path_deviance(values, path))
    remaining = replace(fit.channel, means=values - _levels(values, best)[best])
    refit = fit_effects(without_effects(remaining, fit.lines), fit.effects)
    if 2 * (refit.log_likelihood - fit.log_likelihood) < _path_price(best) + TWO_LEVELS_BETTER or not _needless(refit):
        return None
    return _telegraph(fit, values, best)


def _needless(fit: ChannelFit) -> bool:
    """Whether a slow process is needless without the two levels."""
    slow = [effect for effect in fit.effects if effect.name not in FASTEST]
    smaller = ([e for e in fit.effects if e is not effect] for effect in slow)
    return any(
        2 * (fit.log_likelihood - fit_effects(fit, effects).log_likelihood) < TWO_LEVELS_BETTER for effects in smaller
    )


def _telegraph(fit: ChannelFit, values: Array, path: Path) -> Telegraph:
    channel, (low, high) = fit.channel, _levels(values, path)
    jumps, upper = np.flatnonzero(np.diff(path)), int(path.sum())
    dwells = [np.count_nonzero(path[np.append(jumps, -1)] == level) for level in (0, 1)]
    step_s = channel.sampling.interval_s
    return Telegraph(
        channel.axis, channel.unit, float(high - low), len(jumps),
        float(upper * step_s / dwells[1]), float((len(path) - upper) * step_s / dwells[0]),
    )  # fmt: skip


def _path(values: Array, width: int) -> Path | None:
    """The likeliest path between levels found in means over `width` values; None where it hardly jumps."""
    low, high = two_means(values[: len(values) // width * width].reshape(-1, width).mean(axis=1))
    spread = float(np.std(np.diff(values))) / 2**0.5
    if not spread > 0 or not high > low:
        return None
    path = likeliest_path(values, low, high, spread, 1 / (16 * width))
    return path if len(path) else None


def _levels(values: Array, path: Path) -> Array:
    """Mean values at either level (2,)."""
    return np.array([values[path == level].mean() for level in (0, 1)])


def _path_price(path: Path) -> float:
    """Twice the negative logarithm of a path's probability, as a Markov chain."""
    kinds = np.bincount(2 * path[:-1] + path[1:], minlength=4).reshape(2, 2)
    return float(-2 * np.sum(xlogy(kinds, kinds / np.maximum(kinds.sum(axis=1, keepdims=True), 1))))


def _path_deviance(values: Array, path: Path) -> float:
    """Twice the negative log-likelihood of values about a path in white noise, but for a constant."""
    low, high = levels = _levels(values, path)
    return float(len(values) * np.log(np.var(values - levels[path]) + (LEAST * (high - low)) ** 2))


@njit(cache=True, nogil=True)
def two_means(means: Array) -> tuple[float, float]:
    """Two levels of means (n,): those of the nearer ones; twice the same where there is only one."""
    low, high = means.min(), means.max()
    for _ in range(ROUNDS):
        middle, sums, counts = (low + high) / 2, np.zeros(2), np.zeros(2)
        for value in means:
            level = 1 if value > middle else 0
            sums[level] += value
            counts[level] += 1
        if counts.min() == 0:
            return low, low
        low, high = sums[0] / counts[0], sums[1] / counts[1]
    return low, high


@njit(cache=True, nogil=True)
def likeliest_path(values: Array, low: float, high: float, spread: float, jump_share: float) -> Path:
    """Path and levels in turn, shape (n,); empty where it jumps less than FEWEST_JUMPS times.

    spread  standard deviation of the noise beside the levels
    goes    share of the values at which the path jumps
    """
    n = len(values)
    path, origins = np.zeros(n, dtype=np.int64), np.empty(n, dtype=np.int8)
    for _ in range(ROUNDS):
        path_changes = viterbi(
            values, (low + high) / 2, (high - low) / spread**2, np.log(jump_share / (1 - jump_share)), origins, path
        )
        times, upper, total, upper_total = 0, 0, 0.0, 0.0
        for i in range(n):
            times += i > 0 and path[i] != path[i - 1]
            upper += path[i]
            total += values[i]
            upper_total += path[i] * values[i]
        if times < FEWEST_JUMPS:
            return path[:0]
        if not path_changes:
            break
        low, high, jump_share = (total - upper_total) / (n - upper), upper_total / upper, times / n
        square = 0.0
        for i in range(n):
            square += (values[i] - low - path[i] * (high - low)) ** 2
        spread = max(np.sqrt(square / n), LEAST * (high - low))
    return path


@njit(cache=True, nogil=True)
def viterbi(
    values: Array, middle: float, slope: float, jump_log_odds: float, origins: NDArray[np.int8], path: Path
) -> bool:
    """Write the likeliest path of 0 and 1 to `path` (n,), and return whether it changes.

    slope   a value's distance from the middle, times this, is the logarithm of how much more likely the upper level is
    goes    the logarithm of how much more likely it goes than stays, between two values
    before  (n,) memory for the level that both come from, +1 or -1; 0: each from itself

    Only the difference of the log-likelihoods of both levels counts: beyond -goes either way, both come from one level.
    """
    n = len(values)
    log_odds = (values[0] - middle) * slope
    for i in range(1, n):
        origins[i] = (log_odds > -jump_log_odds) - (log_odds < jump_log_odds)
        log_odds = min(max(log_odds, jump_log_odds), -jump_log_odds) + (values[i] - middle) * slope
    level, path_changes = 1 if log_odds > 0 else 0, False
    for i in range(n - 1, -1, -1):
        path_changes |= path[i] != level
        path[i] = level
        level = (origins[i] + 1) // 2 if origins[i] != 0 else level
    return path_changes
