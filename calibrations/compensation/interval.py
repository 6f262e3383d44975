"""What a graph can come to over a range, and how steeply: interval arithmetic, rounded outwards.

A value is a pair of arrays (low, high), one entry for each box of the range; its slopes are such pairs with a row for
each variable, by the rules of derivatives. Where a function has a corner both slopes are in the interval, so that the
mean value theorem holds (Clarke); where it jumps the slope is without bound.

Source  Moore, Kearfott and Cloud, Introduction to Interval Analysis (2009), chapters 2, 5 and 6.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.compensation.graph import Node, ordered
from calibrations.compensation.operations import OPERATIONS
from calibrations.table import Array

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Interval:
    """Bounds, each of any one shape."""

    low: Array
    high: Array

    def __add__(self, other: Interval) -> Interval:
        return _outward(self.low + other.low, self.high + other.high)

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Interval) -> Interval:
        return self + -other

    def __mul__(self, other: Interval) -> Interval:
        with np.errstate(invalid="ignore"):
            each = [np.nan_to_num(x * y, nan=0.0, posinf=np.inf, neginf=-np.inf) for x in self.ends for y in other.ends]
        return _outward(np.minimum.reduce(each), np.maximum.reduce(each))

    def __truediv__(self, other: Interval) -> Interval:
        with np.errstate(divide="ignore"):
            inverse = _outward(1 / other.high, 1 / other.low)
        across = (other.low <= 0) & (other.high >= 0)
        endless = Interval(np.where(across, -np.inf, inverse.low), np.where(across, np.inf, inverse.high))
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
        """Where it is 0 and nothing else."""
        return np.asarray((self.low == 0) & (self.high == 0))

    def monotone(self, name: str) -> Interval:
        """A function that only grows."""
        with np.errstate(all="ignore"):
            return _outward(*(np.asarray(OPERATIONS[name].apply(end)) for end in (self.low, self.high)))


def point(values: Array) -> Interval:
    """Numbers that are known."""
    return Interval(values, values)


def over(roots: Iterable[Node], ranges: Mapping[str, Interval], by: tuple[str, ...]) -> list[tuple[Interval, Interval]]:
    """Each root's values, shape (boxes,), and its slopes by the variables `by`, shape (len(by), boxes)."""
    roots = list(roots)
    n = np.shape(next(iter(ranges.values())).low)
    found: dict[Node, tuple[Interval, Interval]] = {}
    for node in ordered(roots):
        if node.operation == "given":
            own = np.array([float(name == node.name) for name in by]).reshape(-1, *(1 for _ in n))
            found[node] = ranges[node.name], point(np.broadcast_to(own, (len(by), *n)).copy())
        elif node.constant:
            found[node] = point(np.full(n, node.value)), point(np.zeros((len(by), *n)))
        else:
            found[node] = _applied(node.operation, *(found[inner] for inner in node.inner))
    return [found[root] for root in roots]


Pair = tuple[Interval, Interval]


def _applied(name: str, *inner: Pair) -> Pair:
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
            return (_squared(x) if inner[0] is inner[1] else x * y), dx * y + x * dy
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
            return _chosen((x, dx), *more)
        case "exp":
            value = x.monotone("exp")
            return value, value * dx
        case "log":
            real = Interval(np.where(x.low > 0, x.low, np.nan), x.high)
            return _known(real.monotone("log")), dx / x
        case "sqrt":
            real = Interval(np.where(x.low >= 0, x.low, np.nan), x.high)
            value = _known(real.monotone("sqrt"))
            return value, dx / (value + value)
        case "sin":
            return _wave(x), _wave(x, np.pi / 2) * dx
        case "cos":
            return _wave(x, np.pi / 2), -_wave(x) * dx
    return _stepped(name, inner)


def _outward(low: Array, high: Array) -> Interval:
    """Wider by what rounding can take, two units in the last place."""
    return Interval(_next(_next(low, -np.inf), -np.inf), _next(_next(high, np.inf), np.inf))


