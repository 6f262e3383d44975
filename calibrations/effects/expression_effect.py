"""An expression as a physical effect: a name, parameters, and a function of the signal chain like any other effect's.

A model file holds the text, and the names of those columns that only its data have; `own_effect` makes the same effect
of them everywhere. Parameters are one per axis where the output of all axes is added to, else one.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from calibrations.effects import ACCELEROMETER_KINDS, Effect, Parameter, Values
from calibrations.effects.expression import (
    COLUMNS,
    FORCES,
    FUNCTIONS,
    KNOWN,
    OUTPUT_NAMES,
    Expression,
    evaluate,
    forces,
    may_be_column,
    nodes,
    parse,
    variables,
)
from calibrations.effects.expression_start import best_start, find_linear_parameters, scales
from calibrations.errors import ExpressionError, ModelError
from calibrations.geometry.orientation import Pose
from calibrations.table import AXES, LARGEST, Array, Table

NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
LONGEST_NAME = 60
MOST_PARAMETERS = 12
MISSPELT = 0.8  # likeness, as difflib has it, of a name of at least four letters to one that is known


def effect_for(name: str, text: str, table: Table) -> Effect:
    """The effect that a person wrote with `table` at hand: names of its columns are columns, others parameters.

    Raises ExpressionError for text that is no expression, and for a name that looks like a misspelt column.
    """
    expression = parse(text)
    column_names = {*COLUMNS, *FORCES, *(column for column in table.columns if column not in OUTPUT_NAMES)}
    for word, column_number in expression.names.items():
        similar = difflib.get_close_matches(word, column_names | {*FUNCTIONS}, n=1, cutoff=MISSPELT)
        if similar and word not in column_names and len(word) > 3 and not word.startswith(similar[0]):
            raise expression.fault(
                column_number, f'"{word}" is not a column; did you mean "{similar[0]}"? If it is a parameter, rename it'
            )
    effect = own_effect(name, expression.text, tuple(w for w in expression.names if w in table and may_be_column(w)))
    for column in effect.needs:
        if column not in table:
            word = next((short for short, full_name in COLUMNS.items() if full_name == column), column)
            column_number = expression.names.get(word, 0)
            raise expression.fault(
                column_number, f"needs the column {column}; {table.source} has: {', '.join(table.columns)}"
            )
    if reason := effect.lacks(table):
        raise expression.fault(0, f"{reason}; {table.source} has: {', '.join(table.output_names)}")
    return effect


@lru_cache(maxsize=64)
def own_effect(name: str, text: str, columns: tuple[str, ...] = ()) -> Effect:
    """The effect `name` of an expression; `columns` are names in it that are columns of its data alone.

    Raises ModelError for the name, ExpressionError for the expression.
    """
    if not NAME.fullmatch(name) or len(name) > LONGEST_NAME:
        raise ModelError(f'"{name}" cannot name an effect; take small letters, digits and -, as in fifth-harmonic')
    expression = parse(text)
    parameters = tuple(word for word in expression.names if word not in KNOWN and word not in columns)
    _check(expression, parameters)
    return (_OnAngle if _is_on_angle(expression) else _OnOutput)(name, expression, parameters)


class _FromExpression(Effect):
    """expression: an effect of one's own.

    Symptom   the residual follows the expression.
    Excited by  data in which the variables of the expression change.
    Source    the user.
    """

    def __init__(self, name: str, expression: Expression, parameters: tuple[str, ...]) -> None:
        """Sizes of the parameters come from the data, and starts where the expression is not linear in them."""
        target = expression.target
        bent = find_linear_parameters(expression.root, parameters) != parameters
        self._expression = expression
        self.name, self.expression = name, expression.text
        self.formula = expression.text if "+=" in expression.text else f"v += {expression.text}"
        self.needs = _required_columns(expression, parameters)
        self.kinds = ("poses", "motion") if _is_on_angle(expression) else ACCELEROMETER_KINDS
        self.constants = {_scale(p): partial(_size, expression, parameters, p) for p in parameters}
        self.parameters = tuple(
            Parameter(
                unit="",
                typical=1.0,
                per_axis=target == "v",
                scale=_scale(p),
                name=p,
                guess=partial(_start, expression, parameters, p) if bent else None,
            )
            for p in parameters
        )

    def _value(self, values: Mapping[str, Array], p: Mapping[str, Array], shape: tuple[int, ...]) -> Array:
        """The expression's value. Raises ExpressionError where it is not a finite number."""
        values = {**values, **p}
        result = evaluate(self._expression.root, values)
        if not np.isfinite(result).all():
            raise self._no_number(values)
        return np.clip(np.broadcast_to(result, shape), -LARGEST, LARGEST)

    def _no_number(self, values: Mapping[str, Array]) -> ExpressionError:
        """Names the innermost part that is not a number, and its first row."""
        parts = [n for n in nodes(self._expression.root) if not np.isfinite(evaluate(n, values)).all()]
        row = int(np.argmax(~np.isfinite(np.atleast_2d(evaluate(parts[-1], values))).all(axis=-1)))
        values_text = ", ".join(f"{p.name} = {np.ravel(values[p.name])[0]:.4g}" for p in self.parameters)
        return self._expression.fault(
            getattr(parts[-1], "at", 0),
            f"{self.name} is not a number on row {row + 1}, with {values_text}; keep divisors away from 0, and above 0 "
            "the arguments of log, sqrt and powers with fractions",
        )


