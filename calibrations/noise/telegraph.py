"""Random telegraph noise of one channel: its levels, and the likeliest path between them.

Random telegraph noise (burst noise, popcorn) jumps between two levels with one trap of a charge, between more with
several traps or a trap of several states. Its spectrum is that of Gauss-Markov processes, which have any level. The
samples separate the two: the likeliest path between the levels (Viterbi's) is removed. The rest has to be so much more
likely with the same processes that it pays for the path and a surplus. And of these processes one has to be needless,
or nearly all slow variance has to be gone, by many jumps. Path and surplus are twice the logarithm of a ratio of two
likelihoods, which chance makes c with a probability of exp(-c / 2) at most (Markov's inequality).

The number of levels is that with the largest surplus. A hidden Markov chain of k levels has k^2 parameters: levels and
probabilities of jumps. Each beyond those of two levels costs log(n) (Schwarz), and the likeliest path stands for all
paths, as in the integrated completed likelihood.

A mean of several samples may lie between the levels before and after a jump.

Source  Kirton and Uren, Adv. Phys. 38 (1989), on single traps; Viterbi, IEEE Trans. Inform. Theory 13 (1967);
        Biernacki, Celeux and Govaert, IEEE Trans. Pattern Anal. 22 (2000), on the number of levels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import xlogy

from calibrations.criteria import (
    INTERVAL_STDS,
    JUMPS_PER_LEVEL,
    LEVELS_BETTER,
    MANY_JUMPS,
    MOST_BESIDE_LEVELS,
    MOST_LEVELS,
)
from calibrations.noise.fit import fit_effects, without_effects
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.lines import means_without
from calibrations.noise.record import Channel
from calibrations.noise.samples import FASTEST, hidden_in
from calibrations.table import Array
from calibrations.text import add_prefix, join_words, percent, rounded

TWO_LEVELS, SEVERAL_LEVELS = "two-levels", "several-levels"
WIDTHS = (1, 8, 64, 512)  # means over which levels are looked for
ROUNDS = 6  # of path and levels in turn
MOST_AT_ONCE = 0.1  # of the jumps: traps that depend on each other jump at once in a third
SHORTEST_DWELL = 3  # means of several samples: of stays shorter than a mean, one or two lie between levels
LEAST = 1e-6  # noise beside the levels, as a share of their distance: rounding
Path = NDArray[np.int64]


@dataclass(frozen=True)
class TelegraphLevel:
    """One level: its height above the lowest, its share of the time, and the mean time at it, s."""

    height: float
    share: float
    dwell_s: float


@dataclass(frozen=True)
class Telegraph:
    """The levels of one channel, lowest first, and the number of jumps between them.

    traps  heights of two independent traps of two levels that make these four; empty where they do not
    """

    axis: str
    unit: str
    levels: tuple[TelegraphLevel, ...]
    jumps: int
    traps: tuple[float, ...] = ()

    @property
    def kind(self) -> str:
        """The kind of this disturbance."""
        return TWO_LEVELS if len(self.levels) == 2 else SEVERAL_LEVELS

    @property
    def text(self) -> str:
        """The levels in words."""
        start = f"random telegraph noise (burst noise, popcorn): {self.axis} jumps between"
        if self.kind == TWO_LEVELS:
            return f"{start} {self._two_levels()}. Its spectrum is that of a Gauss-Markov process"
        return f"{start} {self._several_levels()}. Its spectrum is that of Gauss-Markov processes"

    def _two_levels(self) -> str:
        lower, upper = self.levels
        return (
            f"two levels {upper.height:.3g} {self.unit} apart, {self.jumps} times. It stays at the upper level for "
            f"{rounded(upper.dwell_s)} s and at the lower level for {rounded(lower.dwell_s)} s on average"
        )

    def _several_levels(self) -> str:
        factor, unit = add_prefix(self.unit, self.levels[-1].height)
        unit = unit.replace("µ", "u")
        above, traps = (
            join_words(rounded(height * factor) for height in heights)
            for heights in ([level.height for level in self.levels[1:]], self.traps)
        )
        dwells_s = join_words(rounded(level.dwell_s) for level in self.levels)
        shares = join_words(percent(level.share) for level in self.levels)
        pair = f". Two independent traps of {traps} {unit} make such levels" if self.traps else ""
        return (
            f"{len(self.levels)} levels, {self.jumps} times: the lowest, and {above} {unit} above it. In this order, "
            f"the mean time before the next jump is {dwells_s} s, and the share of the time is {shares}{pair}"
        )


def telegraph_of(fit: ChannelFit) -> Telegraph | None:
    """The levels of a channel; None where its processes explain it without them."""
    if hidden_in(fit.channel.oddities) is not None:
        return None  # rounding makes levels
    values, channel, slow = means_without(fit.channel, fit.lines), fit.channel, _of_means(fit.channel, fit)
    surplus, best, path = LEVELS_BETTER, None, None
    for count in range(2, MOST_LEVELS + 1):
        path = _best_path(values, count, channel.size, path)
        if path is None:
            continue
        rest = _of_means(replace(channel, means=values - _along(values, path, channel.size)), fit)
        price = _path_price(path, channel.size) + (count**2 - 4) * float(np.log(len(values)))
        gain = 2 * (rest.log_likelihood - slow.log_likelihood)
        if gain - price >= surplus:
            surplus, best = gain - price, (path, rest)
    return _telegraph(channel, values, best[0]) if best is not None and _explains(values, *best) else None


def _of_means(channel: Channel, fit: ChannelFit) -> ChannelFit:
    """The processes and lines of a fit, fitted to the means alone: spectra of what is faster hold the jumps."""
    start = without_effects(channel, fit.lines)
    return fit_effects(replace(start, parts=start.parts[:1]), fit.effects)


def _explains(values: Array, path: Path, rest: ChannelFit) -> bool:
    """Whether a path of levels explains the slow noise of values (n,); `rest` is the fit after the path is removed.

    It does if the correlation of neighbours nearly disappears, or if `rest` needs one slow process less. The first
    counts only with many jumps: the levels of a few jumps can be similar by chance.
    """
    before, after = (float(np.mean(each[1:] * each[:-1])) for each in (values, rest.channel.means))
    if after < MOST_BESIDE_LEVELS * before and np.count_nonzero(np.diff(path)) > MANY_JUMPS * (path.max() + 1):
        return True
    slow = [effect for effect in rest.effects if effect.name not in FASTEST]
    smaller = ([e for e in rest.effects if e is not effect] for effect in slow)
    return any(
        2 * (rest.log_likelihood - fit_effects(rest, effects).log_likelihood) < LEVELS_BETTER for effects in smaller
    )


def _telegraph(channel: Channel, values: Array, path: Path) -> Telegraph:
    levels = _levels(values, path, channel.size)
    order = np.argsort(levels)
    levels, path = levels[order], np.argsort(order)[path]
    counts, jumps = np.bincount(path), np.flatnonzero(np.diff(path))
    dwells_s = counts / np.bincount(path[np.append(jumps, -1)]) * channel.sampling.interval_s
    heights = levels - levels[0]
    found = zip(heights.tolist(), (counts / len(path)).tolist(), dwells_s.tolist(), strict=True)
    stds = np.std(values - _along(values, path, channel.size)) / np.sqrt(counts)
    traps = _two_traps(heights, stds, path)
    return Telegraph(channel.axis, channel.unit, tuple(TelegraphLevel(*each) for each in found), len(jumps), traps)


def _two_traps(heights: Array, stds: Array, path: Path) -> tuple[float, ...]:
    """Heights of two traps that make four levels: the highest is the sum, and both hardly jump at once."""
    if len(heights) != 4:
        return ()
    _, smaller, larger, both = heights.tolist()
    at_once = np.count_nonzero(path[:-1] + path[1:] == 3)
    is_sum = abs(both - larger - smaller) < INTERVAL_STDS * np.hypot.reduce(stds)
    return (smaller, larger) if is_sum and at_once < MOST_AT_ONCE * np.count_nonzero(np.diff(path)) else ()


def _best_path(values: Array, count: int, size: int, fewer: Path | None) -> Path | None:
    """The likeliest path between so many levels, in white noise; None where it hardly jumps.

    fewer  path of one level less, if there is one
    """
    spread = float(np.std(np.diff(values))) / 2**0.5
    if not spread > 0:
        return None
    starts = (start for start in _starts(values, count, fewer) if start[0][-1] > start[0][0])
    paths = (_direct(likeliest_path(values, levels, spread, jump_share), size) for levels, jump_share in starts)
    found = (path for path in paths if len(np.unique(path)) == count and (count == 2 or _is_resolved(path, size)))
    return min(found, key=lambda path: _path_price(path, size) + _path_deviance(values, path, size), default=None)


def _direct(path: Path, size: int) -> Path:
    """The path (n,), where a mean of several samples is at no level between that before and that after it."""
    if size > 1:
        between = np.flatnonzero((path[1:-1] - path[:-2]) * (path[2:] - path[1:-1]) > 0) + 1
        path[between] = path[between - 1]
    return path


def _is_resolved(path: Path, size: int) -> bool:
    """Whether a third level, or a further one, is no drift, and no means that lie between levels.

    Levels that follow a drift are not reached in both halves of the record. Means of several samples lie between levels
    where a stay is shorter than a mean.
    """
    first, second = np.array_split(path, 2)
    dwells = np.bincount(path) / np.bincount(path[np.append(np.flatnonzero(np.diff(path)), -1)])
    return np.array_equal(np.unique(first), np.unique(second)) and (size == 1 or dwells.min() >= SHORTEST_DWELL)


def _starts(values: Array, count: int, fewer: Path | None) -> Iterator[tuple[Array, float]]:
    """Levels (count,) to begin with, and the share of the values at which the path jumps.

    They are found in means of several widths, or are those of a path of one level less, of which one is split.
    """
    for width in WIDTHS:
        if width <= len(values):
            means = values[: len(values) // width * width].reshape(-1, width).mean(axis=1)
            yield nearest_levels(means, count), 1 / (16 * width)
    if fewer is None:
        return
    levels, jump_share = _levels(values, fewer, 1), np.count_nonzero(np.diff(fewer)) / len(fewer)
    for k, level in enumerate(levels):
        half = float(np.std(values[fewer == k]))
        yield np.sort([*np.delete(levels, k), level - half, level + half]), jump_share


def _levels(values: Array, path: Path, size: int) -> Array:
    """Mean values at each level (k,). Means of several samples beside a jump do not count, where others are left."""
    inner = np.ones(len(path), dtype=bool)
    if size > 1:
        jumps = np.flatnonzero(np.diff(path))
        inner[jumps] = inner[jumps + 1] = False
        inner |= np.isin(path, np.setdiff1d(path, path[inner]))
    return np.bincount(path[inner], weights=values[inner]) / np.bincount(path[inner])


def _along(values: Array, path: Path, size: int) -> Array:
    """The level at each value (n,), or what a mean of several samples beside a jump has between two levels."""
    levels = _levels(values, path, size)
    along = levels[path]
    if size == 1:
        return along
    after = np.flatnonzero(np.diff(path)) + 1
    before = along[after - 1]
    low, high = np.minimum(before, along[after]), np.maximum(before, along[after])
    early, late = (np.clip(values[at], low, high) for at in (after - 1, after))
    is_late = np.abs(late - along[after]) >= np.abs(early - before)
    along[np.where(is_late, after, after - 1)] = np.where(is_late, late, early)
    return along


def _path_price(path: Path, size: int) -> float:
    """Twice the negative logarithm of a path's probability, as a Markov chain that may jump at any sample of a mean."""
    count = int(path.max()) + 1
    kinds = np.bincount(count * path[:-1] + path[1:], minlength=count**2).reshape(count, count)
    chain = -2 * np.sum(xlogy(kinds, kinds / np.maximum(kinds.sum(axis=1, keepdims=True), 1)))
    return float(chain + 2 * np.count_nonzero(np.diff(path)) * np.log(size))


