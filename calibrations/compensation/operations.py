"""The vocabulary of a compensation: what numbers come to, how it is written in C and in Python, what it counts as."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Operation:
    """One operation. `c` and `python` are written with {0}, {1}, ... for what it is applied to, {f} for C's suffix.

    `counts_as` is "add", "multiply", "divide", "compare" or "function".
    """

    apply: Callable[..., Any]
    c: str
    python: str
    counts_as: str


def _compared(sign: str, apply: Callable[..., Any]) -> Operation:
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
    "exp": _function("exp", np.exp),
    "log": _function("log", np.log),
    "sin": _function("sin", np.sin),
    "cos": _function("cos", np.cos),
    "<": _compared("<", np.less),
    "<=": _compared("<=", np.less_equal),
    ">": _compared(">", np.greater),
    ">=": _compared(">=", np.greater_equal),
    "==": _compared("==", np.equal),
    "!=": _compared("!=", np.not_equal),
}  # fmt: skip
