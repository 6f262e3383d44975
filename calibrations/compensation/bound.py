"""Contraction of the inverse, proved over the whole range by interval arithmetic.

    a <- a + C (V - G(a)),   from a = 0        C: the inverse of dG/da at 0 g, in the middle of the other inputs

G is the model from specific force to output. For each box of the range, interval arithmetic bounds the slopes of this
step, 1 - C G'(a); p is the greatest row sum of their magnitudes on the range +-r. A true a in it is a fixed point, and
the first step from 0 ends within p r of a. q is the same on the range widened by p: no later step leaves that range,
and each reduces the error by q < 1 (Banach). So n steps leave less than q^n r in the maximum norm, for any stored
history.

Source  Krawczyk, Computing 4 (1969); Moore, Kearfott and Cloud (2009), chapter 8.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.compensation.graph import OPERATIONS, Node, Table, sort_nodes, variable_names
from calibrations.table import Array

# Values and slopes of a graph over a range: interval arithmetic, rounded outwards.
#
# A value is a pair of arrays (low, high), one entry for each box of the range; its slopes are such pairs with a row
# for each variable, by the rules of derivatives. Where a function has a corner both slopes are in the interval, so
# that the mean value theorem holds (Clarke); where it jumps the slope is without bound.
#
# Source  Moore, Kearfott and Cloud, Introduction to Interval Analysis (2009), chapters 2, 5 and 6.

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Interval:
    """Bounds, each of any one shape."""

    low: Array
    high: Array

    def __add__(self, term: Interval) -> Interval:
        return _outward(self.low + term.low, self.high + term.high)

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, term: Interval) -> Interval:
        return self + -term

    def __mul__(self, factor: Interval) -> Interval:
        with np.errstate(invalid="ignore"):
            products = [
                np.nan_to_num(x * y, nan=0.0, posinf=np.inf, neginf=-np.inf) for x in self.ends for y in factor.ends
            ]
        return _outward(np.minimum.reduce(products), np.maximum.reduce(products))

    def __truediv__(self, divisor: Interval) -> Interval:
        with np.errstate(divide="ignore"):
            inverse = _outward(1 / divisor.high, 1 / divisor.low)
        spans_zero = (divisor.low <= 0) & (divisor.high >= 0)
        endless = Interval(np.where(spans_zero, -np.inf, inverse.low), np.where(spans_zero, np.inf, inverse.high))
        return self * endless

    @property
    def ends(self) -> tuple[Array, Array]:
        return self.low, self.high

    @property
    def magnitude(self) -> Array:
        """The greatest absolute value."""
        return np.asarray(np.maximum(np.abs(self.low), np.abs(self.high)))

    @property
    def zero(self) -> Flags:
        """Flags of the points where the interval is exactly 0."""
        return np.asarray((self.low == 0) & (self.high == 0))

    def monotone(self, name: str) -> Interval:
        """An increasing function of the interval."""
        with np.errstate(all="ignore"):
            return _outward(*(np.asarray(OPERATIONS[name].apply(end)) for end in (self.low, self.high)))


def point_interval(values: Array) -> Interval:
    """Known numbers as intervals."""
    return Interval(values, values)


def evaluate_interval(
    roots: Iterable[Node], ranges: Mapping[str, Interval], variables: tuple[str, ...]
) -> list[tuple[Interval, Interval]]:
    """Values of each root, shape (boxes,), and slopes by the `variables`, shape (len(variables), boxes)."""
    roots = list(roots)
    n = np.shape(next(iter(ranges.values())).low)
    values: dict[Node, tuple[Interval, Interval]] = {}
    for node in sort_nodes(roots):
        if node.operation == "given":
            unit_slope = np.array([float(name == node.name) for name in variables]).reshape(-1, *(1 for _ in n))
            values[node] = ranges[node.name], point_interval(np.broadcast_to(unit_slope, (len(variables), *n)).copy())
        elif node.constant:
            values[node] = point_interval(np.full(n, node.value)), point_interval(np.zeros((len(variables), *n)))
        elif node.table is not None:
            values[node] = _bound_table(node.table, values[node.inner[0]])
        else:
            values[node] = _bound_function(node.operation, *(values[inner] for inner in node.inner))
    return [values[root] for root in roots]


Pair = tuple[Interval, Interval]


def _bound_table(table: Table, inner: Pair) -> Pair:
    x, dx = inner
    low, high, least, most = table.bounds(x.low, x.high)
    return _outward(low, high), _outward(least, most) * dx


def _bound_function(name: str, *inner: Pair) -> Pair:
    (x, dx), *more = inner
    match name:
        case "+":
            ((y, dy),) = more
            return x + y, dx + dy
        case "-":
            ((y, dy),) = more
            return x - y, dx - dy
        case "*":
            ((y, dy),) = more
            return (_square(x) if inner[0] is inner[1] else x * y), dx * y + x * dy
        case "/":
            ((y, dy),) = more
            ratio = x / y
            return ratio, (dx - ratio * dy) / y
        case "neg":
            return -x, -dx
        case "min" | "max":
            return _extreme(name, (x, dx), more[0])
        case "abs":
            return _extreme("max", (x, dx), (-x, -dx))
        case "where":
            return _choose((x, dx), *more)
        case "exp":
            value = x.monotone("exp")
            return value, value * dx
        case "tanh":
            value = x.monotone("tanh")
            return value, (point_interval(np.ones(value.low.shape)) - _square(value)) * dx
        case "log":
            domain = Interval(np.where(x.low > 0, x.low, np.nan), x.high)
            return _without_nan(domain.monotone("log")), dx / x
        case "sqrt":
            domain = Interval(np.where(x.low >= 0, x.low, np.nan), x.high)
            value = _without_nan(domain.monotone("sqrt"))
            return value, dx / (value + value)
        case "sin":
            return _wave(x), _wave(x, np.pi / 2) * dx
        case "cos":
            return _wave(x, np.pi / 2), -_wave(x) * dx
    return _bound_step(name, inner)


def _outward(low: Array, high: Array) -> Interval:
    """The interval widened by two units in the last place, for rounding."""
    return Interval(_next(_next(low, -np.inf), -np.inf), _next(_next(high, np.inf), np.inf))


def _next(value: Array, towards: float) -> Array:
    """The next number; an exact 0 stays 0, so that a product with 0 is 0."""
    return np.where(value == 0, value, np.nextafter(value, towards))


def _square(x: Interval) -> Interval:
    ends = np.array([x.low**2, x.high**2])
    return _outward(np.where((x.low <= 0) & (x.high >= 0), 0.0, ends.min(axis=0)), ends.max(axis=0))


def _pick(first: Flags, second: Flags, x: Interval, y: Interval) -> Interval:
    """x where the first flag is sure, y where the second is, else their hull."""
    hull = Interval(np.minimum(x.low, y.low), np.maximum(x.high, y.high))
    low = np.where(first, x.low, np.where(second, y.low, hull.low))
    return Interval(low, np.where(first, x.high, np.where(second, y.high, hull.high)))


def _extreme(name: str, first: Pair, second: Pair) -> Pair:
    (x, dx), (y, dy) = first, second
    if name == "min":
        return (
            Interval(np.minimum(x.low, y.low), np.minimum(x.high, y.high)),
            _pick(x.high < y.low, y.high < x.low, dx, dy),
        )
    return (
        Interval(np.maximum(x.low, y.low), np.maximum(x.high, y.high)),
        _pick(x.low > y.high, y.low > x.high, dx, dy),
    )


def _choose(condition: Pair, yes: Pair, no: Pair) -> Pair:
    """A choice between two values: the slopes of both; unbounded where the condition depends on the variables."""
    c, dc = condition
    surely, surely_not = (c.low > 0) | (c.high < 0), c.zero
    value = _pick(surely, surely_not, yes[0], no[0])
    slopes = _pick(surely, surely_not, yes[1], no[1])
    jumps = ~(surely | surely_not) & ~dc.zero.all(axis=0)
    return value, Interval(np.where(jumps, -np.inf, slopes.low), np.where(jumps, np.inf, slopes.high))


def _bound_step(name: str, inner: tuple[Pair, ...]) -> Pair:
    """Comparisons and signs: slope 0, but unbounded where the result depends on the variables."""
    (x, dx), (y, dy) = (
        inner
        if len(inner) == 2
        else (inner[0], (point_interval(0 * inner[0][0].low), point_interval(0 * inner[0][1].low)))
    )
    apply = OPERATIONS[name].apply
    ends = [np.asarray(apply(p, q) if len(inner) == 2 else apply(p), float) for p in x.ends for q in y.ends]
    disjoint = (x.high < y.low) | (y.high < x.low)
    least = -1.0 if name == "sign" else 0.0
    low = np.where(disjoint, np.minimum.reduce(ends), least)
    high = np.where(disjoint, np.maximum.reduce(ends), 1.0)
    jumps = ~disjoint & ~(dx.zero & dy.zero).all(axis=0)
    flat = np.zeros_like(dx.low)
    return Interval(low, high), Interval(np.where(jumps, -np.inf, flat), np.where(jumps, np.inf, flat))


def _wave(x: Interval, phase: float = 0.0) -> Interval:
    """The sine of x + `phase`."""
    low, high = x.low + phase, x.high + phase
    ends = np.array([np.sin(low), np.sin(high)])
    turns = {
        k: np.floor((high - k * np.pi / 2) / (2 * np.pi)) >= np.ceil((low - k * np.pi / 2) / (2 * np.pi))
        for k in (1, -1)
    }
    wide = _outward(ends.min(axis=0), ends.max(axis=0))
    return Interval(np.where(turns[-1], -1.0, wide.low - 1e-15), np.where(turns[1], 1.0, wide.high + 1e-15))


def _without_nan(x: Interval) -> Interval:
    """The interval, unbounded where an end is not a number."""
    is_undefined = np.isnan(x.low) | np.isnan(x.high)
    return Interval(np.where(is_undefined, -np.inf, x.low), np.where(is_undefined, np.inf, x.high))


BOXES_PER_AXIS, BOXES_PER_INPUT, MOST_BOXES = 8, 4, 4_000
MOST_STEPS = 200
UNBOUNDED = (-math.inf, math.inf)
SMALLEST_FACTOR = 1e-12  # below it the model is a straight line, and one step suffices


@dataclass(frozen=True)
class Bound:
    """`q`: proved error reduction of a step; `steps`: number of steps with a remaining error below `within`.

    `C` has shape (axes, axes), in g per unit of output.
    """

    C: Array
    q: float
    steps: int
    within: float


def prove_bound(
    outputs: Sequence[Node],
    unknowns: tuple[str, ...],
    reach: float,
    inputs: Mapping[str, tuple[float, float]],
    want: float,
    memory: tuple[str, ...] = (),
) -> Bound | None:
    """The bound for true values of `unknowns` within +-`reach` and of `inputs` within their ranges.

    None where the contraction cannot be proved.
    """
    inputs = {name: inputs[name] for name in variable_names(outputs) if name not in {*unknowns, *memory}}
    inputs |= dict.fromkeys(memory, UNBOUNDED)
    slopes = _slopes_in_the_middle(outputs, unknowns, inputs)
    if not np.isfinite(slopes).all() or abs(np.linalg.det(slopes / (np.max(np.abs(slopes)) or 1.0))) < 1e-9:
        return None
    C = np.asarray(np.linalg.inv(slopes), dtype=np.float64)
    first = _greatest_values(outputs, unknowns, reach, inputs, C)
    q = _greatest_values(outputs, unknowns, (1 + first) * reach, inputs, C) if first < 1 else first
    if not q < 1:
        return None
    steps = max(1, math.ceil(math.log(want / reach) / math.log(max(q, SMALLEST_FACTOR))))
    return Bound(C, q, steps, q**steps * reach) if steps <= MOST_STEPS else None


def _slopes_in_the_middle(
    outputs: Sequence[Node], unknowns: tuple[str, ...], inputs: Mapping[str, tuple[float, float]]
) -> Array:
    """d output / d a at 0 g, shape (axes, axes)."""
    point = {name: point_interval(np.zeros(1)) for name in unknowns}
    point |= {name: _middle(ends) for name, ends in inputs.items()}
    results = evaluate_interval(outputs, point, unknowns)
    with np.errstate(invalid="ignore"):  # of a jump at 0: no number
        return np.array([(d.low[:, 0] + d.high[:, 0]) / 2 for _, d in results])


def _middle(ends: tuple[float, float]) -> Interval:
    """The middle of a range; an unbounded range stays unbounded."""
    low, high = ends if ends == UNBOUNDED else (sum(ends) / 2, sum(ends) / 2)
    return Interval(np.array([low]), np.array([high]))


def _greatest_values(
    outputs: Sequence[Node],
    unknowns: tuple[str, ...],
    reach: float,
    inputs: Mapping[str, tuple[float, float]],
    C: Array,
) -> float:
    """The greatest row sum of |1 - C G'| over the boxes of the range."""
    ranges = _boxes(dict.fromkeys(unknowns, (-reach, reach)), inputs)
    slopes = [d for _, d in evaluate_interval(outputs, ranges, unknowns)]
    boxes = slopes[0].low.shape[1]
    worst = np.zeros(boxes)
    for i in range(len(unknowns)):
        row = np.zeros(boxes)
        for j in range(len(unknowns)):
            entry = point_interval(np.full(boxes, float(i == j)))
            for k, d in enumerate(slopes):
                entry = entry - point_interval(np.full(boxes, C[i, k])) * Interval(d.low[j], d.high[j])
            row += entry.magnitude
        worst = np.maximum(worst, row)
    return float(np.max(worst)) if np.isfinite(worst).all() else math.inf


def _boxes(
    unknowns: Mapping[str, tuple[float, float]], inputs: Mapping[str, tuple[float, float]]
) -> dict[str, Interval]:
    """The range divided into boxes: every combination of parts of the bounded variables."""
    endless = [name for name, ends in inputs.items() if ends == UNBOUNDED]
    inputs = {name: ends for name, ends in inputs.items() if name not in endless}
    parts = [BOXES_PER_AXIS] * len(unknowns) + [BOXES_PER_INPUT] * len(inputs)
    while math.prod(parts) > MOST_BOXES:
        parts = [max(1, n // 2) for n in parts]
    ranges = {**unknowns, **inputs}
    cuts = [np.linspace(low, high, n + 1) for (low, high), n in zip(ranges.values(), parts, strict=True)]
    lows = np.meshgrid(*(edges[:-1] for edges in cuts), indexing="ij")
    highs = np.meshgrid(*(edges[1:] for edges in cuts), indexing="ij")
    boxes = {name: Interval(low.ravel(), high.ravel()) for name, low, high in zip(ranges, lows, highs, strict=True)}
    n = math.prod(parts)
    return boxes | {name: Interval(np.full(n, -math.inf), np.full(n, math.inf)) for name in endless}