def _path_deviance(values: Array, path: Path, size: int) -> float:
    """Twice the negative log-likelihood of values about a path in white noise, but for a constant."""
    rounding = LEAST * np.ptp(_levels(values, path, size))
    return float(len(values) * np.log(np.var(values - _along(values, path, size)) + rounding**2))


@njit(cache=True, nogil=True)
def nearest_levels(means: Array, count: int) -> Array:
    """Levels (count,) of means (n,), lowest first: those of the nearest ones; all the same where there are fewer."""
    levels = np.linspace(means.min(), means.max(), count)
    for _ in range(ROUNDS):
        sums, counts = np.zeros(count), np.zeros(count)
        for value in means:
            level = 0
            while level < count - 1 and value > (levels[level] + levels[level + 1]) / 2:
                level += 1
            sums[level] += value
            counts[level] += 1
        if counts.min() == 0:
            return np.full(count, levels[0])
        levels = sums / counts
    return levels


@njit(cache=True, nogil=True)
def likeliest_path(values: Array, levels: Array, spread: float, jump_share: float) -> Path:
    """Path and levels in turn, shape (n,); empty where it jumps less than JUMPS_PER_LEVEL times for each level.

    levels      (k,) at first, lowest first
    spread      standard deviation of the noise beside the levels
    jump_share  share of the values at which the path jumps
    """
    n, count = len(values), len(levels)
    path, origins = np.zeros(n, dtype=np.int64), np.empty((n, count), dtype=np.int8)
    for _ in range(ROUNDS):
        jump_log_odds = np.log(jump_share / ((count - 1) * (1 - jump_share)))
        path_changes = viterbi(values, levels, 0.5 / spread**2, jump_log_odds, origins, path)
        times, visits, counts, sums = 0, np.zeros(count), np.zeros(count), np.zeros(count)
        for i in range(n):
            if i == 0 or path[i] != path[i - 1]:
                times += i > 0
                visits[path[i]] += 1
            counts[path[i]] += 1
            sums[path[i]] += values[i]
        if times < JUMPS_PER_LEVEL * count or visits.min() < JUMPS_PER_LEVEL:
            return path[:0]
        if not path_changes:
            break
        levels, jump_share = sums / counts, times / n
        square = 0.0
        for i in range(n):
            square += (values[i] - levels[path[i]]) ** 2
        spread = max(np.sqrt(square / n), LEAST * (levels.max() - levels.min()))
    return path


@njit(cache=True, nogil=True)
def viterbi(
    values: Array, levels: Array, precision: float, jump_log_odds: float, origins: NDArray[np.int8], path: Path
) -> bool:
    """Write the likeliest path of 0 .. k - 1 to `path` (n,), and return whether it changes.

    precision      a value's squared distance from a level, times this, is the logarithm of how much less likely it is
    jump_log_odds  the logarithm of how much more likely a jump to one other level is than none, between two values
    origins        (n, k) memory for the level that each level comes from
    """
    n, count = len(values), len(levels)
    scores = -precision * (values[0] - levels) ** 2
    for i in range(1, n):
        best = np.argmax(scores)
        jumped = scores[best] + jump_log_odds
        for level in range(count):
            jumps = jumped > scores[level]
            origins[i, level] = best if jumps else level
            scores[level] = (jumped if jumps else scores[level]) - precision * (values[i] - levels[level]) ** 2
    level, path_changes = int(np.argmax(scores)), False
    for i in range(n - 1, -1, -1):
        path_changes |= path[i] != level
        path[i] = level
        if i > 0:
            level = int(origins[i, level])
    return path_changes
