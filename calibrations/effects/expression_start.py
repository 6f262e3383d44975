"""Start values for the fit of an expression, from trials over the plausible range of its parameters.

The range of a parameter follows from its operands: a time constant from the length of the record, a threshold from the
range of its column, a frequency from the number of waves that the rows can show. For each trial of the nonlinear
parameters, least squares together with bias and forces give the linear ones (variable projection: Golub and Pereyra,
1973).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product

import numpy as np

from calibrations.effects.expression import Apply, Expression, Name, Node, evaluate, forces, variables
from calibrations.geometry.orientation import nominal_pose, reported_force, specific_force
from calibrations.table import AXES, Array, Table

LARGEST_TRIALS = 800
ZOOMS = 7  # rounds about the best trial, each three times as fine
ANGLE_DEG = 10.0  # largest addition to a stage angle
FAINT = 0.01  # of a parameter's size: its start where no trial is possible
REAL = 1e-9  # of a column's length: a smaller remainder is rounding
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
    sizes = scales(expression, parameters, table)
    linear_names = find_linear_parameters(expression.root, parameters)
    if table.type.magnitude:  # the forces are not known before the fit
        return {p: np.full(axes, sizes[p] * (FAINT if p in linear_names else 1.0)) for p in parameters}
    groups = [(k,) for k in range(axes)] if expression.target == "v" else [tuple(range(axes))]
    starts = [_Search(expression, parameters, table, group).best() for group in groups]
    return {p: np.array([start[p] for start in starts * (axes // len(starts))]) for p in parameters}


@lru_cache(maxsize=32)
def scales(expression: Expression, parameters: Names, table: Table) -> Mapping[str, float]:
    """The largest plausible size of each parameter; a linear one of this size moves the output over its range."""
    linear_names, root = find_linear_parameters(expression.root, parameters), expression.root
    values = {**dict.fromkeys(parameters, np.zeros(1)), **_variables(expression, table)}
    sizes = {p: float(np.median(np.abs(trials(root, p, values)))) or 1.0 for p in parameters if p not in linear_names}
    values |= {p: np.full(1, scale) for p, scale in sizes.items()}
    output_range = ANGLE_DEG if expression.target.endswith("_deg") else _output_range(table)
    for p in linear_names:
        column = evaluate(root, {**values, p: np.ones(1)}) - evaluate(root, values)
        sizes[p] = output_range / (_spread(column) or 1.0)
    return sizes


def _output_range(table: Table) -> float:
    return float(np.median(np.ptp(table.outputs, axis=0))) or 1.0


def _spread(column: Array) -> float:
    """Range of a column; its size if it is constant; 0 if it is not finite."""
    spread = float(np.ptp(column)) or float(np.max(np.abs(column)))
    return spread if np.isfinite(spread) else 0.0


def _variables(expression: Expression, table: Table) -> dict[str, Array]:
    return variables(expression.names, table) | forces(reported_force(table))


@dataclass(frozen=True)
class _Search:
    """A search for the parameters of an expression that fit the outputs of some axes without bias and forces."""

    expression: Expression
    parameters: Names
    table: Table
    axes: tuple[int, ...]

    @cached_property
    def straight(self) -> Names:
        """Parameters that follow by least squares."""
        return find_linear_parameters(self.expression.root, self.parameters)

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
        points = [dict(zip(names, point, strict=True)) for point in _combinations(grids)]
        best_point = min(points, key=lambda point: self.fitted(point)[0])
        steps = {name: _spacing(grid, best_point[name]) for name, grid in self.grids.items()}
        for k, name in product(range(ZOOMS), names):
            values = best_point[name] + steps[name] / 3**k * np.linspace(-1, 1, 9)
            points = [{**best_point, name: float(value)} for value in values]
            best_point = min(points, key=lambda point: self.fitted(point)[0])
        return {**best_point, **dict(zip(self.straight, self.fitted(best_point)[1], strict=True))}

    def fitted(self, curved: Mapping[str, float]) -> tuple[float, Array]:
        """(residual sum of squares, linear parameters); infinite where the expression has no value."""
        values = {**self.values, **{name: np.full(1, value) for name, value in curved.items()}}
        constant_part = self.column(values)
        columns_by_name = [self.column({**values, name: np.ones(1)}) - constant_part for name in self.straight]
        columns = np.column_stack([*columns_by_name, constant_part])[:, :-1]
        remainder = self.free(self.outputs - constant_part)
        if not (np.isfinite(columns).all() and np.isfinite(remainder).all()):
            return np.inf, np.zeros(len(self.straight))
        size = np.linalg.norm(columns, axis=0)
        free_columns = np.column_stack([*(self.free(c) for c in columns.T), remainder])[:, :-1]
        independent = np.linalg.norm(free_columns, axis=0) > REAL * size
        scaled = np.where(independent, free_columns / np.where(independent, size, 1.0), 0.0)
        coefficients = np.linalg.lstsq(scaled, remainder, rcond=REAL)[0]
        unscaled = np.where(independent, coefficients / np.where(independent, size, 1.0), 0.0)
        return float(np.sum((remainder - scaled @ coefficients) ** 2)), unscaled

    def column(self, values: Mapping[str, Array]) -> Array:
        """Contribution of the expression to the outputs, axis after axis, shape (axes * n,)."""
        contribution = np.broadcast_to(evaluate(self.expression.root, values), (self.table.n,))
        return (self.weights * contribution[:, None])[:, self.axes].T.ravel()

    @cached_property
    def weights(self) -> Array:
        """Change of each output by one unit of the target, shape (n, axes)."""
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
        a = reported_force(self.table)
        return np.asarray(np.linalg.qr(np.column_stack([np.ones(len(a)), a]))[0])

    def free(self, column: Array) -> Array:
        """The column projected off bias and forces of each axis."""
        by_axis = column.reshape(len(self.axes), -1)
        return np.asarray(by_axis - (by_axis @ self._model) @ self._model.T).ravel()


def _combinations(grids: list[Array]) -> list[tuple[float, ...]]:
    """All combinations, or LARGEST_TRIALS of them by a fixed random choice."""
    if np.prod([float(len(grid)) for grid in grids]) <= LARGEST_TRIALS:
        return [tuple(map(float, values)) for values in product(*grids)]
    rng = np.random.default_rng(len(grids))
    choices = [rng.choice(grid, LARGEST_TRIALS) for grid in grids]
    return [tuple(map(float, values)) for values in zip(*choices, strict=True)]


def _spacing(grid: Array, value: float) -> float:
    """Distance to the farther neighbour on the grid."""
    k = int(np.searchsorted(grid, value))
    return float(np.max(np.abs(grid[max(k - 1, 0) : k + 2] - value))) or 1.0


def trials(root: Node, name: str, values: Mapping[str, Array]) -> Array:
    """Values to try for the parameter `name`, shape (k,); `values` has all names, 0 for the parameters."""
    path = _path(root, name)
    if not path:
        return _both_signs(ANY)
    operation, inner = path[-1].operation.name, path[-1].inner
    first = _is_parameter(inner[0], name)
    in_wave = any(node.operation.name in WAVES for node in path)
    if in_wave and operation in "+-":
        return np.linspace(-np.pi, np.pi, 24, endpoint=False)
    operands = [evaluate(node, values) for node in inner if not _is_parameter(node, name)]
    operand_values = np.unique(np.concatenate([np.ravel(node) for node in operands])) if operands else np.zeros(0)
    operand_values = operand_values[np.isfinite(operand_values)]
    if not len(operand_values) or not np.any(operand_values):
        return _both_signs(ANY)
    span = float(np.ptp(operand_values)) or float(np.max(np.abs(operand_values)))
    match operation:
        case "+":
            return -_levels(operand_values)
        case "-" | "<" | "<=" | ">" | ">=" | "min" | "max" | "where":
            return _levels(operand_values)
        case "*" if in_wave:
            half_waves = np.arange(1.0, max(2, min(HALF_WAVES, len(operand_values))))
            return half_waves * np.pi / span  # no faster than the rows can show
        case "*":
            return _both_signs(np.logspace(-1.5, 1.5, 25) / span)
        case "/" if not first:
            return _both_signs(np.logspace(-2.5, 1, 29) * span)
        case "**" if not first:
            return np.array(EXPONENTS)
    return _both_signs(ANY * span)


def _path(node: Node, name: str) -> list[Apply]:
    """The operations from `node` down to that which has the parameter among its arguments."""
    if not isinstance(node, Apply):
        return []
    if any(_is_parameter(inner_node, name) for inner_node in node.inner) and node.operation.name not in ("neg", "pos"):
        return [node]
    return next(([node, *tail] for inner_node in node.inner if (tail := _path(inner_node, name))), [])


def _is_parameter(node: Node, name: str) -> bool:
    """Whether the node is the parameter, of either sign."""
    if isinstance(node, Apply) and node.operation.name in ("neg", "pos"):
        return _is_parameter(node.inner[0], name)
    return isinstance(node, Name) and node.name == name


def _levels(column: Array) -> Array:
    """Levels between neighbouring values of a column of sorted values."""
    if len(column) == 1:
        return np.unique(np.append(_both_signs(ANY * abs(column[0])), column))
    midpoints = (column[1:] + column[:-1]) / 2
    return np.asarray(midpoints[np.unique(np.linspace(0, len(midpoints) - 1, LEVELS).astype(int))])


def _both_signs(positive: Array) -> Array:
    return np.concatenate([-positive[::-1], positive])


def find_linear_parameters(root: Node, parameters: Sequence[str]) -> tuple[str, ...]:
    """The longest list of leading parameters in which together the expression is of the first degree."""
    linear_names: list[str] = []
    for name in parameters:
        if degree(root, {*linear_names, name}) < CURVED:
            linear_names.append(name)
    return tuple(linear_names)


def degree(node: Node, names: set[str]) -> int:
    """The degree of `node` as a polynomial in `names`; CURVED for 2, more, or none."""
    if isinstance(node, Name):
        return int(node.name in names)
    if not isinstance(node, Apply):
        return 0
    degrees = [degree(inner, names) for inner in node.inner]
    match node.operation.name:
        case "+" | "-" | "neg" | "pos":
            return max(degrees)
        case "*":
            return min(sum(degrees), CURVED)
        case "/":
            return degrees[0] if not degrees[1] else CURVED
        case "where":
            return max(degrees[1:]) if not degrees[0] else CURVED
    return CURVED if any(degrees) else 0
