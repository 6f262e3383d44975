"""The effects at a place of the signal chain as a curve over its driver, with band, symmetry and expression.

A curve is the contribution of the effects of the place to the final model's prediction, effects of the catalogue and
free form together, averaged over poses of the same driver. It has no constant and linear parts over the forces, which
belong to bias, scale factor and geometry. The band is the standard uncertainty by the parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.discovery.findings import Findings
from calibrations.fitting.fit import Fit, scales
from calibrations.fitting.identifiability import covariance
from calibrations.free_forms.effect import FreeForm, parameter_names
from calibrations.free_forms.form import CROSS, OUT_OF_PLANE, TILT, TURNING_AXES, Form
from calibrations.free_forms.place_names import PREFIX, place_of_effect
from calibrations.geometry.orientation import out_of_plane
from calibrations.model.chain import forward, respond, static_force
from calibrations.table import AXES, Array, Table

MOST_POINTS = 48  # of a curve
MOST_SAMPLES = 4000  # of a record along which a curve is drawn
STEP = 1e-3  # of a typical parameter: step of a numerical derivative
NEARLY_ALL = 0.9  # of the variance of a curve: it is even, or odd
DESCRIBED = 0.8  # of it that an expression must explain to be proposed
LESS_SIMPLE = 0.02  # of it that a less plain expression must explain beyond a plainer one
LEAST_STD = 0.02  # of a curve's rms: a smaller band does not weigh more
STEP_RAD = 1e-5  # of a numerical derivative by an angle
WAVES = 9  # in a turn, at most

DRIVERS = {  # place -> driver, its unit, factor of the curve
    "stage-angle-alpha": ("alpha_deg", "deg", "angle"),
    "stage-angle-beta": ("beta_deg", "deg", "angle"),
    "own-response": ("own force", "g", ""),
    "cross-response": ("force along the other axis", "g", ""),
    "z-response": ("force out of the plane", "g", ""),
    "scale-over-cross": ("force along the other axis", "g", "force"),
    "scale-over-z": ("force out of the plane", "g", "force"),
    "beta-bias": ("beta_deg", "deg", ""),
    "temperature-bias": ("temperature_c", "degC", ""),
    "temperature-scale": ("temperature_c", "degC", "force"),
    "time-bias": ("t_s", "s", ""),
    "time-scale": ("t_s", "s", "force"),
    "output": ("output", "{out}", ""),
}  # and a logged column
TURNS = {TILT: ("t_s", "s"), TURNING_AXES: ("temperature_c", "degC")}  # place -> driver of its angles, its unit


@dataclass(frozen=True)
class PlaceCurve:
    """The curve of a place. `value` and `std` by axis, shape (m,), over `at` by axis, (m,), in `unit`.

    Stage angles have one curve for all axes, under the name of the angle; turns of the base have one about each axis,
    and turns of the sensing axes one from each axis towards each other one.
    `explained` has the part of the effects of the catalogue alone.
    """

    place: str
    driver: str
    driver_unit: str
    unit: str
    at: Mapping[str, Array]
    value: Mapping[str, Array]
    std: Mapping[str, Array]
    explained: Mapping[str, Array]

    @property
    def largest(self) -> str:
        """The axis with the largest curve."""
        return max(self.value, key=lambda axis: float(np.std(self.value[axis])))

    @cached_property
    def symmetry(self) -> str:
        """The symmetry of the largest curve, in words; "" without one."""
        axis = self.largest
        return _symmetry(self.driver, self.at[axis], self.value[axis])

    @cached_property
    def expression(self) -> str | None:
        """An expression that describes the largest curve and can be added; None where none does."""
        if self.place in TURNS:  # no expression turns the base or an axis
            return None
        axis = self.largest
        return _propose_expression(self, axis, self.at[axis], self.value[axis], self.std[axis])


def place_curves(findings: Findings[Fit]) -> dict[str, PlaceCurve]:
    """By name, the curve of each acting place of a search; places without a single driver have none."""
    end = findings.end
    curves = (place_curve(end, place.name) for place in findings.places)
    return {curve.place: curve for curve in curves if curve is not None}


def place_curve(end: Fit, place: str) -> PlaceCurve | None:
    """The curve of a place in a fitted model; None without an effect there, or without a single driver."""
    if place in TURNS:
        return _turns(end, place)
    names = [term.name for term in end.model.terms if place_of_effect(term.name) == place]
    place_driver = DRIVERS.get(place) or _find_logged_column(place, end.problem.samples)
    if not names or place_driver is None:
        return None
    driver, driver_unit, factor = place_driver
    rows = CurveRows.of(end)
    groups = _groups(rows, place, driver, factor)
    base = None if factor == "angle" else [_base(driver, factor, x, weight) for _, x, weight in groups.values()]
    value, std = _contribution(rows, names, base)
    effect_names = [name for name in names if not name.startswith(PREFIX)]
    explained = _contribution(rows, effect_names, base)[0] if effect_names else np.zeros(value.shape)
    abscissas, values, bands, parts = {}, {}, {}, {}
    for axis, (channels, x, weight) in groups.items():
        averaged = _average_curve(
            x, weight, value[channels].ravel(), std[channels].ravel(), explained[channels].ravel()
        )
        abscissas[axis], values[axis], bands[axis], parts[axis] = averaged
    if not abscissas:
        return None
    unit = {"": end.table.unit, "force": f"{end.table.unit}/g", "angle": "deg"}[factor]
    driver_unit = driver_unit.replace("{out}", end.table.unit)
    return PlaceCurve(place, driver, driver_unit, unit, abscissas, values, bands, parts)


@dataclass(frozen=True)
class CurveRows:
    """The rows along which a curve is drawn: poses, or samples whose force follows from the outputs or from the motion.

    `force`: what drives the place, g, (n, 3).
    """

    end: Fit
    table: Table
    force: Array

    @staticmethod
    def of(end: Fit) -> CurveRows:
        """Those of a fitted model; of a long record a part."""
        if end.table.type.stage_angles:
            return CurveRows(end, end.table, static_force(end.table, end.problem.layout.steps(end.theta)))
        samples, force = end.problem.samples, end.problem.sensed(end.theta)
        kept = np.arange(0, samples.n, 1 + samples.n // MOST_SAMPLES)
        return CurveRows(end, samples.rows(kept), force[kept])

    def output(self, theta: Array, without: Sequence[str] = ()) -> Array:
        """The output of each axis by a model without some of its effects, (channels, n)."""
        steps = [step for step in self.end.problem.layout.steps(theta) if step[0].name not in without]
        if self.end.table.type.stage_angles:
            return forward(self.table, steps).T
        return respond(self.force, self.table, steps)[:, : len(self.table.axes)].T

    def contribution(self, names: Sequence[str]) -> Array:
        """What effects add to the output of each axis, without its mean, (channels, n)."""
        added = self.output(self.end.theta) - self.output(self.end.theta, without=names)
        return np.asarray(added - added.mean(axis=1, keepdims=True))

    def slope(self, mask: NDArray[np.bool_]) -> Array:
        """d output / d these parameters, but for its sign, (channels, n, p)."""
        end = self.end
        if end.table.type.stage_angles:
            return end.jacobian[:, :, mask]
        steps = STEP * end.problem.layout.typical[mask, None] * np.eye(len(end.theta))[mask]
        changes = [(self.output(end.theta + step) - self.output(end.theta - step)) / (2 * step.sum()) for step in steps]
        return np.stack(changes, axis=2)


def _turns(end: Fit, place: str) -> PlaceCurve | None:
    """Turns from their mean: of the base about each axis, or of each sensing axis towards the others; None without."""
    terms = end.model.terms
    at = next((i for i, term in enumerate(terms) if term.name == f"{PREFIX}{place}"), None)
    effect = None if at is None else terms[at].effect
    if not isinstance(effect, FreeForm):
        return None
    cov, slots = covariance(end.information, end.problem.layout.typical)[0], end.problem.layout.slots
    driver, driver_unit = TURNS[place]
    column = end.table.time_s if driver == "t_s" else end.table.column(driver)
    x = np.linspace(column.min(), column.max(), MOST_POINTS)
    values, bands = {}, {}
    for form in effect.forms:
        for k, axis in enumerate(("",) if form.shared else end.table.axes):
            names = parameter_names(form, k)
            mask = np.array([s.term == at and s.axis == axis and s.parameter.name in names for s in slots])
            if not mask.any():
                continue
            columns = form.columns_at(x, k)
            columns = np.degrees(columns - columns.mean(axis=0)) / (1.0 if form.shared else scales(end)[k])
            name = _turn_name(form, k)
            values[name] = columns @ end.theta[mask]
            bands[name] = np.sqrt(np.sum((columns @ cov[np.ix_(mask, mask)]) * columns, axis=1))
    none = {name: np.zeros(len(x)) for name in values}
    return PlaceCurve(place, driver, driver_unit, "deg", dict.fromkeys(values, x), values, bands, none)


def _turn_name(form: Form, k: int) -> str:
    """Such as "about-x" of the base, or "x to z" of a sensing axis."""
    return form.name if form.shared else f"{AXES[k]} to {AXES[(CROSS if form.factor == 'cross' else OUT_OF_PLANE)[k]]}"


def _find_logged_column(place: str, table: Table) -> tuple[str, str, str] | None:
    name = place.removeprefix("column:")
    return (name, "", "") if name != place and name in table else None


def _base(driver: str, factor: str, x: Array, weight: Array) -> Array:
    """Orthonormal columns (n, k) of bias, scale factor and geometry, which are part of no curve."""
    force = [weight] if factor else [x] if "force" in driver else []
    return np.asarray(np.linalg.qr(np.column_stack([np.ones(len(x)), *force]))[0])


def _contribution(rows: CurveRows, names: list[str], base: list[Array] | None) -> tuple[Array, Array]:
    """Contribution of effects to the output off the base, and its standard uncertainty, (channels, n)."""
    end = rows.end
    value = rows.output(end.theta) - rows.output(end.theta, without=names)
    mask = np.any([end.problem.layout.of_effect(name) for name in names], axis=0)
    cov = covariance(end.information, end.problem.layout.typical)[0][np.ix_(mask, mask)]
    J = rows.slope(mask)
    if base is not None:
        value = np.stack([v - Q @ (Q.T @ v) for v, Q in zip(value, base, strict=True)])
        J = np.stack([j - Q @ (Q.T @ j) for j, Q in zip(J, base, strict=True)])
    return value, np.sqrt(np.maximum(np.einsum("cni,ij,cnj->cn", J, cov, J), 0.0))


def _groups(rows: CurveRows, place: str, driver: str, factor: str) -> dict[str, tuple[list[int], Array, Array]]:
    """By axis: channels, driver of the place, and factor of the curve, for all their rows."""
    table, force, count = rows.table, rows.force, len(rows.table.axes)
    if factor == "angle":
        channels = list(range(count))
        weight = np.concatenate([_by_angle(rows.end, place)[k] for k in channels])
        return {place.removeprefix("stage-angle-"): (channels, np.tile(table.column(driver), count), weight)}
    groups = {}
    for k, axis in enumerate(table.axes):
        x = {
            "own force": force[:, k],
            "force along the other axis": force[:, CROSS[k]],
            "force out of the plane": out_of_plane(force)[:, k],
            "output": table.outputs[:, k],
        }.get(driver)
        x = table.column(driver) if x is None else x
        groups[axis] = [k], x, force[:, k] if factor == "force" else np.ones(table.n)
    return groups


def _by_angle(end: Fit, place: str) -> Array:
    """d output / d stage angle, per deg, (channels, n)."""
    name = f"{place.removeprefix('stage-angle-')}_deg"
    steps = end.problem.layout.steps(end.theta)

    def shifted(change: float) -> Array:
        columns = {**end.table.columns, name: end.table.column(name) + change}
        return forward(_with(end.table, columns), steps)

    return np.asarray((shifted(STEP_RAD) - shifted(-STEP_RAD)).T / (2 * STEP_RAD))


def _with(table: Table, columns: Mapping[str, Array]) -> Table:
    return Table(table.kind, columns, table.constants, table.source, table.labels, table.numbers, table.noise)


def _average_curve(
    x: Array, weight: Array, value: Array, std: Array, explained: Array
) -> tuple[Array, Array, Array, Array]:
    """A curve f with value = weight f(x), by least squares at each of at most MOST_POINTS places along x."""
    distinct = np.unique(np.round(x, 6))
    if len(distinct) <= MOST_POINTS:
        part = np.searchsorted(distinct, np.round(x, 6))
    else:
        edges = np.quantile(x, np.linspace(0, 1, MOST_POINTS + 1))
        part = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, MOST_POINTS - 1)
    squares = np.bincount(part, weight**2)
    occupied = np.flatnonzero(squares > 1e-6 * squares.max())
    rows = np.bincount(part)
    abscissas = (np.bincount(part, x) / np.maximum(rows, 1))[occupied]

    def mean(values: Array) -> Array:
        return np.asarray((np.bincount(part, weight * values) / np.where(squares > 0, squares, 1.0))[occupied])

    band = np.sqrt(np.bincount(part, (weight * std) ** 2 * rows[part]) / np.where(squares > 0, squares, 1.0) ** 2)
    return abscissas, mean(value), band[occupied], mean(explained)


def _symmetry(driver: str, x: Array, value: Array) -> str:
    if len(x) < 6 or not np.ptp(value) > 0:
        return ""
    if driver == "beta_deg":
        k = int(np.argmax([_share(_wave(np.radians(x), k), value) for k in range(1, WAVES + 1)])) + 1
        return f"{k} wave{'s' * (k > 1)} in a turn of beta"
    middle = 0.0 if "force" in driver else (x.min() + x.max()) / 2
    half = min(x.max() - middle, middle - x.min())
    if half <= 0:
        return ""
    u = np.linspace(-half, half, 41)
    v = np.interp(middle + u, x, value)
    v = v - v.mean()
    even = float(np.sum(((v + v[::-1]) / 2) ** 2) / np.sum(v**2)) if np.any(v) else 0.0
    centre = f"about {middle:.3g}"
    if even > NEARLY_ALL:
        return f"even {centre}"
    return f"odd {centre}" if even < 1 - NEARLY_ALL else f"neither even nor odd {centre}"


def _wave(x: Array, k: float) -> Array:
    return np.column_stack([np.sin(k * x), np.cos(k * x)])


def _propose_expression(curve: PlaceCurve, axis: str, x: Array, value: Array, std: Array) -> str | None:
    """The simplest expression that explains nearly as much of the curve as the best one."""
    variable = _variable(curve.driver, axis)
    if variable is None or len(x) < 6 or not np.ptp(value) > 0:
        return None
    line = "force" in curve.driver  # constant and line over a force belong to bias and geometry
    base = np.column_stack([np.ones(len(x)), x] if line else [np.ones(len(x))])
    weight = 1 / np.maximum(std, LEAST_STD * float(np.std(value)))
    total_squares = _residual_squares(np.ones((len(x), 1)), value, weight)
    base_squares = _residual_squares(base, value, weight)
    best: tuple[float, str] | None = None
    for columns, text in _shapes(curve, x, variable):
        share = (
            1 - _residual_squares(np.column_stack([base, columns]), value, weight) / base_squares
            if base_squares > 1e-12 * total_squares
            else 0.0
        )
        if share > DESCRIBED and (best is None or share > best[0] + LESS_SIMPLE):
            best = share, text
    if best is None:
        return None
    if curve.unit == "deg":
        return f"{curve.driver} += {best[1]}"
    target = "v" if not line and not curve.unit.endswith("/g") else f"v{axis}"
    return f"{target} += {f'a{axis}*(' if curve.unit.endswith('/g') else ''}{best[1]}{')' * curve.unit.endswith('/g')}"


def _variable(driver: str, axis: str) -> str | None:
    """The driver's name in an expression; None where it has none."""
    cross_axis = {"x": "y", "y": "x", "z": "x"}.get(axis, "")
    words = {
        "alpha_deg": "alpha", "beta_deg": "beta", "temperature_c": "temperature", "t_s": "t", "supply_v": "supply",
        "own force": f"a{axis}", "force along the other axis": f"a{cross_axis}", "force out of the plane": "az",
        "output": None,
    }  # fmt: skip
    return words.get(driver, driver)


