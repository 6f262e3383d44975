"""How fast the way back closes in on the specific force, proved over the whole range.

    a <- a + C (V - G(a)),   from a = 0        C: the inverse of dG/da at 0 g, in the middle of what else is given

G is the model from specific force to output. For each box of the range the slopes of this step, 1 - C G'(a), are
bounded by interval arithmetic; the greatest row sum of their magnitudes is p on the range +-r itself. A true a within
it is a fixed point, and the way from 0 to it lies within: the first step comes within p r of a. With q the same on the
range made wider by p, no later step leaves that, and each comes nearer by the factor q < 1 (Banach): n steps leave less
than q^n r, in the maximum norm. What is remembered from earlier samples may be anything.

Source  Krawczyk, Computing 4 (1969); Moore, Kearfott and Cloud (2009), chapter 8.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.compensation.graph import Node, names
from calibrations.compensation.interval import Interval, over, point
from calibrations.table import Array

PARTS, PARTS_OF_OTHERS, MOST_BOXES = 8, 4, 4_000
MOST_STEPS = 200
ANYTHING = (-math.inf, math.inf)
SMALL = 1e-12  # a factor below is that of a straight line, and one step is enough


@dataclass(frozen=True)
class Bound:
    """`q` is the factor by which each step comes nearer, `steps` how many leave less than `within`, both proved.

    `C` has shape (axes, axes), in g per unit of output.
    """

    C: Array
    q: float
    steps: int
    within: float


def bound(
    outputs: Sequence[Node],
    sought: tuple[str, ...],
    reach: float,
    others: Mapping[str, tuple[float, float]],
    want: float,
    memory: tuple[str, ...] = (),
) -> Bound | None:
    """The bound for a true value of each of `sought` within +-`reach` and of `others` within their ranges.

    None where the steps cannot be shown to close in.
    """
    others = {name: others[name] for name in names(outputs) if name not in {*sought, *memory}}
    others |= dict.fromkeys(memory, ANYTHING)
    slopes = _slopes_in_the_middle(outputs, sought, others)
    if not np.isfinite(slopes).all() or abs(np.linalg.det(slopes / (np.max(np.abs(slopes)) or 1.0))) < 1e-9:
        return None
    C = np.asarray(np.linalg.inv(slopes), dtype=np.float64)
    first = _greatest(outputs, sought, reach, others, C)
    q = _greatest(outputs, sought, (1 + first) * reach, others, C) if first < 1 else first
    if not q < 1:
        return None
    steps = max(1, math.ceil(math.log(want / reach) / math.log(max(q, SMALL))))
    return Bound(C, q, steps, q**steps * reach) if steps <= MOST_STEPS else None


def _slopes_in_the_middle(
    outputs: Sequence[Node], sought: tuple[str, ...], others: Mapping[str, tuple[float, float]]
) -> Array:
    """d output / d a at 0 g, shape (axes, axes)."""
    at = {name: point(np.zeros(1)) for name in sought}
    at |= {name: _middle(ends) for name, ends in others.items()}
    found = over(outputs, at, sought)
    with np.errstate(invalid="ignore"):  # of a jump at 0: no number
        return np.array([(d.low[:, 0] + d.high[:, 0]) / 2 for _, d in found])


def _middle(ends: tuple[float, float]) -> Interval:
    """Of a range; of anything there is none."""
    low, high = ends if ends == ANYTHING else (sum(ends) / 2, sum(ends) / 2)
    return Interval(np.array([low]), np.array([high]))


def _greatest(
    outputs: Sequence[Node], sought: tuple[str, ...], reach: float, others: Mapping[str, tuple[float, float]], C: Array
) -> float:
    """The greatest row sum of |1 - C G'| over the boxes that the range is cut into."""
    ranges = _boxes(dict.fromkeys(sought, (-reach, reach)), others)
    slopes = [d for _, d in over(outputs, ranges, sought)]
    boxes = slopes[0].low.shape[1]
    worst = np.zeros(boxes)
    for i in range(len(sought)):
        row = np.zeros(boxes)
        for j in range(len(sought)):
            entry = point(np.full(boxes, float(i == j)))
            for k, d in enumerate(slopes):
                entry = entry - point(np.full(boxes, C[i, k])) * Interval(d.low[j], d.high[j])
            row += entry.magnitude
        worst = np.maximum(worst, row)
    return float(np.max(worst)) if np.isfinite(worst).all() else math.inf


def _boxes(sought: Mapping[str, tuple[float, float]], others: Mapping[str, tuple[float, float]]) -> dict[str, Interval]:
    """The range cut into boxes, every combination of parts of each variable that has ends."""
    endless = [name for name, ends in others.items() if ends == ANYTHING]
    others = {name: ends for name, ends in others.items() if name not in endless}
    parts = [PARTS] * len(sought) + [PARTS_OF_OTHERS] * len(others)
    while math.prod(parts) > MOST_BOXES:
        parts = [max(1, n // 2) for n in parts]
    everything = {**sought, **others}
    cuts = [np.linspace(low, high, n + 1) for (low, high), n in zip(everything.values(), parts, strict=True)]
    lows = np.meshgrid(*(cut[:-1] for cut in cuts), indexing="ij")
    highs = np.meshgrid(*(cut[1:] for cut in cuts), indexing="ij")
    boxes = {name: Interval(low.ravel(), high.ravel()) for name, low, high in zip(everything, lows, highs, strict=True)}
    n = math.prod(parts)
    return boxes | {name: Interval(np.full(n, -math.inf), np.full(n, math.inf)) for name in endless}