class _OnAngle(_FromExpression):
    """Adds to a stage angle."""

    def pose(self, pose: Pose, table: Table, p: Values) -> Pose:
        values = variables(self._expression.names, table)
        values |= {"alpha": pose.alpha, "beta": pose.beta, "mount": pose.mount}
        angle = self._expression.target.removesuffix("_deg")
        parameters = {q.name: p[q.name] for q in self.parameters}
        return replace(pose, **{angle: getattr(pose, angle) + np.radians(self._value(values, parameters, (table.n,)))})


class _OnOutput(_FromExpression):
    """Adds to the outputs, shape (n, 3)."""

    def lacks(self, table: Table) -> str | None:
        target = self._expression.target
        return f"needs the output of axis {target[1]}" if target != "v" and target[1] not in table.axes else None

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        columns = variables(self._expression.names, table) | forces(a)
        values = {name: column[:, None] for name, column in columns.items()}
        target, contribution, axes = self._expression.target, np.zeros(a.shape), len(table.axes)
        parameters = {q.name: p[q.name] for q in self.parameters}
        if target == "v":
            contribution[:, :axes] = self._value(
                values, {name: v[:axes] for name, v in parameters.items()}, (len(a), axes)
            )
        else:
            contribution[:, [AXES.index(target[1])]] = self._value(values, parameters, (len(a), 1))
        return contribution


def _is_on_angle(expression: Expression) -> bool:
    return expression.target.endswith("_deg")


def _required_columns(expression: Expression, parameters: tuple[str, ...]) -> tuple[str, ...]:
    """Columns without which it has no value."""
    words = [word for word in expression.names if word not in {*FORCES, *parameters}]
    target = expression.target
    of_target = [target] if _is_on_angle(expression) else []
    return tuple(dict.fromkeys([COLUMNS.get(word, word) for word in words] + of_target))


def _check(expression: Expression, parameters: tuple[str, ...]) -> None:
    """Raise ExpressionError for an expression that is not an effect."""
    for word, column in expression.names.items():
        if word in OUTPUT_NAMES:
            raise expression.fault(column, f"{word} is the measured output; write the effect in ax, ay, az")
        if _is_on_angle(expression) and word in FORCES:
            raise expression.fault(column, f"{word} follows from the stage angles; write this in alpha and beta")
    if not parameters:
        raise ExpressionError(
            f"{expression.text}: it has no parameter to fit: all its names are columns. Multiply it by a "
            "parameter with any other name, such as a in a*sin(beta)"
        )
    if len(parameters) > MOST_PARAMETERS:
        raise ExpressionError(f"{expression.text}: has more than {MOST_PARAMETERS} parameters")


def _scale(parameter: str) -> str:
    """The constant that keeps a parameter's size on the data that it was first fitted to."""
    return f"scale of {parameter}"


def _size(expression: Expression, parameters: tuple[str, ...], parameter: str, table: Table) -> float:
    return scales(expression, parameters, table)[parameter]


def _start(expression: Expression, parameters: tuple[str, ...], parameter: str, table: Table) -> Array:
    return best_start(expression, parameters, table)[parameter]