def _shapes(curve: PlaceCurve, x: Array, u: str) -> Iterator[tuple[Array, str]]:
    """Columns of shapes over x with their expressions, the simplest first."""
    if curve.unit == "deg":
        turned = np.radians(x)
        for k in range(1, WAVES + 1):
            yield _wave(turned, k), f"a*sin({k}*{u}) + b*cos({k}*{u})" if k > 1 else f"a*sin({u}) + b*cos({u})"
        return
    if "force" not in curve.driver:
        yield x[:, None], f"a*{u}"
    span = float(np.ptp(x)) or 1.0
    if "force" not in curve.driver:
        z = (x - (x.min() + x.max()) / 2) / span
        yield np.column_stack([z, z**2]), f"a*({u} - b)**2"
    else:
        yield x[:, None] ** 2, f"a*{u}**2"
        yield x[:, None] ** 3, f"a*{u}**3"
        yield np.abs(x)[:, None], f"a*abs({u})"
        yield (x * np.abs(x))[:, None], f"a*{u}*abs({u})"
        yield x[:, None] ** 4, f"a*{u}**4"
    if curve.driver == "t_s":
        yield from (
            (np.exp(-(x - x.min()) / (s * span))[:, None], f"a*exp(-{u}/c)") for s in (0.03, 0.1, 0.2, 0.4, 0.8)
        )
    for s in (0.05, 0.1, 0.2, 0.4):
        for c in np.linspace(x.min() + 0.1 * span, x.max() - 0.1 * span, 9):
            yield np.tanh((x - c) / (s * span))[:, None], f"a*tanh(({u} - b)/c)"
    for c in np.linspace(x.min() + 0.1 * span, x.max() - 0.1 * span, 17):
        yield np.maximum(x - c, 0)[:, None], f"a*max({u} - b, 0)"
    for waves in np.arange(0.5, 6.1, 0.25):
        yield _wave(x, 2 * np.pi * waves / span), f"a*sin(c*{u}) + b*cos(c*{u})"


def _residual_squares(columns: Array, value: Array, weight: Array) -> float:
    X, y = columns * weight[:, None], value * weight
    size = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    remainder = y - X @ (np.linalg.lstsq(X / size, y, rcond=1e-9)[0] / size)
    return float(remainder @ remainder)


def _share(columns: Array, value: Array) -> float:
    constant = np.ones(len(value))
    total = _residual_squares(constant[:, None], value, constant)
    return 1 - _residual_squares(np.column_stack([constant, columns]), value, constant) / total if total > 0 else 0.0
