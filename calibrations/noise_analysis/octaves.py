"""Allan deviations at octave times in one pass over a record of any length, in constant memory.

Up to 32 samples every overlap is used. A longer time m is divided into 32 bins, and windows begin at each: for white
noise the variance of the estimate is 1.0012 times that of every overlap, for redder noise less. (Of a record whose
noise is that of its phase, such as quantisation alone, more overlap would tell more; `exact` has it.) The mean is no
part of any number that is kept: only what differs from the first block's is summed, and only over a few thousand bins.

Source  Greenhall, IEEE Trans. UFFC 50 (2003), on how little stride costs; NIST SP 1065, 5.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from calibrations.noise_analysis.freedom import freedom, interval
from calibrations.noise_analysis.kernels import (
    ALLAN,
    FACTORS,
    HADAMARD,
    MODIFIED,
    Tree,
    absorb,
    empty_tree,
    finish,
    reflected_squares,
)
from calibrations.noise_analysis.noise_type import noise_type
from calibrations.table import Array

BLOCK = 1 << 17  # samples that are taken at a time
KINDS: Mapping[str, tuple[int, float]] = MappingProxyType(  # kept squares, divisor
    {"overlapping": (ALLAN, 2.0), "modified": (MODIFIED, 2.0), "hadamard": (HADAMARD, 6.0), "total": (ALLAN, 2.0)}
)


@dataclass(frozen=True)
class Curve:
    """A deviation over averaging time; shapes (k,), in the unit of the values, intervals of 95 %."""

    kind: str
    tau_s: Array
    deviation: Array
    low: Array
    high: Array
    alpha: tuple[int, ...]  # the noise type at each time
    edf: Array


class Octaves:
    """What was seen of a record so far; blocks are added in order, `curve` is asked at the end.

    Differences of the third order, for modified and hadamard, take as long again: False leaves them out.
    """

    def __init__(self, rate_hz: float, third_order: bool = True) -> None:
        self._rate_hz = rate_hz
        self._third = third_order
        self._offset: float | None = None
        self._tree = empty_tree()
        self._whole: Tree | None = None

    def add(self, samples: Array) -> None:
        """The next samples, of any real type, shape (n,)."""
        for start in range(0, len(samples), BLOCK):
            part = np.ascontiguousarray(samples[start : start + BLOCK], dtype=np.float64)
            if self._offset is None:
                self._offset = float(part.mean())
            absorb(self._tree, part, self._offset, self._third)
        self._whole = None

    @property
    def n(self) -> int:
        """Samples so far."""
        return int(self._tree.seen[0])

    def curve(self, kind: str = "overlapping") -> Curve:
        """The deviation at 1, 2, 4 ... samples, as far as the record has two windows (hadamard: three)."""
        if self._whole is None:
            self._whole = deepcopy(self._tree)
            finish(self._whole, self._third)
        points = [_point(self._whole, kind, octave) for octave in range(self.n.bit_length())]
        rows = [point for point in points if point is not None]
        tau_s = np.array([2.0**octave for octave, _ in enumerate(rows)]) / self._rate_hz
        value, edf = (np.array([row[k] for row in rows], dtype=float) for k in (0, 1))
        bounds = np.array([interval(*row[:2]) for row in rows]).reshape(-1, 2)
        return Curve(kind, tau_s, value, bounds[:, 0], bounds[:, 1], tuple(row[2] for row in rows), edf)


def octaves(blocks: Iterable[Array], rate_hz: float, kind: str = "overlapping") -> Curve:
    """The curve of a record that comes in blocks, shape (n,) each."""
    seen = Octaves(rate_hz, KINDS[kind][0] != ALLAN)
    for block in blocks:
        seen.add(block)
    return seen.curve(kind)


def _point(tree: Tree, kind: str, octave: int) -> tuple[float, float, int] | None:
    """(deviation, degrees of freedom, noise type) at 2^octave samples; None where the record is too short."""
    level, factor = max(0, octave - FACTORS + 1), min(octave, FACTORS - 1)
    which, divisor = KINDS[kind]
    where = (level, factor if level == 0 else 0, which)
    number, total = int(tree.windows[where]), float(tree.squares[where])
    if not number:
        return None
    m, bins = 2.0**octave, 2**factor
    if kind == "total":
        total, number = total + _ends(tree, level, bins), int(tree.seen[level]) - 1
    variance = total / number / divisor / (m**4 if kind == "modified" else m**2)
    alpha = _alpha(tree, octave)
    return float(np.sqrt(variance)), freedom(kind, alpha, int(tree.seen[0]), int(m), bins), alpha


def _ends(tree: Tree, level: int, bins: int) -> float:
    """Squares of the windows that reach beyond the record's ends."""
    tail = tree.sums[level, : tree.filled[level]][::-1].copy()
    return reflected_squares(tree.heads[level], bins) + reflected_squares(tail, bins)


def _alpha(tree: Tree, octave: int) -> int:
    """The noise type at an averaging time: of the longest time up to it that can tell."""
    for level in range(octave, -1, -1):
        found = noise_type(int(tree.seen[level]), tree.moments[level])
        if found is not None:
            return found
    return 0
