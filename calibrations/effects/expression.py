"""An effect written as one line of arithmetic: `v += a*sin(5*beta) + b*cos(5*beta)`.

What it is added to stands first: `v`, the output of every axis with parameters of its own for each; `vx`, `vy` or
`vz`, the output of one axis; `alpha_deg` or `beta_deg`, a stage angle. Without that it is `v`. Then comes an
expression of

    numbers, + - * / **, comparisons (1 where they hold, else 0), the functions of FUNCTIONS, pi
    alpha, beta, mount      the stage angles and the mounting, rad
    ax, ay, az              the specific force along the sensing axes, by the model so far, g
    t, temperature, supply  s, C, V; direction (+1, -1) and flip (0, 1)
    columns of the table    by the names that they have there, in its units

and parameters: all other names. The text is read into a tree of these things alone, and the tree is walked; no part of
it is ever run as a program, so that a model file from a stranger can be used.
"""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from calibrations.errors import ExpressionError, nearest
from calibrations.table import NUMBERS, Array, Table
from calibrations.tables import KINDS

LONGEST = 400  # characters
DEEPEST = 40  # operations within one another
INSTEAD = {"^": "a power is **", "&": "to join conditions multiply them", "|": "max(a, b) holds where one of two does"}
ANGLE_FUNCTIONS = ("sin", "cos", "tan")
TARGETS = ("v", "vx", "vy", "vz", "alpha_deg", "beta_deg")
HUGE = 1e100  # larger than any measurement, and its square is a finite number
MANY = 20  # arguments of min and max
# short name -> the column it needs
COLUMNS: Mapping[str, str] = {
    "alpha": "alpha_deg",
    "beta": "beta_deg",
    "mount": "mount_deg",
    "t": "t_s",
    "temperature": "temperature_c",
    "supply": "supply_v",
    "direction": "direction",
    "flip": "flip",
}
ANGLES = ("alpha", "beta", "mount")
FORCES = ("ax", "ay", "az")
OUTPUT_NAMES = {name for kind in KINDS.values() for name in kind.outputs} - {*FORCES}
MEAN_NUMBERS = {name for name in NUMBERS if name == "n" or "_std" in name}  # say nothing of the sensor
KNOWN = {*COLUMNS, *FORCES, *NUMBERS} - MEAN_NUMBERS  # without a table at hand


@dataclass(frozen=True)
class Operation:
    """An elementwise operation on `least` to `most` arguments."""

    name: str
    apply: Callable[..., Array]
    least: int = 2
    most: int = 2


@dataclass(frozen=True)
class Number:
    """A number in the text."""

    value: float


@dataclass(frozen=True)
class Name:
    """A variable or a parameter; `at` is its column in the text, from 0."""

    name: str
    at: int


@dataclass(frozen=True)
class Apply:
    """An operation on its operands."""

    operation: Operation
    inner: tuple[Node, ...]
    at: int


Node = Number | Name | Apply


@dataclass(frozen=True)
class Expression:
    """The expression and its target. Made by `parse`."""

    text: str
    target: str
    root: Node

    @property
    def names(self) -> dict[str, int]:
        """Every name in it, in order, and its first column."""
        columns: dict[str, int] = {}
        for node in nodes(self.root):
            if isinstance(node, Name):
                columns.setdefault(node.name, node.at)
        return columns

    def fault(self, column: int, message: str) -> ExpressionError:
        """The error at a column, marked in the text."""
        return fault(self.text, column, message)


def fault(text: str, column: int, message: str) -> ExpressionError:
    """The error at a column of `text`, with a mark below it."""
    column = min(max(column, 0), len(text))
    return ExpressionError(f"column {column + 1}: {message}\n    {text}\n    {' ' * column}^")


def parse(text: str) -> Expression:
    """The expression in `text`. Raises ExpressionError, and no other error, for any text."""
    text = " ".join(text.split())
    if len(text) > LONGEST:
        raise ExpressionError(
            f"the expression has {len(text)} characters, more than {LONGEST}; write a Python file instead"
        )
    if not text.isprintable():
        raise ExpressionError("the expression contains invisible characters; type it again")
    target, value = _statement(text)
    return Expression(text, target, _Reader(text).node(value, 0))


def nodes(node: Node) -> Iterator[Node]:
    """The node and all inside it, in the order of the text."""
    yield node
    if isinstance(node, Apply):
        for inner in node.inner:
            yield from nodes(inner)


