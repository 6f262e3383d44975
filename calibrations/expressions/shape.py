"""Which parameters of an expression it is a straight line in: those are found by least squares, without a start."""

from __future__ import annotations

from collections.abc import Sequence

from calibrations.expressions.expression import Apply, Name, Node

CURVED = 2  # of a degree: any more than 1


def linear(root: Node, parameters: Sequence[str]) -> tuple[str, ...]:
    """The first parameters, as many as go, in which together the expression is of the first degree."""
    found: list[str] = []
    for name in parameters:
        if degree(root, {*found, name}) < CURVED:
            found.append(name)
    return tuple(found)


def degree(node: Node, names: set[str]) -> int:
    """The degree of `node` as a polynomial in `names`; CURVED for 2, more, or none."""
    if isinstance(node, Name):
        return int(node.name in names)
    if not isinstance(node, Apply):
        return 0
    each = [degree(inner, names) for inner in node.inner]
    match node.operation.name:
        case "+" | "-" | "neg" | "pos":
            return max(each)
        case "*":
            return min(sum(each), CURVED)
        case "/":
            return each[0] if not each[1] else CURVED
        case "where":
            return max(each[1:]) if not each[0] else CURVED
    return CURVED if any(each) else 0
