"""Geometry: which of misalignment, non-orthogonality, stage zeros and base tilt the linear parts need.

The linear parts of the fit are a vector q of small angles with a covariance. Each effect of the geometry turns the
forces by its own equations, which are exact: of angles of 1 deg the second order is many standard uncertainties. Its
parameters are fitted to q by Gauss-Newton steps. A place that acts over another axis may have a linear part of its own,
as large as the odd part of its curve: so much is added to the covariance before anything is asked, so that no
mechanism's linear part names a second cause. An even curve, such as that of cross-axis-bias, has a small one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations

import numpy as np

from calibrations.criteria import FORM_PART
from calibrations.free_forms.chain import Coefficients, ModelEffects, own_base_size, state_at
from calibrations.free_forms.form import CROSS
from calibrations.free_forms.search_result import SearchResult
from calibrations.geometry.orientation import out_of_plane
from calibrations.table import Array

GEOMETRY = ("axis-nonorthogonality", "axis-misalignment", "stage-zero-offset", "base-tilt")
CAUSE_PRICE, PARAMETER_PRICE = 12.0, 2.0  # of chi-square
CLOSE = 8.0  # of chi-square: the data cannot separate explanations that differ by less
LINEAR_PART = 2.0  # of a curve's odd part: the standard deviation of a mechanism's own linear part
EVEN_PART = 0.6  # the same of its even part: a square about another zero, at some 0.2 g
# A scale factor over z multiplies the force from the sensor's own zero, which is at some 50 mg: its line is u0 k z.
ZERO_PART = 0.1  # of a scale factor over another axis: the standard deviation of its linear part
# A gap that the out-of-plane force narrows gives a / (1 - k z): its line is to its square as this is to its cube, so
# that the odd part of its curve tells the line. A misalignment beside it still shows by its angle about z.
NARROWING, GAP_LINE = 0.05, 5.0  # least odd part of such a curve, and most of its line, both over the even part
EVEN, ODD = (2, 4, 6), (3, 5)  # powers of the driver
LEAST_LINE = 0.3  # noise floors: a smaller linear part is left out
SEEN = 3.5  # standard uncertainties: a smaller linear part may be noise
IMMATERIAL = 0.15  # noise floors: a smaller angle is no matter
STEPS = 4  # of Gauss-Newton: angles of some degrees need three
SMALL_DEG = 1e-3  # of a numerical derivative
# Over the cross axis also a product with the own force, as u^2 b = (1 - z^2 - b^2) b.
OVER_CROSS = ("cross-response", "scale-over-cross", "force")
OVER_Z = ("z-response", "force", "stage-angle-alpha", "scale-over-z")
OVER_BETA = ("beta-bias",)  # in one wave a turn, a quarter of a turn apart on x and y, it is a tilt of the base


@dataclass(frozen=True)
class GeometryEffects:
    """The effects of the geometry: number of parameters by name, and the forces that their values give.

    forces  specific force along the sensing axes, g, (n, 3), by values in deg of some of the effects
    given   those in the given model: they cost nothing
    """

    parameters: Mapping[str, int]
    forces: Callable[[Mapping[str, Array]], Array]
    given: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Geometry:
    """Which effects of the geometry are causes.

    sizes         what each of them adds to the output, rms, in noise floors
    refinements   what else the fit needs: angles that may as well be the form of something that acts
    alternatives  what else would do for each
    lines         linear parts that no cause bears, by place: output at 1 g, in its unit
    """

    causes: tuple[str, ...] = ()
    sizes: Mapping[str, float] = field(default_factory=dict)
    refinements: tuple[str, ...] = ()
    alternatives: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    lines: Mapping[str, float] = field(default_factory=dict)


def geometry(result: SearchResult, curves: Mapping[str, Array], effects: GeometryEffects) -> Geometry:
    """The geometry that the linear parts show.

    curves   what each acting place adds, (channels, n), in the output's unit
    """
    data, c = result.data, result.data.channels
    gain = np.array([result.values.base[c + 3 * k + k] for k in range(c)])
    floor, mean_gain = float(np.sqrt(np.mean(result.white**2))), float(np.mean(np.abs(gain)))
    if not mean_gain > 0:
        return Geometry()
    pick, hidden_by = _angles(result, gain)
    b = own_base_size(data)
    sizes = {place: float(np.sqrt(np.mean(curve**2))) for place, curve in curves.items()}
    lines_of = {place: _linear_part(result, place, curve) for place, curve in curves.items()}
    shift, covariance = _base_with_forms(result, sizes)
    C = pick @ covariance[:b, :b] @ pick.T
    C += np.diag(np.full(len(pick), (IMMATERIAL * floor / mean_gain) ** 2))
    line_angles = [
        2 * max((lines_of.get(place, 0.0) for place in places), default=0.0) / mean_gain for places in hidden_by
    ]
    outputs = partial(_linear_outputs, result, effects)
    linear = state_at(data, ModelEffects.without_effects(data), Coefficients(result.values.base[:b], {}), ()).predicted
    to_angles = pick @ (result.gram.base_inverse @ result.columns[:, : len(covariance)].T)[:b]

    def remaining_angles(values: Mapping[str, Array]) -> Array:
        return np.asarray(to_angles @ ((linear - outputs(values)) / result.white).ravel() + pick @ shift[:b])

    values, alternatives, _ = _cheapest_effects(
        remaining_angles, C + np.diag(np.square(line_angles)), effects, effects.given
    )
    sizes_of = {
        name: float(np.sqrt(np.mean((outputs(values) - outputs(_values_without(values, name))) ** 2))) / floor
        for name in values
    }
    refinements, _, residual_angles = _cheapest_effects(remaining_angles, C, effects, effects.given | values.keys())
    lines: dict[str, float] = {}
    for places, angle, uncertainty in zip(hidden_by, residual_angles, np.sqrt(np.diag(C)), strict=True):
        if places and abs(angle) > max(LEAST_LINE * floor / mean_gain, SEEN * uncertainty):
            lines[places[0]] = max(lines.get(places[0], 0.0), float(abs(angle)) * mean_gain)
    return Geometry(tuple(values), sizes_of, tuple(refinements), alternatives, lines)


def _linear_outputs(result: SearchResult, effects: GeometryEffects, values: Mapping[str, Array]) -> Array:
    """Outputs of a linear sensor with this geometry, (channels, n), in their unit."""
    c = result.data.channels
    base = result.values.base
    scale = np.linalg.norm(base[c : 4 * c].reshape(c, 3), axis=1) * np.sign(base[c : 4 * c].reshape(c, 3).diagonal())
    return np.asarray(base[:c, None] + scale[:, None] * effects.forces(values)[:, :c].T)


def _values_without(values: Mapping[str, Array], name: str) -> dict[str, Array]:
    return {key: value for key, value in values.items() if key != name}


def _linear_part(result: SearchResult, place: str, curve: Array) -> float:
    """Standard deviation of the linear part that a place's mechanism may have, in the output's unit."""
    force = result.state.force
    drivers = {"cross-response": force[:, list(CROSS)].T, "z-response": out_of_plane(force).T}
    total = float(np.mean(curve**2))
    if place not in drivers:
        return float((ZERO_PART if place in ("scale-over-z", "scale-over-cross") else LINEAR_PART) * np.sqrt(total))
    even = 0.0
    for d, row in zip(drivers[place], curve, strict=False):
        X = np.column_stack([np.ones(len(d)), d, *(d**k for k in (*EVEN, *ODD))])
        u = np.linalg.lstsq(X, row, rcond=1e-9)[0]
        part = X[:, 2 : 2 + len(EVEN)] @ u[2 : 2 + len(EVEN)]
        even += float(np.var(part)) / len(curve)
    even = min(even, total)
    odd = total - even
    is_gap = place == "z-response" and odd > NARROWING**2 * even
    line_of_gap = min(even**2 / odd, GAP_LINE**2 * even) if is_gap else 0.0
    return float(np.sqrt(LINEAR_PART**2 * odd + EVEN_PART**2 * even + line_of_gap))


def _base_with_forms(result: SearchResult, sizes: Mapping[str, float]) -> tuple[Array, Array]:
    """(change of the base, (b,), covariance, (b, b)) if each acting place may have another form.

    The prior size of such a form is a tenth of the place's size. The data reduce it to the posterior.
    """
    g, variances = result.gram, dict(result.sizes.variances)
    floor = float(np.sqrt(np.mean(result.white**2)))
    b = len(g.base_inverse)
    for component in result.components:
        if component.place in sizes and component.form is not None and component.name not in variances:
            block = g.blocks[component.name]
            columns = result.columns[:, b + block.start : b + block.stop]
            adds = floor * np.sqrt(np.sum(columns**2) / len(columns))  # to the output, for coefficients of 1
            variances[component.name] = (FORM_PART * sizes[component.place] / adds) ** 2
    rows = g.indices(variances)
    std = np.sqrt(np.repeat(list(variances.values()), [g.blocks[n].stop - g.blocks[n].start for n in variances]))
    # By eigenvalues: beside large ones, the smallest ones are lost in rounding, and a solution fails.
    eigenvalues, directions = np.linalg.eigh(std[:, None] * g.products[np.ix_(rows, rows)] * std)
    leak = g.base_inverse @ g.base_products[:, rows] * std @ directions
    shares = 1 / (1 + np.maximum(eigenvalues, 0.0))
    base = g.base_inverse @ g.base_with_data - leak @ (shares * (directions.T @ (std * g.with_data[rows])))
    covariance = g.base_inverse + leak @ (shares[:, None] * leak.T)
    return base - result.values.base, covariance * max(1.0, result.ratio**2)


def _angles(result: SearchResult, gain: Array) -> tuple[Array, list[tuple[str, ...]]]:
    """The matrix that picks the angles q of the base coefficients, rad, and the places that hide each."""
    data, c = result.data, result.data.channels
    rows: list[Array] = []
    hidden_by: list[tuple[str, ...]] = []
    for k in range(c):
        for j in range(3):
            if j != k:
                row = np.zeros(own_base_size(data))
                row[c + 3 * k + j] = 1 / gain[k]
                rows.append(row)
                hidden_by.append(OVER_CROSS if j == CROSS[k] else OVER_Z)
    for i in range(4 * c, own_base_size(data)):
        row = np.zeros(own_base_size(data))
        row[i] = 1.0
        rows.append(row)
        hidden_by.append(OVER_BETA if i == 4 * c + 1 else ())
    return np.array(rows), hidden_by


def _cheapest_effects(
    remaining_angles: Callable[[Mapping[str, Array]], Array], C: Array, effects: GeometryEffects, free: AbstractSet[str]
) -> tuple[dict[str, Array], dict[str, tuple[str, ...]], Array]:
    """(values of the cheapest effects that explain the angles of covariance C, their rivals, remaining angles).

    `free`: effects without a price, which the result does not include.
    """
    root = np.linalg.cholesky(C)

    def scaled_angles(values: Mapping[str, Array]) -> Array:
        return np.linalg.solve(root, remaining_angles(values))

    free_effects = [name for name in effects.parameters if name in free]
    priced_effects = [name for name in effects.parameters if name not in free]
    scored: list[tuple[float, tuple[str, ...], Array, dict[str, Array]]] = []
    for count in range(len(priced_effects) + 1):
        for names in combinations(priced_effects, count):
            values, residual_angles, rank = _fit_angles(
                scaled_angles, {n: effects.parameters[n] for n in (*free_effects, *names)}
            )
            price = CAUSE_PRICE * count + PARAMETER_PRICE * rank
            scored.append((float(residual_angles @ residual_angles) + price, names, residual_angles, values))
    scored.sort(key=lambda s: s[0])
    best, effect_names, residual_angles, values = scored[0]
    close = [names for score, names, *_ in scored[1:] if score < best + CLOSE and len(names) <= len(effect_names)]
    rivals = {name for names in close for name in names} - set(effect_names)
    return (
        {name: values[name] for name in effect_names},
        {name: tuple(sorted(rivals)) for name in effect_names if rivals},
        root @ residual_angles,
    )


def _fit_angles(
    remaining_angles: Callable[[Mapping[str, Array]], Array], counts: Mapping[str, int]
) -> tuple[dict[str, Array], Array, float]:
    """(values of effects by least squares, remaining angles, number of values that the angles determine)."""
    ends = np.cumsum(list(counts.values()), dtype=int)

    def by_effect(p: Array) -> dict[str, Array]:
        return dict(zip(counts, np.split(p, ends[:-1]), strict=True)) if counts else {}

    p = np.zeros(ends[-1] if counts else 0)
    residual_angles, rank = remaining_angles(by_effect(p)), 0.0
    for _ in range(STEPS if counts else 0):
        differences = [
            (remaining_angles(by_effect(p - e)), remaining_angles(by_effect(p + e))) for e in SMALL_DEG * np.eye(len(p))
        ]
        A = np.column_stack([(upper - lower) / (2 * SMALL_DEG) for upper, lower in differences])
        step, _, rank_shown, _ = np.linalg.lstsq(A, residual_angles, rcond=1e-6)
        p, rank = p + step, float(rank_shown)
        residual_angles = remaining_angles(by_effect(p))
    return by_effect(p), residual_angles, rank