def evaluate(node: Node, values: Mapping[str, Array]) -> Array:
    """The value of `node` where the names have `values`; the shapes are those of numpy's broadcasting.

    Too large numbers are cut off, so that a fit can turn back; an invalid value, such as log(-1), stays NaN.
    """
    with np.errstate(all="ignore"):
        return np.asarray(_evaluate(node, values), dtype=np.float64)


def may_be_column(name: str) -> bool:
    """Whether an unknown name may be a column of a table. Columns that describe the means (n, std) are excluded."""
    return name not in KNOWN and name not in MEAN_NUMBERS


def variables(names: Iterable[str], table: Table) -> dict[str, Array]:
    """The values of the names that are columns of the table, or short names of columns, shape (n,); not the forces."""
    values: dict[str, Array] = {}
    for name in names:
        if name in FORCES:
            continue
        if name in COLUMNS:
            column = table.column(COLUMNS[name])
            values[name] = np.radians(column) if name in ANGLES else column
        elif name in table:
            values[name] = table.column(name)
    return values


def forces(a: Array) -> dict[str, Array]:
    """The specific force along the sensing axes, each of shape (n,)."""
    return dict(zip(FORCES, a.T, strict=True))


def _evaluate(node: Node, values: Mapping[str, Array]) -> Array | float:
    if isinstance(node, Number):
        return node.value
    if isinstance(node, Name):
        return values[node.name]
    return node.operation.apply(*[_evaluate(inner, values) for inner in node.inner])


def _statement(text: str) -> tuple[str, ast.expr]:
    """The target, and the expression."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            body = ast.parse(text).body
    except SyntaxError as error:
        raise fault(text, (error.offset or 1) - 1, f"cannot be read: {error.msg}") from None
    except (ValueError, MemoryError, RecursionError, OverflowError):
        raise ExpressionError("the expression cannot be read: it is too deep; write a Python file instead") from None
    if len(body) != 1:
        raise ExpressionError("the expression is empty" if not body else "one expression at a time; join them by +")
    match body[0]:
        case ast.Expr(value=value):
            return "v", value
        case ast.AugAssign(target=ast.Name(id=name), op=ast.Add(), value=value) if name in TARGETS:
            return name, value
        case ast.AugAssign(target=ast.Name(id=name), op=ast.Add()):
            raise fault(text, 0, f'an expression cannot change "{name}"{nearest(name, TARGETS)}')
    raise fault(text, 0, "is not an expression; write the added term, as in v += a*sin(5*beta)")


def _degrees(node: Node) -> str | None:
    """The first name of an angle in degrees that nothing makes rad of."""
    inner_nodes = list(nodes(node))
    if any(isinstance(inner_node, Number) and inner_node.value == np.pi for inner_node in inner_nodes):
        return None
    return next(
        (
            inner_node.name
            for inner_node in inner_nodes
            if isinstance(inner_node, Name) and inner_node.name.endswith("_deg")
        ),
        None,
    )


class _Reader:
    """Python's syntax tree as ours. Raises ExpressionError for other syntax."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._bytes = text.encode(errors="replace")

    def node(self, syntax: ast.expr, depth: int) -> Node:
        if depth > DEEPEST:
            raise self._fault(syntax, f"more than {DEEPEST} operations within one another; write a Python file instead")
        match syntax:
            case ast.Constant(value=bool() | str() | bytes() | complex() | None):
                pass
            case ast.Constant(value=int() | float() as number):
                return self._number(syntax, number)
            case ast.Name(id=name):
                return self._name(syntax, name)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in SIGNS:
                return self._apply(syntax, SIGNS[type(op)], [operand], depth)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
                return self._apply(syntax, OPERATORS[type(op)], [left, right], depth)
            case ast.Compare():
                return self._comparison(syntax, depth)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(syntax, name, arguments, depth)
        raise self._syntax_error(syntax)

    def _number(self, syntax: ast.expr, number: float) -> Number:
        try:
            value = float(number)
        except OverflowError:
            value = np.inf
        if not np.isfinite(value):
            raise self._fault(syntax, "a number too large to compute with")
        return Number(value)

    def _name(self, syntax: ast.expr, name: str) -> Node:
        if name == "pi":
            return Number(np.pi)
        if name in FUNCTIONS:
            raise self._fault(syntax, f"{name} is a function: write {name}(...)")
        if not name.isascii():
            raise self._fault(syntax, f'"{name}": names are written in the letters a to z, such as beta')
        return Name(name, self._character(syntax))

    def _call(self, syntax: ast.expr, name: str, arguments: list[ast.expr], depth: int) -> Node:
        if name not in FUNCTIONS:
            raise self._fault(syntax, f'there is no function "{name}"{nearest(name, FUNCTIONS)}')
        operation = FUNCTIONS[name]
        if not operation.least <= len(arguments) <= operation.most:
            expected = f"{operation.least}" if operation.least == operation.most else f"{operation.least} or more"
            raise self._fault(syntax, f"{name} takes {expected} between its brackets, not {len(arguments)}")
        applied = self._apply(syntax, operation, arguments, depth)
        if name in ANGLE_FUNCTIONS and (degrees := _degrees(applied)):
            remedy = f"write {degrees.removesuffix('_deg')}, the same in rad, or {degrees}*pi/180"
            raise self._fault(syntax, f"{name} takes rad, and {degrees} is in degrees: {remedy}")
        return applied

    def _comparison(self, syntax: ast.Compare, depth: int) -> Node:
        """A chain such as 0 < t < 100 is the product of its links."""
        terms = [syntax.left, *syntax.comparators]
        links = []
        for op, lhs, rhs in zip(syntax.ops, terms[:-1], terms[1:], strict=True):
            if type(op) not in COMPARISONS:
                raise self._syntax_error(syntax)
            links.append(self._apply(syntax, COMPARISONS[type(op)], [lhs, rhs], depth))
        product = links[0]
        for link in links[1:]:
            product = Apply(OPERATORS[ast.Mult], (product, link), self._character(syntax))
        return product

    def _apply(self, syntax: ast.expr, operation: Operation, inner: list[ast.expr], depth: int) -> Node:
        return Apply(operation, tuple(self.node(argument, depth + 1) for argument in inner), self._character(syntax))

    def _character(self, syntax: ast.expr) -> int:
        """The column in characters; Python counts bytes."""
        return len(self._bytes[: syntax.col_offset].decode(errors="replace"))

    def _fault(self, syntax: ast.expr, message: str) -> ExpressionError:
        return fault(self._text, self._character(syntax), message)

    def _syntax_error(self, syntax: ast.expr) -> ExpressionError:
        part = ast.get_source_segment(self._text, syntax) or self._text
        hint = next((f": {words}" for sign, words in INSTEAD.items() if sign in part), "")
        vocabulary = f"numbers, names, + - * / **, comparisons and {', '.join(FUNCTIONS)} are"
        return self._fault(syntax, f"{part[:40]!r} is not allowed here{hint}; {vocabulary}")


