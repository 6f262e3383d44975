"""An expression as a physical effect: a name, parameters, and a function of the signal chain like any other effect's.

A model file holds the text, and the names of those columns that only its data have; `own_effect` makes the same effect
of them everywhere. Parameters are one per axis where the output of all axes is added to, else one.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from calibrations.chain import Pose
from calibrations.effect import KINDS, Effect, Parameter, Values
from calibrations.errors import ExpressionError, ModelError
from calibrations.expressions.expression import Expression, evaluate, nodes, parse
from calibrations.expressions.shape import linear
from calibrations.expressions.start import best_start, scales
from calibrations.expressions.variables import COLUMNS, FORCES, KNOWN, MEASURED, forces, may_be_column, variables
from calibrations.expressions.words import FUNCTIONS
from calibrations.table import AXES, LARGEST, Array, Table

NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
LONGEST_NAME = 60
MOST_PARAMETERS = 12
MISSPELT = 0.8  # likeness, as difflib has it, of a name of at least four letters to one that is known


def effect_for(name: str, text: str, table: Table) -> Effect:
    """The effect that a person wrote with `table` at hand: names of its columns are columns, others parameters.

    Raises ExpressionError for what it is not, and for a name that looks like a misspelt column.
    """
    expression = parse(text)
    known = {*COLUMNS, *FORCES, *(column for column in table.columns if column not in MEASURED)}
    for word, at in expression.names.items():
        near = difflib.get_close_matches(word, known | {*FUNCTIONS}, n=1, cutoff=MISSPELT)
        if near and word not in known and len(word) > 3 and not word.startswith(near[0]):
            raise expression.fault(at, f'"{word}" is no column; did you mean "{near[0]}"? Name a parameter otherwise')
    effect = own_effect(name, expression.text, tuple(w for w in expression.names if w in table and may_be_column(w)))
    for column in effect.needs:
        if column not in table:
            word = next((short for short, needed in COLUMNS.items() if needed == column), column)
            at = expression.names.get(word, 0)
            raise expression.fault(at, f"needs the column {column}; {table.source} has: {', '.join(table.columns)}")
    return effect


@lru_cache(maxsize=64)
def own_effect(name: str, text: str, columns: tuple[str, ...] = ()) -> Effect:
    """The effect `name` of an expression; `columns` are names in it that are columns of its data alone.

    Raises ModelError for the name, ExpressionError for the expression.
    """
    if not NAME.fullmatch(name) or len(name) > LONGEST_NAME:
        raise ModelError(f'"{name}" cannot name an effect; take small letters, digits and -, as in fifth-harmonic')
    own = _Own(name, parse(text), columns)
    own.check()
    return own.effect()


@dataclass(frozen=True)
class _Own:
    """An expression, and what its names are."""

    name: str
    expression: Expression
    columns: tuple[str, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names that are not known."""
        return tuple(word for word in self.expression.names if word not in KNOWN and word not in self.columns)

    @property
    def on_angle(self) -> bool:
        """Whether a stage angle is added to."""
        return self.expression.target.endswith("_deg")

    def effect(self) -> Effect:
        """The effect, with sizes of its parameters from the data, and starts where one of them bends the expression."""
        text, target, parameters = self.expression.text, self.expression.target, self.parameters
        sizes = {_scale(p): partial(_size, self.expression, parameters, p) for p in parameters}
        starts = {p: partial(_start, self.expression, parameters, p) for p in parameters}
        return Effect(
            name=self.name,
            parameters=tuple(Parameter(p, "", 1.0, target == "v", scale=_scale(p)) for p in parameters),
            summary="an effect of one's own.",
            formula=text if "+=" in text else f"v += {text}",
            symptom="the residual follows the expression.",
            excited_by="what changes the variables of the expression.",
            confused_with="",
            source="the user.",
            needs=self.needs(),
            kinds=KINDS if target == "v" else ("poses", "motion"),
            constants=sizes,
            pose=self.pose if self.on_angle else None,
            transduction=None if self.on_angle else self.added,
            starts={} if linear(self.expression.root, parameters) == parameters else starts,
            expression=text,
        )

    def needs(self) -> tuple[str, ...]:
        """Columns without which it has no value."""
        variables = [word for word in self.expression.names if word not in {*FORCES, *self.parameters}]
        target = self.expression.target
        of_target = [] if target == "v" else [target if self.on_angle else f"{target}_v"]
        return tuple(dict.fromkeys([COLUMNS.get(word, word) for word in variables] + of_target))

    def pose(self, pose: Pose, table: Table, p: Values) -> Pose:
        """The pose with one of its angles changed."""
        values = variables(self.expression.names, table)
        values |= {"alpha": pose.alpha, "beta": pose.beta, "mount": pose.mount}
        angle = self.expression.target.removesuffix("_deg")
        return replace(pose, **{angle: getattr(pose, angle) + np.radians(self._value(values, p, (table.n,)))})

    def added(self, a: Array, table: Table, p: Values) -> Array:
        """What is added to the outputs, shape (n, 3)."""
        columns = variables(self.expression.names, table) | forces(a)
        values = {name: column[:, None] for name, column in columns.items()}
        target, out, axes = self.expression.target, np.zeros(a.shape), len(table.axes)
        if target == "v":
            out[:, :axes] = self._value(values, {name: p[name][:axes] for name in self.parameters}, (len(a), axes))
        else:
            out[:, [AXES.index(target[1])]] = self._value(values, p, (len(a), 1))
        return out

    def _value(self, values: Mapping[str, Array], p: Values, shape: tuple[int, ...]) -> Array:
        """The expression's value. Raises ExpressionError where it is no number."""
        values = {**values, **{name: p[name] for name in self.parameters}}
        result = evaluate(self.expression.root, values)
        if not np.isfinite(result).all():
            raise self._no_number(values)
        return np.clip(np.broadcast_to(result, shape), -LARGEST, LARGEST)

    def _no_number(self, values: Mapping[str, Array]) -> ExpressionError:
        """Names the innermost part that is no number, and the first row where."""
        parts = [n for n in nodes(self.expression.root) if not np.isfinite(evaluate(n, values)).all()]
        row = int(np.argmax(~np.isfinite(np.atleast_2d(evaluate(parts[-1], values))).all(axis=-1)))
        at = ", ".join(f"{name} = {np.ravel(values[name])[0]:.4g}" for name in self.parameters)
        return self.expression.fault(
            getattr(parts[-1], "at", 0),
            f"{self.name} is no number on row {row + 1}, with {at}; keep divisors away from 0, and above 0 what log, "
            "sqrt or a broken power is taken of",
        )

    def check(self) -> None:
        """Refuse what is no effect. Raises ExpressionError."""
        for word, at in self.expression.names.items():
            if word in MEASURED:
                raise self.expression.fault(at, f"{word} is what is measured; write the effect in ax, ay, az instead")
            if self.on_angle and word in FORCES:
                raise self.expression.fault(at, f"{word} follows from the stage angles; write this in alpha and beta")
        if not self.parameters:
            raise ExpressionError(
                f"{self.expression.text}: there is nothing to be fitted; all of its names are columns. Multiply it by "
                "a parameter, which is any other name, as in a*sin(beta)"
            )
        if len(self.parameters) > MOST_PARAMETERS:
            raise ExpressionError(f"{self.expression.text}: has more than {MOST_PARAMETERS} parameters")


def _scale(parameter: str) -> str:
    """The constant that keeps a parameter's size on the data that it was first fitted to."""
    return f"scale of {parameter}"


def _size(expression: Expression, parameters: tuple[str, ...], parameter: str, table: Table) -> float:
    return scales(expression, parameters, table)[parameter]


def _start(expression: Expression, parameters: tuple[str, ...], parameter: str, table: Table) -> Array:
    return best_start(expression, parameters, table)[parameter]
