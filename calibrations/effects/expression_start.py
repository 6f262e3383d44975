"""Where the fit of an expression begins: values tried over all that its parameters could mean on the data.

A parameter's range follows from what it stands beside: a time constant from the length of the record, a threshold from
the range of its column, a frequency from how many waves the rows could show. For each trial of the parameters that
bend the expression, the others follow by least squares beside bias and forces (variable projection: Golub and Pereyra,
1973).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product

import numpy as np

from calibrations.effects.expression import Apply, Expression, Name, Node, evaluate, forces, variables
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.table import AXES, Array, Table

MOST_TRIALS = 800
ZOOMS = 7  # rounds about the best trial, each three times as fine
ANGLE_DEG = 10.0  # what could be added to a stage angle at most
FAINT = 0.01  # of a parameter's size, to begin with where nothing can be tried
REAL = 1e-9  # of a column's length: what is left of less is rounding
WAVES = ("sin", "cos", "tan")
LEVELS = 80
HALF_WAVES = 120  # along a column
EXPONENTS = (-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
ANY = np.logspace(-3, 3, 25)
CURVED = 2  # of a degree: any more than 1
Names = tuple[str, ...]


@lru_cache(maxsize=32)
def best_start(expression: Expression, parameters: Names, table: Table) -> Mapping[str, Array]:
    """The best start of each parameter, shape (axes,): the same for all axes unless the output of all is added to."""
    axes = len(table.axes)
    known = scales(expression, parameters, table)
    straight = linear(expression.root, parameters)
    if table.type.magnitude:  # the forces are not known beforehand
        return {p: np.full(axes, known[p] * (FAINT if p in straight else 1.0)) for p in parameters}
    groups = [(k,) for k in range(axes)] if expression.target == "v" else [tuple(range(axes))]
    found = [_Search(expression, parameters, table, group).best() for group in groups]
    return {p: np.array([each[p] for each in found * (axes // len(found))]) for p in parameters}


@lru_cache(maxsize=32)
def scales(expression: Expression, parameters: Names, table: Table) -> Mapping[str, float]:
    """What each parameter may be worth at most; of one that multiplies, what moves the output over all its range."""
    straight, root = linear(expression.root, parameters), expression.root
    values = {**dict.fromkeys(parameters, np.zeros(1)), **_variables(expression, table)}
    found = {p: float(np.median(np.abs(trials(root, p, values)))) or 1.0 for p in parameters if p not in straight}
    values |= {p: np.full(1, scale) for p, scale in found.items()}
    whole = ANGLE_DEG if expression.target.endswith("_deg") else _output_range(table)
    for p in straight:
        column = evaluate(root, {**values, p: np.ones(1)}) - evaluate(root, values)
        found[p] = whole / (_spread(column) or 1.0)
    return found


def _output_range(table: Table) -> float:
    return float(np.median(np.ptp(table.outputs, axis=0))) or 1.0


def _spread(column: Array) -> float:
    """How far a column moves; its size where it does not move; 0 where it is none."""
    spread = float(np.ptp(column)) or float(np.max(np.abs(column)))
    return spread if np.isfinite(spread) else 0.0


def _variables(expression: Expression, table: Table) -> dict[str, Array]:
    return variables(expression.names, table) | forces(specific_force(nominal_pose(table)))


@dataclass(frozen=True)
class _Search:
    """The outputs of some axes, freed of bias and forces, and an expression to be laid through them."""

    expression: Expression
    parameters: Names
    table: Table
    axes: tuple[int, ...]

    @cached_property
    def straight(self) -> Names:
        """Parameters that follow by least squares."""
        return linear(self.expression.root, self.parameters)

    @cached_property
    def values(self) -> dict[str, Array]:
        """Variables, and 0 for each parameter."""
        return {**dict.fromkeys(self.parameters, np.zeros(1)), **_variables(self.expression, self.table)}

    @cached_property
    def grids(self) -> dict[str, Array]:
        """Trials of each of the other parameters."""
        curved = [p for p in self.parameters if p not in self.straight]
        return {p: np.unique(trials(self.expression.root, p, self.values)) for p in curved}

    def best(self) -> dict[str, float]:
        """The parameters of the best trial."""
        names, grids = list(self.grids), list(self.grids.values())
        tried = [dict(zip(names, each, strict=True)) for each in _combinations(grids)]
        found = min(tried, key=lambda each: self.fitted(each)[0])
        steps = {name: _spacing(grid, found[name]) for name, grid in self.grids.items()}
        for k, name in product(range(ZOOMS), names):
            near = found[name] + steps[name] / 3**k * np.linspace(-1, 1, 9)
            found = min([{**found, name: float(value)} for value in near], key=lambda each: self.fitted(each)[0])
        return {**found, **dict(zip(self.straight, self.fitted(found)[1], strict=True))}

    def fitted(self, curved: Mapping[str, float]) -> tuple[float, Array]:
        """(sum of squares left, the straight parameters); infinite where the expression is no number."""
        at = {**self.values, **{name: np.full(1, value) for name, value in curved.items()}}
        alone = self.column(at)
        each = [self.column({**at, name: np.ones(1)}) - alone for name in self.straight]
        columns, rest = np.column_stack([*each, alone])[:, :-1], self.free(self.outputs - alone)
        if not (np.isfinite(columns).all() and np.isfinite(rest).all()):
            return np.inf, np.zeros(len(self.straight))
        size = np.linalg.norm(columns, axis=0)
        freed = np.column_stack([*(self.free(c) for c in columns.T), rest])[:, :-1]
        real = np.linalg.norm(freed, axis=0) > REAL * size
        scaled = np.where(real, freed / np.where(real, size, 1.0), 0.0)
        by = np.linalg.lstsq(scaled, rest, rcond=REAL)[0]
        return float(np.sum((rest - scaled @ by) ** 2)), np.where(real, by / np.where(real, size, 1.0), 0.0)

    def column(self, values: Mapping[str, Array]) -> Array:
        """What the expression adds to the outputs, axis after axis, shape (axes * n,)."""
        added = np.broadcast_to(evaluate(self.expression.root, values), (self.table.n,))
        return (self.weights * added[:, None])[:, self.axes].T.ravel()

    @cached_property
    def weights(self) -> Array:
        """What one unit of the target does to each output, shape (n, axes)."""
        target, table = self.expression.target, self.table
        if target == "v":
            return np.ones((table.n, len(table.axes)))
        if target.startswith("v"):
            return np.tile([float(axis == target[1]) for axis in AXES[: len(table.axes)]], (table.n, 1))
        pose, angle = nominal_pose(table), target.removesuffix("_deg")
        turned = replace(pose, **{angle: getattr(pose, angle) + np.radians(1e-3)})
        per_deg = (specific_force(turned) - specific_force(pose)) / 1e-3
        return per_deg[:, : len(table.axes)] * _output_range(table) / 2

    @cached_property
    def outputs(self) -> Array:
        """Axis after axis, shape (axes * n,)."""
        return self.table.outputs[:, self.axes].T.ravel()

    @cached_property
    def _model(self) -> Array:
        a = specific_force(nominal_pose(self.table))
        return np.asarray(np.linalg.qr(np.column_stack([np.ones(len(a)), a]))[0])

    def free(self, column: Array) -> Array:
        """The column without what bias and forces of each axis explain."""
        each = column.reshape(len(self.axes), -1)
        return np.asarray(each - (each @ self._model) @ self._model.T).ravel()


def _combinations(grids: list[Array]) -> list[tuple[float, ...]]:
    """All combinations, or as many as there is time for, chosen alike every time."""
    if np.prod([float(len(grid)) for grid in grids]) <= MOST_TRIALS:
        return [tuple(map(float, each)) for each in product(*grids)]
    rng = np.random.default_rng(len(grids))
    chosen = [rng.choice(grid, MOST_TRIALS) for grid in grids]
    return [tuple(map(float, each)) for each in zip(*chosen, strict=True)]


def _spacing(grid: Array, at: float) -> float:
    """Distance to the farther neighbour on the grid."""
    k = int(np.searchsorted(grid, at))
    return float(np.max(np.abs(grid[max(k - 1, 0) : k + 2] - at))) or 1.0


def trials(root: Node, name: str, values: Mapping[str, Array]) -> Array:
    """Values to try for the parameter `name`, shape (k,); `values` has all names, 0 for the parameters."""
    path = _path(root, name)
    if not path:
        return _both(ANY)
    operation, inner = path[-1].operation.name, path[-1].inner
    first = _is(inner[0], name)
    in_wave = any(each.operation.name in WAVES for each in path)
    if in_wave and operation in "+-":
        return np.linspace(-np.pi, np.pi, 24, endpoint=False)
    others = [evaluate(each, values) for each in inner if not _is(each, name)]
    beside = np.unique(np.concatenate([np.ravel(each) for each in others])) if others else np.zeros(0)
    beside = beside[np.isfinite(beside)]
    if not len(beside) or not np.any(beside):
        return _both(ANY)
    span = float(np.ptp(beside)) or float(np.max(np.abs(beside)))
    match operation:
        case "+":
            return -_levels(beside)
        case "-" | "<" | "<=" | ">" | ">=" | "min" | "max" | "where":
            return _levels(beside)
        case "*" if in_wave:
            return np.arange(1.0, max(2, min(HALF_WAVES, len(beside)))) * np.pi / span  # no faster than rows can show
        case "*":
            return _both(np.logspace(-1.5, 1.5, 25) / span)
        case "/" if not first:
            return _both(np.logspace(-2.5, 1, 29) * span)
        case "**" if not first:
            return np.array(EXPONENTS)
    return _both(ANY * span)


def _path(node: Node, name: str) -> list[Apply]:
    """The operations from `node` down to that which has the parameter among its arguments."""
    if not isinstance(node, Apply):
        return []
    if any(_is(each, name) for each in node.inner) and node.operation.name not in ("neg", "pos"):
        return [node]
    return next(([node, *below] for each in node.inner if (below := _path(each, name))), [])


def _is(node: Node, name: str) -> bool:
    """Whether the node is the parameter, of either sign."""
    if isinstance(node, Apply) and node.operation.name in ("neg", "pos"):
        return _is(node.inner[0], name)
    return isinstance(node, Name) and node.name == name


def _levels(column: Array) -> Array:
    """Levels between neighbouring values of a column of sorted values."""
    if len(column) == 1:
        return np.unique(np.append(_both(ANY * abs(column[0])), column))
    between = (column[1:] + column[:-1]) / 2
    return np.asarray(between[np.unique(np.linspace(0, len(between) - 1, LEVELS).astype(int))])


def _both(positive: Array) -> Array:
    return np.concatenate([-positive[::-1], positive])


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