def _power(base: Array, exponent: Array) -> Array:
    """`base ** exponent`, cut off at HUGE; no number where 0 is divided by, or the root of a negative one is taken."""
    power = np.clip(np.power(base, exponent), -HUGE, HUGE)
    return np.asarray(np.where((base == 0) & (exponent < 0), np.nan, power))


def _exp(x: Array) -> Array:
    return np.exp(np.minimum(x, np.log(HUGE)))


def _log(x: Array) -> Array:
    return np.asarray(np.where(x > 0, np.log(x), np.nan))


def _divide(a: Array, b: Array) -> Array:
    return np.asarray(np.where(b == 0, np.nan, np.divide(a, b)))


def _step(x: Array) -> Array:
    """1 from 0 on, 0 before."""
    return np.asarray(np.where(x >= 0, 1.0, 0.0 * x))


def _select(condition: Array, yes: Array, no: Array) -> Array:
    return np.where(condition != 0, yes, no)


def _least(*values: Array) -> Array:
    return np.asarray(np.minimum.reduce(np.broadcast_arrays(*values)))


def _greatest(*values: Array) -> Array:
    return np.asarray(np.maximum.reduce(np.broadcast_arrays(*values)))


def _unary(name: str, apply: Callable[..., Array]) -> Operation:
    return Operation(name, apply, 1, 1)


FUNCTIONS: Mapping[str, Operation] = {
    operation.name: operation
    for operation in (
        _unary("sin", np.sin),
        _unary("cos", np.cos),
        _unary("tan", np.tan),
        _unary("tanh", np.tanh),
        _unary("exp", _exp),
        _unary("log", _log),
        _unary("sqrt", np.sqrt),
        _unary("abs", np.abs),
        _unary("sign", np.sign),
        _unary("step", _step),
        Operation("min", _least, 2, MANY),
        Operation("max", _greatest, 2, MANY),
        Operation("where", _select, 3, 3),
    )
}
SIGNS: Mapping[type[ast.unaryop], Operation] = {
    ast.USub: _unary("neg", np.negative),
    ast.UAdd: _unary("pos", np.positive),
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
