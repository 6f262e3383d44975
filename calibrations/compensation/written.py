"""An effect of one line of arithmetic, written down as nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np

from calibrations.compensation.traced import RunTime, Traced, nodes_of, nodes_traced
from calibrations.effect import Effect, Values
from calibrations.expressions.expression import Apply, Name, Node, parse
from calibrations.expressions.variables import COLUMNS, FORCES
from calibrations.table import AXES

# what numpy does for an operation of an expression; its guards against fits that go astray are not needed here
AS_NUMPY: Mapping[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power, "neg": np.negative,
    "pos": np.positive, "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal,
    "!=": np.not_equal, "sin": np.sin, "cos": np.cos, "tan": np.tan, "exp": np.exp, "log": np.log, "sqrt": np.sqrt,
    "abs": np.abs, "sign": np.sign, "where": np.where,
    "step": lambda x: np.greater_equal(x, 0.0),
    "min": lambda *each: reduce(np.minimum, each),
    "max": lambda *each: reduce(np.maximum, each),
}  # fmt: skip


def added(effect: Effect, a: Traced, table: RunTime, p: Values) -> Traced:
    """What the effect adds to the outputs, shape (1, 3). Raises NotTraced for a variable that no product has."""
    expression = parse(effect.expression)
    columns = {word: table.column(COLUMNS.get(word, word))[0] for word in expression.names if word not in {*FORCES, *p}}
    forces = {name: a[0, k] for k, name in enumerate(FORCES)}
    own = range(len(table.axes)) if expression.target == "v" else (AXES.index(expression.target[1]),)
    out = nodes_of(np.zeros((1, 3)))
    for k in own:
        parameters = {q.name: p[q.name][k] if q.per_axis else p[q.name] for q in effect.parameters}
        out[0, k] = nodes_of(_walked(expression.root, {**columns, **forces, **parameters}))[()]
    return nodes_traced(Traced(out))


def _walked(node: Node, values: Mapping[str, Any]) -> Any:
    if isinstance(node, Name):
        return values[node.name]
    if isinstance(node, Apply):
        return AS_NUMPY[node.operation.name](*(_walked(inner, values) for inner in node.inner))
    return node.value
