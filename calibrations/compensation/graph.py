"""Arithmetic as a graph. Equal parts are one node, so that they are computed once; what is constant is folded.

A node is made by `number`, `given` and `apply` alone. `given` is what is known or sought at run time, by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calibrations.compensation.operations import OPERATIONS
from calibrations.table import Array

MANY = 1 << 16  # nodes that are known again


@dataclass(frozen=True, eq=False)
class Node:
    """A number, something given by `name`, or an operation on `inner`."""

    operation: str
    inner: tuple[Node, ...] = ()
    value: float = 0.0
    name: str = ""

    @property
    def constant(self) -> bool:
        return self.operation == "number"


@lru_cache(MANY)
def number(value: float) -> Node:
    """A constant."""
    return Node("number", value=float(value))


@lru_cache(MANY)
def given(name: str) -> Node:
    """What has a name and no value yet."""
    return Node("given", name=name)


ZERO, ONE = number(0.0), number(1.0)


def apply(operation: str, *inner: Node) -> Node:
    """The operation on nodes, by the shortest way: what adds nothing is left away."""
    if all(node.constant for node in inner):
        with np.errstate(all="ignore"):
            return number(float(OPERATIONS[operation].apply(*(node.value for node in inner))))
    return _shortened(operation, inner) or _made(operation, inner)


def power(base: Node, exponent: int) -> Node:
    """A whole power by repeated squares."""
    if exponent < 0:
        return apply("/", ONE, power(base, -exponent))
    if exponent < 2:
        return base if exponent else ONE
    half = power(base, exponent // 2)
    return apply("*", apply("*", half, half), power(base, exponent % 2))


def ordered(roots: Iterable[Node]) -> list[Node]:
    """Every node below the roots, each once, after what it is made of."""
    found: dict[Node, None] = {}
    for root in roots:
        for node in _below(root, found):
            found.setdefault(node)
    return list(found)


def names(roots: Iterable[Node]) -> list[str]:
    """What is given, by name, in order of appearance."""
    return [node.name for node in ordered(roots) if node.operation == "given"]


def evaluate(roots: Iterable[Node], values: Mapping[str, Array]) -> list[Array]:
    """The roots' values where what is given has `values`, of shapes that fit."""
    roots, found = list(roots), {}
    for node in ordered(roots):
        if node.operation == "given":
            found[node] = np.asarray(values[node.name])
        elif node.constant:
            found[node] = np.asarray(node.value)
        else:
            found[node] = OPERATIONS[node.operation].apply(*(found[inner] for inner in node.inner))
    return [found[root] for root in roots]


def _below(node: Node, known: Mapping[Node, None]) -> Iterator[Node]:
    if node not in known:
        for inner in node.inner:
            yield from _below(inner, known)
        yield node


@lru_cache(MANY)
def _made(operation: str, inner: tuple[Node, ...]) -> Node:
    return Node(operation, inner)


def _shortened(operation: str, inner: tuple[Node, ...]) -> Node | None:
    """What the operation comes to without being done; None where it has to be."""
    match operation, inner:
        case ("+", (left, right)) if right is ZERO:
            return left
        case ("+", (left, right)) if left is ZERO:
            return right
        case ("+", (left, Node(operation="neg", inner=(right,)))):
            return apply("-", left, right)
        case ("-", (left, right)) if right is ZERO:
            return left
        case ("-", (left, right)) if left is ZERO:
            return apply("neg", right)
        case ("-", (left, Node(operation="neg", inner=(right,)))):
            return apply("+", left, right)
        case ("*", (left, right)) if ZERO in (left, right):
            return ZERO
        case ("*", (left, right)) if right is ONE:
            return left
        case ("*", (left, right)) if left is ONE:
            return right
        case ("/", (left, right)) if right is ONE or left is ZERO:
            return left
        case ("neg", (Node(operation="neg", inner=(inside,)),)):
            return inside
    return None
