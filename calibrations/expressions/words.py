"""The vocabulary of expressions: operations, functions, and what can be added to."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from calibrations.table import Array

OF_ANGLES = ("sin", "cos", "tan")
TARGETS = ("v", "vx", "vy", "vz", "alpha_deg", "beta_deg")
HUGE = 1e100  # beyond what is measured, and its square is still a number
MANY = 20  # arguments of min and max


@dataclass(frozen=True)
class Operation:
    """What is done to its arguments, `least` to `most` of them, elementwise."""

    name: str
    apply: Callable[..., Array]
    least: int = 2
    most: int = 2


def _power(base: Array, exponent: Array) -> Array:
    """`base ** exponent`, cut off at HUGE; no number where 0 is divided by, or the root of a negative one is taken."""
    whole = np.clip(np.power(base, exponent), -HUGE, HUGE)
    return np.asarray(np.where((base == 0) & (exponent < 0), np.nan, whole))


def _exp(x: Array) -> Array:
    return np.exp(np.minimum(x, np.log(HUGE)))


def _log(x: Array) -> Array:
    return np.asarray(np.where(x > 0, np.log(x), np.nan))


def _divide(a: Array, b: Array) -> Array:
    return np.asarray(np.where(b == 0, np.nan, np.divide(a, b)))


def _step(x: Array) -> Array:
    """1 from 0 on, 0 before."""
    return np.asarray(np.where(x >= 0, 1.0, 0.0 * x))


def _where(condition: Array, yes: Array, no: Array) -> Array:
    return np.where(condition != 0, yes, no)


def _least(*each: Array) -> Array:
    return np.asarray(np.minimum.reduce(np.broadcast_arrays(*each)))


def _greatest(*each: Array) -> Array:
    return np.asarray(np.maximum.reduce(np.broadcast_arrays(*each)))


def _one(name: str, apply: Callable[..., Array]) -> Operation:
    return Operation(name, apply, 1, 1)


FUNCTIONS: Mapping[str, Operation] = {
    operation.name: operation
    for operation in (
        _one("sin", np.sin),
        _one("cos", np.cos),
        _one("tan", np.tan),
        _one("exp", _exp),
        _one("log", _log),
        _one("sqrt", np.sqrt),
        _one("abs", np.abs),
        _one("sign", np.sign),
        _one("step", _step),
        Operation("min", _least, 2, MANY),
        Operation("max", _greatest, 2, MANY),
        Operation("where", _where, 3, 3),
    )
}
SIGNS: Mapping[type[ast.unaryop], Operation] = {
    ast.USub: _one("neg", np.negative),
    ast.UAdd: _one("pos", np.positive),
}
OPERATORS: Mapping[type[ast.operator], Operation] = {
    ast.Add: Operation("+", np.add),
    ast.Sub: Operation("-", np.subtract),
    ast.Mult: Operation("*", np.multiply),
    ast.Div: Operation("/", _divide),
    ast.Pow: Operation("**", _power),
}
COMPARISONS: Mapping[type[ast.cmpop], Operation] = {
    ast.Lt: Operation("<", np.less),
    ast.LtE: Operation("<=", np.less_equal),
    ast.Gt: Operation(">", np.greater),
    ast.GtE: Operation(">=", np.greater_equal),
    ast.Eq: Operation("==", np.equal),
    ast.NotEq: Operation("!=", np.not_equal),
}
