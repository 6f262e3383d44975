"""An array of graph nodes: numpy operations on it are recorded instead of computed.

The function of an effect is called with it, so that its formula is written once. An operation that needs numbers
(rounding, sorting, a column that no product has) raises NotTraced with its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from calibrations.compensation.graph import Node, apply_operation, number, power, variable
from calibrations.effects import Effect, Values
from calibrations.effects.expression import COLUMNS, FORCES, Apply, Name, parse
from calibrations.effects.expression import Node as ExpressionNode
from calibrations.errors import CalibrationError
from calibrations.table import AXES, STANDARD_GRAVITY

UFUNCS = {
    "add": "+", "subtract": "-", "multiply": "*", "divide": "/", "negative": "neg", "absolute": "abs", "fabs": "abs",
    "minimum": "min", "maximum": "max", "sign": "sign", "sqrt": "sqrt", "exp": "exp", "log": "log", "sin": "sin",
    "cos": "cos", "tanh": "tanh", "less": "<", "less_equal": "<=", "greater": ">", "greater_equal": ">=", "equal": "==",
    "not_equal": "!=",
}  # fmt: skip
HIGHEST_POWER = 8


class NotTraced(CalibrationError):
    """The function of an effect cannot be traced."""


class NodeArray(NDArrayOperatorsMixin):
    """Nodes in an array of any shape."""

    def __init__(self, nodes: Any) -> None:
        self.nodes = np.asarray(nodes, dtype=object)

    @property
    def shape(self) -> tuple[int, ...]:
        return self.nodes.shape

    @property
    def ndim(self) -> int:
        return self.nodes.ndim

    @property
    def T(self) -> NodeArray:  # noqa: N802 as numpy has it
        return NodeArray(self.nodes.T)

    def __len__(self) -> int:
        return len(self.nodes)

    def __getitem__(self, key: Any) -> NodeArray:
        return NodeArray(self.nodes[key])

    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        raise NotTraced("its function needs numbers, as np.asarray and float do")

    def __bool__(self) -> bool:
        raise NotTraced("its function branches on a value known at run time only; use np.where")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or any(isinstance(target, np.ndarray) for target in options.get("out") or ()):
            raise NotTraced(f"its function uses np.{ufunc.__name__}.{method} or changes an array in place")
        match ufunc.__name__:
            case "matmul":
                return NodeArray(np.matmul(*map(as_nodes, inputs)))
            case "square":
                return _elementwise(lambda x: power(x, 2), *inputs)
            case "power":
                return _power(*inputs)
            case "positive":
                return self
            case "radians" | "deg2rad":
                return inputs[0] * (np.pi / 180)
            case "degrees" | "rad2deg":
                return inputs[0] * (180 / np.pi)
            case "tan":
                return np.sin(inputs[0]) / np.cos(inputs[0])
            case name if name in UFUNCS:
                return _elementwise(lambda *x: apply_operation(UFUNCS[name], *x), *inputs)
        raise NotTraced(f"its function uses np.{ufunc.__name__}")

    def __array_function__(self, function: Callable[..., Any], _: Any, arguments: Any, options: Any) -> Any:
        if function not in FUNCTIONS:
            raise NotTraced(f"its function uses np.{function.__name__}")
        return FUNCTIONS[function](*arguments, **options)


@dataclass(frozen=True)
class RunTime:
    """The table of an effect at run time: one row, not measured yet.

    Columns are inputs of the product, by their names; constants those of the model.
    """

    axes: tuple[str, ...]
    available: Mapping[str, str]  # column -> name of the input
    kind: str = "poses"
    n: int = 1
    constants: Mapping[str, float] = field(default_factory=dict)

    def __contains__(self, name: str) -> bool:
        return name in self.available

    def column(self, name: str) -> NodeArray:
        """One column. Raises NotTraced where a product does not have it."""
        if name not in self.available:
            raise NotTraced(f"it needs {name}, which is not known at run time")
        return NodeArray([variable(self.available[name])])

    def optional(self, name: str, default: float) -> NodeArray:
        return self.column(name) if name in self else NodeArray([number(default)])

    @property
    def time_s(self) -> NodeArray:
        return self.column("t_s")

    @property
    def gravity_m_s2(self) -> float:
        return self.constants.get("gravity_m_s2", STANDARD_GRAVITY)

    def number(self, name: str, default: float) -> float:
        return self.constants.get(name, default)

    def __getattr__(self, name: str) -> Any:
        raise NotTraced(f"it needs {name} of the whole table")


def as_nodes(value: Any) -> np.ndarray:
    """An array of nodes out of nodes or numbers."""
    if isinstance(value, NodeArray):
        return value.nodes
    numbers = np.asarray(value)
    nodes = np.empty(numbers.shape, dtype=object)
    for place in np.ndindex(numbers.shape):
        nodes[place] = number(float(numbers[place]))
    return nodes


def _elementwise(make: Callable[..., Node], *inputs: Any) -> NodeArray:
    """`make` elementwise, with numpy's broadcasting."""
    arrays = np.broadcast_arrays(*(as_nodes(value) for value in inputs))
    result = np.empty(arrays[0].shape, dtype=object)
    for place in np.ndindex(result.shape):
        result[place] = make(*(array[place] for array in arrays))
    return NodeArray(result)


