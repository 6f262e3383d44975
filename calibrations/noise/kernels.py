"""Compiled loops: a tree of bins that double in size from level to level, and the differences that are squared on each.

A bin holds the sum of its samples less an offset, and the sum of the phase (their running sum, from the bin's start)
over its samples. Both of a pair give both of the bin on the next level, so that modified deviations need no more than
that. Differences of the second and third order do not depend on the offset, nor on where a running sum begins: each
stretch of a buffer has a running sum of its own, which stays small and so exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calibrations.table import Array

LEVELS = 48
OVERLAP = 32  # bins to an averaging time, above the first level
FACTORS = 6  # averaging times of the first level: 1, 2, 4 ... OVERLAP bins
TAIL = 3 * OVERLAP  # bins that later windows need
STEP = 2048
ROOM = TAIL + 2 * STEP
ALLAN, HADAMARD, MODIFIED = 0, 1, 2
Counts = NDArray[np.int64]


class Tree(NamedTuple):
    """The summary of all samples so far, of fixed size."""

    sums: Array  # (LEVELS, ROOM) bins that are still needed
    phases: Array  # (LEVELS, ROOM)
    filled: Counts  # (LEVELS,) bins in the buffers, of which
    measured: Counts  # were in windows before, and
    paired: Counts  # were given to the next level
    heads: Array  # (LEVELS, 2 OVERLAP) the first bins
    bin_counts: Counts  # (LEVELS,) bins in all
    squares: Array  # (LEVELS, FACTORS, 3) sums of squared differences: second order, third, third of summed phase
    windows: Counts  # (LEVELS, FACTORS, 3) how many
    moments: Array  # (LEVELS, 5) of bins z, and their differences w: z, z^2, z z', w^2, w w'


def empty_tree() -> Tree:
    """A tree without samples."""

    def floats(*shape: int) -> Array:
        return np.zeros((LEVELS, *shape))

    def counts(*shape: int) -> Counts:
        return np.zeros((LEVELS, *shape), dtype=np.int64)

    return Tree(
        floats(ROOM), floats(ROOM), counts(), counts(), counts(), floats(2 * OVERLAP), counts(),
        floats(FACTORS, 3), counts(FACTORS, 3), floats(5),
    )  # fmt: skip


@njit(cache=True, nogil=True)
def absorb(tree: Tree, samples: Array, offset: float, third: bool) -> None:
    """Add samples, less `offset`, which is the same in each call; `third`: with differences of the third order."""
    place = 0
    while place < len(samples):
        filled = tree.filled[0]
        count = min(TAIL + STEP - filled, len(samples) - place)
        tree.sums[0, filled : filled + count] = samples[place : place + count] - offset
        _count_bins(tree, 0, count)
        place += count
        level = 0
        while level < LEVELS - 1 and tree.filled[level] >= TAIL + STEP:
            _hand_up(tree, level, third)
            level += 1


@njit(cache=True, nogil=True)
def finish(tree: Tree, third: bool) -> None:
    """Measure the rest of the buffers; samples that fill no bin of a level are not used there."""
    for level in range(LEVELS - 1):
        _hand_up(tree, level, third)


@njit(cache=True, nogil=True)
def _count_bins(tree: Tree, level: int, count: int) -> None:
    """Count bins that were put into a buffer, and keep the very first."""
    filled = tree.filled[level]
    count_before = tree.bin_counts[level]
    lacks = max(0, min(count, 2 * OVERLAP - count_before))
    tree.heads[level, count_before : count_before + lacks] = tree.sums[level, filled : filled + lacks]
    tree.filled[level] += count
    tree.bin_counts[level] += count


@njit(cache=True, nogil=True)
def _hand_up(tree: Tree, level: int, third: bool) -> None:
    """Measure a level, give the next one its pairs, and keep the tail."""
    n, size = tree.filled[level], 2.0**level
    b, p = tree.sums[level], tree.phases[level]
    if n == tree.measured[level]:
        return
    _measure_second(tree, level)
    if third:
        _measure_third(tree, level)
    first, filled_above = tree.paired[level], tree.filled[level + 1]
    pairs = (n - first) // 2
    b0, b1 = b[first : first + 2 * pairs : 2], b[first + 1 : first + 2 * pairs : 2]
    p0, p1 = p[first : first + 2 * pairs : 2], p[first + 1 : first + 2 * pairs : 2]
    tree.sums[level + 1, filled_above : filled_above + pairs] = b0 + b1
    tree.phases[level + 1, filled_above : filled_above + pairs] = p0 + p1 + size * b0
    _count_bins(tree, level + 1, pairs)
    tail = min(TAIL, n)
    b[:tail] = b[n - tail : n].copy()
    p[:tail] = p[n - tail : n].copy()
    tree.filled[level] = tree.measured[level] = tail
    tree.paired[level] = tail - (n - first - 2 * pairs)


@njit(cache=True, nogil=True)
def _measure_second(tree: Tree, level: int) -> None:
    """Add up the squares over all windows of two that end in a new bin, and the moments of new bins."""
    n, old = tree.filled[level], tree.measured[level]
    b = tree.sums[level][:n]
    phase = running_sum(b, b.mean())
    for f in range(FACTORS if level == 0 else 1):
        k = 2**f if level == 0 else OVERLAP
        first = max(0, old - 2 * k + 1)
        tree.squares[level, f, ALLAN] += second_order(phase, k, first)
        tree.windows[level, f, ALLAN] += max(0, n - 2 * k + 1 - first)
    _add_moments(b, old, tree.moments[level])


@njit(cache=True, nogil=True)
def _measure_third(tree: Tree, level: int) -> None:
    """Add up the squares over all windows of three that end in a new bin."""
    n, old = tree.filled[level], tree.measured[level]
    phase, summed = integrals(tree.sums[level][:n], tree.phases[level][:n], 2.0**level)
    for f in range(FACTORS if level == 0 else 1):
        k = 2**f if level == 0 else OVERLAP
        first = max(0, old - 3 * k + 1)
        tree.squares[level, f, HADAMARD] += third_order(phase, k, first)
        tree.squares[level, f, MODIFIED] += third_order(summed, k, first)
        tree.windows[level, f, HADAMARD] += max(0, n - 3 * k + 1 - first)
        tree.windows[level, f, MODIFIED] += max(0, n - 3 * k + 1 - first)


@njit(cache=True, nogil=True)
def running_sum(b: Array, mean: float) -> Array:
    """Running sum of bins less their mean, shape (n + 1,), starting with 0."""
    phase = np.zeros(len(b) + 1)
    x = 0.0
    for i in range(len(b)):
        x += b[i] - mean
        phase[i + 1] = x
    return phase


@njit(cache=True, nogil=True)
def integrals(b: Array, p: Array, size: float) -> tuple[Array, Array]:
    """Running sums of bins less their mean, and of the phase over all samples, each shape (n + 1,) from 0."""
    n = len(b)
    mean = b.mean()
    mean_phase = mean * (size - 1.0) / 2.0  # what the mean adds to the phase within a bin
    phase, summed = np.zeros(n + 1), np.zeros(n + 1)
    x = c = 0.0
    for i in range(n):
        c += p[i] - mean_phase + size * x
        x += b[i] - mean
        phase[i + 1] = x
        summed[i + 1] = c
    return phase, summed


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def second_order(x: Array, k: int, first: int) -> float:
    """Sum of (x[i + 2k] - 2 x[i + k] + x[i])^2 over i from `first`."""
    total, n = 0.0, max(0, len(x) - 2 * k - first)
    x0, x1, x2 = x[first : first + n], x[first + k : first + k + n], x[first + 2 * k : first + 2 * k + n]
    for i in range(n):
        d = x2[i] - 2.0 * x1[i] + x0[i]
        total += d * d
    return total


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def third_order(x: Array, k: int, first: int) -> float:
    """Sum of (x[i + 3k] - 3 x[i + 2k] + 3 x[i + k] - x[i])^2 over i from `first`."""
    total, n = 0.0, max(0, len(x) - 3 * k - first)
    x0, x1 = x[first : first + n], x[first + k : first + k + n]
    x2, x3 = x[first + 2 * k : first + 2 * k + n], x[first + 3 * k : first + 3 * k + n]
    for i in range(n):
        d = (x3[i] - x0[i]) - 3.0 * (x2[i] - x1[i])
        total += d * d
    return total


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _add_moments(z: Array, old: int, moments: Array) -> None:
    """Sums over the bins from `old` on and their differences w, with their neighbours before."""
    a = b = c = d = e = 0.0
    new = z[old:]
    for i in range(len(new)):
        a += new[i]
        b += new[i] * new[i]
    start = max(old, 1)
    current, preceding = z[start:], z[start - 1 : -1]
    for i in range(len(current)):
        c += current[i] * preceding[i]
        d += (current[i] - preceding[i]) ** 2
    start = max(old, 2)
    current, preceding, earlier = z[start:], z[start - 1 : -1], z[start - 2 : -2]
    for i in range(len(current)):
        e += (current[i] - preceding[i]) * (preceding[i] - earlier[i])
    moments += np.array((a, b, c, d, e))


@njit(cache=True, nogil=True)
def reflected_squares(b: Array, k: int) -> float:
    """Sum of squared differences of sums over `k` bins around each of the first k - 1 inner points.

    Before the first bin the record is extended by its mirror image, as for the total deviation. b (2k,) or more.
    """
    total = 0.0
    right, sum_left = np.sum(b[1 : k + 1]), b[0] + np.sum(b[: k - 1])
    for i in range(1, k):  # `right` is the sum of b[i : i + k], `left` that of the k bins before i
        total += (right - sum_left) ** 2
        right += b[i + k] - b[i]
        sum_left += b[i] - b[k - 1 - i]
    return total


@njit(cache=True, nogil=True)
def matched_sums(forms: Array, weighted: Array, weight: Array) -> tuple[Array, Array]:
    """Weighted products (g,) of forms (g, k) with data, which come times their weights (k,), and with themselves."""
    tops, bottoms = np.empty(len(forms)), np.empty(len(forms))
    for g in range(len(forms)):
        top = bottom = 0.0
        for k in range(len(weight)):
            top += forms[g, k] * weighted[k]
            bottom += forms[g, k] ** 2 * weight[k]
        tops[g], bottoms[g] = top, bottom
    return tops, bottoms


@njit(cache=True, nogil=True)
def play(values: Array, width: float) -> Array:
    """The branch (n,) of a hysteresis: 1/2 where values (n,) have risen by `width`, -1/2 where they have fallen."""
    branch, state = np.empty_like(values), 0.0
    for i in range(len(values)):
        if i:
            state += (values[i] - values[i - 1]) / width
        state = min(max(state, -0.5), 0.5)
        branch[i] = state
    return branch


@njit(cache=True, nogil=True)
def first_order_lag(values: Array, steps: float) -> Array:
    """Values (n,) through a first-order lag with a time constant of so many steps, settled at the first value."""
    share = 1.0 - np.exp(-1.0 / steps)
    lagged, state = np.empty_like(values), values[0]
    for i in range(len(values)):
        state += share * (values[i] - state)
        lagged[i] = state
    return lagged
