"""Single samples that are far from those before and after them: a bad packet, a spark, a knock.

A sample is wild where it is off on the same side from the median of the three before it and from that of the three
after it: the edge of a step is not. How far noise goes is told by the ninth decile of the distances, which a few wild
samples do not move; where they are not few, they are how this noise is distributed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.table import Array

PART = 4096  # samples whose scale is common
SIDE = 3  # samples to each side
FEWEST = 256  # samples that have a scale of their own
DECILE, NORMAL = 0.9, 1.6449  # and where it is in a normal distribution, in standard deviations
FAR = 12.0  # standard deviations: beyond it normal noise has no sample in a lifetime, and Laplacian one of 10^7
MOST = 1e-3  # of all samples, to be called single


@dataclass(frozen=True)
class Wild:
    """How many samples are wild, the first and the wildest of them (numbers from 0), by how many standard deviations
    that one is off, and what their squares come to, in the square of the values' unit."""

    count: int = 0
    first: int = 0
    wildest: int = 0
    deviations: float = 0.0
    power: float = 0.0


class Outliers:
    """What was seen so far; blocks are added in order, `found` is asked at the end."""

    def __init__(self) -> None:
        self._waiting = np.empty(0)
        self._before = 0  # number of the first sample that waits
        self._judged = 0
        self._scale = 0.0
        self._wild = Wild()

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        waiting = np.concatenate([self._waiting, samples])
        while len(waiting) >= PART + 2 * SIDE:
            if not self._judged:  # the record goes on as its mirror image, at both ends
                waiting = np.concatenate([waiting[SIDE:0:-1], waiting])
                self._before = -SIDE
            self._judge(waiting[: PART + 2 * SIDE])
            waiting, self._before = waiting[PART:], self._before + PART
        self._waiting = waiting

    def found(self) -> Wild:
        """Of all samples."""
        rest = self._waiting
        if len(rest) > 2 * SIDE:
            head = rest[SIDE:0:-1] if not self._judged else rest[:0]
            self._before -= len(head)
            self._judge(np.concatenate([head, rest, rest[-2 : -2 - SIDE : -1]]))
            self._waiting = rest[:0]
        return self._wild if self._wild.count <= max(1, int(MOST * self._judged)) else Wild()

    def _judge(self, part: Array) -> None:
        """All but the outer samples of a part."""
        middle = part[SIDE:-SIDE]
        left, right = middle - _median(part, 0), middle - _median(part, SIDE + 1)
        if len(middle) >= FEWEST or not self._scale:
            self._scale = float(np.quantile(np.abs(left), DECILE)) / NORMAL
        off = np.where(np.sign(left) == np.sign(right), np.minimum(np.abs(left), np.abs(right)), 0.0)
        wild = np.flatnonzero(off > FAR * self._scale)
        if len(wild) and self._scale > 0:
            self._note(self._before + SIDE + wild, off[wild])
        self._judged += len(middle)

    def _note(self, at: NDArray[np.intp], off: Array) -> None:
        was, worst = self._wild, int(np.argmax(off))
        deviations = float(off[worst]) / self._scale
        wildest = (int(at[worst]), deviations) if deviations > was.deviations else (was.wildest, was.deviations)
        first = was.first if was.count else int(at[0])
        self._wild = Wild(was.count + len(at), first, *wildest, was.power + float(np.sum(off**2)))


def _median(part: Array, start: int) -> Array:
    """Of the three samples from `start` on, for each of the middle ones."""
    n = len(part) - 2 * SIDE
    a, b, c = (part[start + k : start + k + n] for k in range(SIDE))
    return np.asarray(np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c)))
