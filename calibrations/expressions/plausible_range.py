"""What a parameter of an expression could be on the data, from what it stands beside."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from calibrations.expressions.expression import Apply, Name, Node, evaluate
from calibrations.table import Array

WAVES = ("sin", "cos", "tan")
LEVELS = 80
HALF_WAVES = 120  # along a column
EXPONENTS = (-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
ANY = np.logspace(-3, 3, 25)


def trials(root: Node, name: str, values: Mapping[str, Array]) -> Array:
    """Values to try for the parameter `name`, shape (k,); `values` has all names, 0 for the parameters."""
    path = _path(root, name)
    if not path:
        return _both(ANY)
    operation, inner = path[-1].operation.name, path[-1].inner
    first = _is(inner[0], name)
    in_wave = any(each.operation.name in WAVES for each in path)
    if in_wave and operation in "+-":
        return np.linspace(-np.pi, np.pi, 24, endpoint=False)
    others = [evaluate(each, values) for each in inner if not _is(each, name)]
    beside = np.unique(np.concatenate([np.ravel(each) for each in others])) if others else np.zeros(0)
    beside = beside[np.isfinite(beside)]
    if not len(beside) or not np.any(beside):
        return _both(ANY)
    span = float(np.ptp(beside)) or float(np.max(np.abs(beside)))
    match operation:
        case "+":
            return -_levels(beside)
        case "-" | "<" | "<=" | ">" | ">=" | "min" | "max" | "where":
            return _levels(beside)
        case "*" if in_wave:
            return np.arange(1.0, max(2, min(HALF_WAVES, len(beside)))) * np.pi / span  # no faster than rows can show
        case "*":
            return _both(np.logspace(-1.5, 1.5, 25) / span)
        case "/" if not first:
            return _both(np.logspace(-2.5, 1, 29) * span)
        case "**" if not first:
            return np.array(EXPONENTS)
    return _both(ANY * span)


def _path(node: Node, name: str) -> list[Apply]:
    """The operations from `node` down to that which has the parameter among its arguments."""
    if not isinstance(node, Apply):
        return []
    if any(_is(each, name) for each in node.inner) and node.operation.name not in ("neg", "pos"):
        return [node]
    return next(([node, *below] for each in node.inner if (below := _path(each, name))), [])


def _is(node: Node, name: str) -> bool:
    """Whether the node is the parameter, of either sign."""
    if isinstance(node, Apply) and node.operation.name in ("neg", "pos"):
        return _is(node.inner[0], name)
    return isinstance(node, Name) and node.name == name


def _levels(column: Array) -> Array:
    """Levels between neighbouring values of a column of sorted values."""
    if len(column) == 1:
        return np.unique(np.append(_both(ANY * abs(column[0])), column))
    between = (column[1:] + column[:-1]) / 2
    return np.asarray(between[np.unique(np.linspace(0, len(between) - 1, LEVELS).astype(int))])


def _both(positive: Array) -> Array:
    return np.concatenate([-positive[::-1], positive])
