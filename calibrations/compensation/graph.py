"""Arithmetic as a graph. Equal parts are one node, computed once; constants are folded.

Only `number`, `variable`, `apply_operation` and the signs +, -, * and / make nodes. A variable gets its value at run
time, by name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from calibrations.table import Array

# Operations of a compensation: evaluation, text in C and Python, and class for the count of operations.


@dataclass(frozen=True)
class Operation:
    """One operation. In `c` and `python`, {0}, {1}, ... are the operands and {f} is C's suffix.

    `counts_as` is "add", "multiply", "divide", "compare" or "function".
    """

    apply: Callable[..., Any]
    c: str
    python: str
    counts_as: str


def _comparison(sign: str, apply: Callable[..., Any]) -> Operation:
    text = f"({{0}} {sign} {{1}} ? 1 : 0)"
    return Operation(
        lambda a, b: np.where(apply(a, b), 1.0, 0.0), text, f"(1.0 if {{0}} {sign} {{1}} else 0.0)", "compare"
    )


def _function(name: str, apply: Callable[..., Any]) -> Operation:
    return Operation(apply, f"{name}{{f}}({{0}})", f"math.{name}({{0}})", "function")


OPERATIONS: Mapping[str, Operation] = {
    "+": Operation(np.add, "{0} + {1}", "{0} + {1}", "add"),
    "-": Operation(np.subtract, "{0} - {1}", "{0} - {1}", "add"),
    "*": Operation(np.multiply, "{0} * {1}", "{0} * {1}", "multiply"),
    "/": Operation(np.divide, "{0} / {1}", "{0} / {1}", "divide"),
    "neg": Operation(np.negative, "-{0}", "-{0}", "add"),
    "abs": Operation(np.abs, "fabs{f}({0})", "abs({0})", "compare"),
    "min": Operation(np.minimum, "({0} < {1} ? {0} : {1})", "min({0}, {1})", "compare"),
    "max": Operation(np.maximum, "({0} > {1} ? {0} : {1})", "max({0}, {1})", "compare"),
    "sign": Operation(np.sign, "(({0} > 0) - ({0} < 0))", "float(({0} > 0) - ({0} < 0))", "compare"),
    "where": Operation(
        lambda c, yes, no: np.where(np.asarray(c) != 0, yes, no),
        "({0} != 0 ? {1} : {2})", "({1} if {0} != 0 else {2})", "compare",
    ),
    "sqrt": _function("sqrt", np.sqrt),
    "tanh": _function("tanh", np.tanh),
    "exp": _function("exp", np.exp),
    "log": _function("log", np.log),
    "sin": _function("sin", np.sin),
    "cos": _function("cos", np.cos),
    "<": _comparison("<", np.less),
    "<=": _comparison("<=", np.less_equal),
    ">": _comparison(">", np.greater),
    ">=": _comparison(">=", np.greater_equal),
    "==": _comparison("==", np.equal),
    "!=": _comparison("!=", np.not_equal),
    "table": Operation(lambda x, table: table(x), "{1}({0})", "{1}({0})", "table"),  # {1}: the table's name
}  # fmt: skip

MANY = 1 << 16  # nodes in the cache


class Table(Protocol):
    """A function of one variable, such as a `CubicTable`: hashable, with bounds over an interval."""

    @property
    def low(self) -> float:
        """The lower end of the first piece."""

    @property
    def step(self) -> float:
        """Width of a piece."""

    @property
    def pieces(self) -> tuple[tuple[float, float, float, float], ...]:
        """Cubics in 0..1, lowest power first."""

    def __call__(self, x: Any) -> Array:
        """The function at x."""

    def bounds(self, low: Array, high: Array) -> tuple[Array, Array, Array, Array]:
        """Least and greatest value and slope for x from `low` to `high`."""


@dataclass(frozen=True, eq=False)
class Node:
    """A number, a variable called `name`, or an operation on `inner`; the operation "table" has a `table`."""

    operation: str
    inner: tuple[Node, ...] = ()
    value: float = 0.0
    name: str = ""
    table: Table | None = None

    @property
    def constant(self) -> bool:
        return self.operation == "number"

    def __add__(self, other: Node) -> Node:
        return apply_operation("+", self, other)

    def __sub__(self, other: Node) -> Node:
        return apply_operation("-", self, other)

    def __mul__(self, other: Node) -> Node:
        return apply_operation("*", self, other)

    def __truediv__(self, other: Node) -> Node:
        return apply_operation("/", self, other)

    def __abs__(self) -> Node:
        return apply_operation("abs", self)

    def clipped(self, least: Node, most: Node) -> Node:
        """The node, not below `least` and not above `most`."""
        return apply_operation("min", apply_operation("max", self, least), most)


@lru_cache(MANY)
def number(value: float) -> Node:
    """A constant."""
    return Node("number", value=float(value))


@lru_cache(MANY)
def variable(name: str) -> Node:
    """A variable by its name."""
    return Node("given", name=name)


ZERO, ONE = number(0.0), number(1.0)


def apply_operation(operation: str, *inner: Node) -> Node:
    """The operation on nodes, simplified where possible."""
    if all(node.constant for node in inner):
        with np.errstate(all="ignore"):
            return number(float(OPERATIONS[operation].apply(*(node.value for node in inner))))
    return _simplify(operation, inner) or _make_node(operation, inner)


@lru_cache(MANY)
def look_up(table: Table, x: Node) -> Node:
    """The table at x."""
    return number(float(table(x.value))) if x.constant else Node("table", (x,), table=table)


def power(base: Node, exponent: int) -> Node:
    """A whole power by repeated squares."""
    if exponent < 0:
        return ONE / power(base, -exponent)
    if exponent < 2:
        return base if exponent else ONE
    half = power(base, exponent // 2)
    return half * half * power(base, exponent % 2)


def sort_nodes(roots: Iterable[Node]) -> list[Node]:
    """Every node below the roots once, after its operands."""
    nodes: dict[Node, None] = {}
    for root in roots:
        for node in _descend(root, nodes):
            nodes.setdefault(node)
    return list(nodes)


def variable_names(roots: Iterable[Node]) -> list[str]:
    """Names of the variables, in order of appearance."""
    return [node.name for node in sort_nodes(roots) if node.operation == "given"]


def evaluate_nodes(roots: Iterable[Node], values: Mapping[str, Array]) -> list[Array]:
    """The roots' values for the variables' `values`, with broadcasting."""
    roots, results = list(roots), {}
    for node in sort_nodes(roots):
        if node.operation == "given":
            results[node] = np.asarray(values[node.name])
        elif node.constant:
            results[node] = np.asarray(node.value)
        else:
            table = () if node.table is None else (node.table,)
            results[node] = OPERATIONS[node.operation].apply(*(results[inner] for inner in node.inner), *table)
    return [results[root] for root in roots]


def _descend(node: Node, visited: Mapping[Node, None]) -> Iterator[Node]:
    if node not in visited:
        for inner in node.inner:
            yield from _descend(inner, visited)
        yield node


@lru_cache(MANY)
def _make_node(operation: str, inner: tuple[Node, ...]) -> Node:
    return Node(operation, inner)


def _simplify(operation: str, inner: tuple[Node, ...]) -> Node | None:
    """The simplified node; None where the operation is needed."""
    match operation, inner:
        case ("+", (left, right)) if right is ZERO:
            return left
        case ("+", (left, right)) if left is ZERO:
            return right
        case ("+", (left, Node(operation="neg", inner=(right,)))):
            return left - right
        case ("-", (left, right)) if right is ZERO:
            return left
        case ("-", (left, right)) if left is ZERO:
            return apply_operation("neg", right)
        case ("-", (left, Node(operation="neg", inner=(right,)))):
            return left + right
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