def _power(base: Any, exponent: Any) -> NodeArray:
    e = np.unique(exponent) if not isinstance(exponent, NodeArray) else np.empty(0)
    if len(e) != 1 or abs(e[0]) > HIGHEST_POWER or (e[0] != 0.5 and e[0] % 1):
        raise NotTraced(
            f"its function uses a power that is not a whole number up to {HIGHEST_POWER}; use np.exp, np.log"
        )
    return np.sqrt(base) if e[0] == 0.5 else _elementwise(lambda x: power(x, int(e[0])), base)


def as_traced(value: Any) -> NodeArray:
    return NodeArray(as_nodes(value))


def _select(condition: Any, yes: Any, no: Any) -> NodeArray:
    return _elementwise(lambda *x: apply_operation("where", *x), condition, yes, no)


def _clip(a: Any, low: Any, high: Any) -> NodeArray:
    return _elementwise(Node.clipped, a, low, high)


FUNCTIONS: Mapping[Callable[..., Any], Callable[..., Any]] = {
    np.where: _select,
    np.clip: _clip,
    np.outer: lambda a, b: NodeArray(np.outer(as_nodes(a), as_nodes(b))),
    np.broadcast_to: lambda a, shape: NodeArray(np.broadcast_to(as_nodes(a), shape)),
    np.column_stack: lambda columns: NodeArray(np.column_stack([as_nodes(column) for column in columns])),
    np.zeros_like: lambda a, **_: as_traced(np.zeros(a.shape)),
    np.ones_like: lambda a, **_: as_traced(np.ones(a.shape)),
    np.shape: lambda a: a.shape,
    np.ndim: lambda a: a.ndim,
}

# An effect given by an expression, as nodes.

# what numpy does for an operation of an expression; its guards against fits that go astray are not needed here
AS_NUMPY: Mapping[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power, "neg": np.negative,
    "pos": np.positive, "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal,
    "!=": np.not_equal, "sin": np.sin, "cos": np.cos, "tan": np.tan, "tanh": np.tanh, "exp": np.exp, "log": np.log,
    "sqrt": np.sqrt,
    "abs": np.abs, "sign": np.sign, "where": np.where,
    "step": lambda x: np.greater_equal(x, 0.0),
    "min": lambda *arguments: reduce(np.minimum, arguments),
    "max": lambda *arguments: reduce(np.maximum, arguments),
}  # fmt: skip


def trace_expression(effect: Effect, a: NodeArray, table: RunTime, p: Values) -> NodeArray:
    """Contribution of the effect to the outputs, (1, 3). Raises NotTraced for a variable unknown at run time."""
    expression = parse(effect.expression)
    columns = {word: table.column(COLUMNS.get(word, word))[0] for word in expression.names if word not in {*FORCES, *p}}
    forces = {name: a[0, k] for k, name in enumerate(FORCES)}
    target_axes = range(len(table.axes)) if expression.target == "v" else (AXES.index(expression.target[1]),)
    contribution = as_nodes(np.zeros((1, 3)))
    for k in target_axes:
        parameters = {q.name: p[q.name][k] if q.per_axis else p[q.name] for q in effect.parameters}
        contribution[0, k] = as_nodes(_evaluate(expression.root, {**columns, **forces, **parameters}))[()]
    return as_traced(NodeArray(contribution))


def _evaluate(node: ExpressionNode, values: Mapping[str, Any]) -> Any:
    if isinstance(node, Name):
        return values[node.name]
    if isinstance(node, Apply):
        return AS_NUMPY[node.operation.name](*(_evaluate(inner, values) for inner in node.inner))
    return node.value