def _next(value: Array, to: float) -> Array:
    """The next number, but of an exact 0: what is multiplied by nothing stays nothing."""
    return np.where(value == 0, value, np.nextafter(value, to))


def _squared(x: Interval) -> Interval:
    ends = np.array([x.low**2, x.high**2])
    return _outward(np.where((x.low <= 0) & (x.high >= 0), 0.0, ends.min(axis=0)), ends.max(axis=0))


def _hull(x: Interval, y: Interval) -> Interval:
    return Interval(np.minimum(x.low, y.low), np.maximum(x.high, y.high))


def _picked(first: Flags, second: Flags, x: Interval, y: Interval) -> Interval:
    """x where surely the first, y where surely the second, else both."""
    both = _hull(x, y)
    low = np.where(first, x.low, np.where(second, y.low, both.low))
    return Interval(low, np.where(first, x.high, np.where(second, y.high, both.high)))


def _extreme(name: str, first: Pair, second: Pair) -> Pair:
    (x, dx), (y, dy) = first, second
    if name == "min":
        return (
            Interval(np.minimum(x.low, y.low), np.minimum(x.high, y.high)),
            _picked(x.high < y.low, y.high < x.low, dx, dy),
        )
    return (
        Interval(np.maximum(x.low, y.low), np.maximum(x.high, y.high)),
        _picked(x.low > y.high, y.low > x.high, dx, dy),
    )


def _chosen(condition: Pair, yes: Pair, no: Pair) -> Pair:
    """A choice by what does not follow the variables has the slope of either; by what does, it jumps."""
    c, dc = condition
    surely, surely_not = (c.low > 0) | (c.high < 0), c.zero
    value = _picked(surely, surely_not, yes[0], no[0])
    slopes = _picked(surely, surely_not, yes[1], no[1])
    jumps = ~(surely | surely_not) & ~dc.zero.all(axis=0)
    return value, Interval(np.where(jumps, -np.inf, slopes.low), np.where(jumps, np.inf, slopes.high))


def _stepped(name: str, inner: tuple[Pair, ...]) -> Pair:
    """Comparisons and signs: flat, and a jump where the variables decide."""
    (x, dx), (y, dy) = (
        inner if len(inner) == 2 else (inner[0], (point(0 * inner[0][0].low), point(0 * inner[0][1].low)))
    )
    apply = OPERATIONS[name].apply
    ends = [np.asarray(apply(p, q) if len(inner) == 2 else apply(p), float) for p in x.ends for q in y.ends]
    apart = (x.high < y.low) | (y.high < x.low)
    least = -1.0 if name == "sign" else 0.0
    low = np.where(apart, np.minimum.reduce(ends), least)
    high = np.where(apart, np.maximum.reduce(ends), 1.0)
    jumps = ~apart & ~(dx.zero & dy.zero).all(axis=0)
    flat = np.zeros_like(dx.low)
    return Interval(low, high), Interval(np.where(jumps, -np.inf, flat), np.where(jumps, np.inf, flat))


def _wave(x: Interval, ahead: float = 0.0) -> Interval:
    """The sine of x + ahead."""
    low, high = x.low + ahead, x.high + ahead
    ends = np.array([np.sin(low), np.sin(high)])
    turns = {
        k: np.floor((high - k * np.pi / 2) / (2 * np.pi)) >= np.ceil((low - k * np.pi / 2) / (2 * np.pi))
        for k in (1, -1)
    }
    wide = _outward(ends.min(axis=0), ends.max(axis=0))
    return Interval(np.where(turns[-1], -1.0, wide.low - 1e-15), np.where(turns[1], 1.0, wide.high + 1e-15))


def _known(x: Interval) -> Interval:
    """Everything where there is no number."""
    none = np.isnan(x.low) | np.isnan(x.high)
    return Interval(np.where(none, -np.inf, x.low), np.where(none, np.inf, x.high))
