"""Geometry: which of misalignment, non-orthogonality, stage zeros and base tilt the linear parts need.

The linear parts of the fit are a vector q of small angles with a covariance. Each effect of the geometry is a linear
map into it, from its own derivatives. A place that acts over another axis may have a linear part of its own, as large
as the odd part of its curve: so much is added to the covariance before anything is asked, so that no mechanism's linear
part names a second cause. An even curve, such as that of z-axis-bias, has a small one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from calibrations.criteria import FORM_PART
from calibrations.free_forms.chain import own_base_size
from calibrations.free_forms.form import CROSS
from calibrations.free_forms.search import SearchResult
from calibrations.geometry.orientation import out_of_plane
from calibrations.table import Array

GEOMETRY = ("axis-nonorthogonality", "axis-misalignment", "stage-zero-offset", "base-tilt")
CAUSE_PRICE, PARAMETER_PRICE = 12.0, 2.0  # of chi-square
CLOSE = 8.0  # of chi-square: explanations that this data does not tell apart
LINEAR_PART = 2.0  # of a curve's odd part: the standard deviation of a mechanism's own linear part
EVEN_PART = 1.0  # the same of its even part
EVEN, ODD = (2, 4, 6), (3, 5)  # powers of the driver
LEAST_LINE = 0.3  # noise floors: a smaller linear part is left out
SEEN = 3.5  # standard uncertainties: a smaller linear part may be noise
IMMATERIAL = 0.15  # noise floors: a smaller angle is no matter
OVER_CROSS = ("cross-response", "scale-over-cross", "force")
OVER_Z = ("z-response", "scale-over-z", "force", "stage-angle-alpha")


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


def geometry(
    result: SearchResult, curves: Mapping[str, Array], effects: Mapping[str, Array], has: set[str]
) -> Geometry:
    """The geometry that the linear parts show.

    curves   what each acting place adds, (channels, n), in the output's unit
    effects  d output / d parameters of each effect of the geometry, (channels, n, m)
    has      effects of the geometry that the given model has: they cost nothing
    """
    data, c, g = result.data, result.data.channels, result.gram
    gain = np.array([result.values.base[c + 3 * k + k] for k in range(c)])
    floor, mean_gain = float(np.sqrt(np.mean(result.white**2))), float(np.mean(np.abs(gain)))
    if not mean_gain > 0:
        return Geometry()
    pick, over = _angles(result, gain)
    b = own_base_size(data)
    active = g.indices(result.sizes.variances)
    cross = g.base_inverse @ g.base_products[:, active]
    sizes = {place: float(np.sqrt(np.mean(curve**2))) for place, curve in curves.items()}
    linear = {place: _linear_part(result, place, curve) for place, curve in curves.items()}
    covariance = (g.base_inverse + cross @ result.sizes.inverse @ cross.T + _of_forms(result, sizes))[:b, :b]
    q = pick @ result.values.base[:b]
    C = pick @ covariance @ pick.T
    C += np.diag(np.full(len(q), (IMMATERIAL * floor / mean_gain) ** 2))
    own = [2 * max((linear.get(place, 0.0) for place in places), default=0.0) / mean_gain for places in over]
    whole = g.base_inverse.shape[0]
    base = result.columns[:, :whole]
    maps = {
        name: pick @ (g.base_inverse @ (base.T @ (J / result.white[:, :, None]).reshape(len(base), -1)))[:b]
        for name, J in effects.items()
    }
    values, alternatives, _ = _chosen(q, C + np.diag(np.square(own)), maps, has)
    sizes_of = {name: float(np.sqrt(np.mean((effects[name] @ v) ** 2))) / floor for name, v in values.items()}
    refinements, _, left = _chosen(q, C, maps, has | values.keys())
    lines: dict[str, float] = {}
    for places, angle, uncertainty in zip(over, left, np.sqrt(np.diag(C)), strict=True):
        if places and abs(angle) > max(LEAST_LINE * floor / mean_gain, SEEN * uncertainty):
            lines[places[0]] = max(lines.get(places[0], 0.0), float(abs(angle)) * mean_gain)
    return Geometry(tuple(values), sizes_of, tuple(refinements), alternatives, lines)


def _linear_part(result: SearchResult, place: str, curve: Array) -> float:
    """Standard deviation of the linear part that a place's mechanism may have, in the output's unit."""
    force = result.state.force
    drivers = {"cross-response": force[:, list(CROSS)].T, "z-response": out_of_plane(force).T}
    whole = float(np.mean(curve**2))
    if place not in drivers:
        return float(LINEAR_PART * np.sqrt(whole))
    even = 0.0
    for d, row in zip(drivers[place], curve, strict=False):
        X = np.column_stack([np.ones(len(d)), d, *(d**k for k in (*EVEN, *ODD))])
        u = np.linalg.lstsq(X, row, rcond=1e-9)[0]
        part = X[:, 2 : 2 + len(EVEN)] @ u[2 : 2 + len(EVEN)]
        even += float(np.var(part)) / len(curve)
    even = min(even, whole)
    return float(np.sqrt(LINEAR_PART**2 * (whole - even) + EVEN_PART**2 * even))


def _of_forms(result: SearchResult, sizes: Mapping[str, float]) -> Array:
    """Covariance of the base, (b, b), that another form of each place that acts would cause."""
    g, active = result.gram, result.sizes.variances.keys()
    floor = float(np.sqrt(np.mean(result.white**2)))
    total = np.zeros(g.base_inverse.shape)
    for component in result.components:
        if component.place in sizes and component.form is not None and component.name not in active:
            block = g.blocks[component.name]
            columns = result.columns[:, len(total) + block.start : len(total) + block.stop]
            adds = floor * np.sqrt(np.sum(columns**2) / len(columns))  # to the output, for coefficients of 1
            leak = g.base_inverse @ g.base_products[:, block]
            total += (FORM_PART * sizes[component.place] / adds) ** 2 * leak @ leak.T
    return total


def _angles(result: SearchResult, gain: Array) -> tuple[Array, list[tuple[str, ...]]]:
    """The matrix that picks the angles q of the base coefficients, rad, and the places that hide each."""
    data, c = result.data, result.data.channels
    rows: list[Array] = []
    over: list[tuple[str, ...]] = []
    for k in range(c):
        for j in range(3):
            if j != k:
                row = np.zeros(own_base_size(data))
                row[c + 3 * k + j] = 1 / gain[k]
                rows.append(row)
                over.append(OVER_CROSS if j == CROSS[k] else OVER_Z)
    for i in range(4 * c, own_base_size(data)):
        row = np.zeros(own_base_size(data))
        row[i] = 1.0
        rows.append(row)
        over.append(())
    return np.array(rows), over


def _chosen(
    q: Array, C: Array, maps: Mapping[str, Array], has: set[str]
) -> tuple[dict[str, Array], dict[str, tuple[str, ...]], Array]:
    """The cheapest effects that explain the angles q, of covariance C, by their parameters; their rivals; the rest.

    `maps`: d q / d parameters of each effect; `has`: effects that cost nothing.
    """
    root = np.linalg.cholesky(C)
    q = np.linalg.solve(root, q)
    maps = {name: np.linalg.solve(root, part) for name, part in maps.items()}
    free = [maps[name] for name in maps if name in has]
    others = [name for name in maps if name not in has]
    scored: list[tuple[float, tuple[str, ...], Array, Array]] = []
    for count in range(len(others) + 1):
        for names in combinations(others, count):
            parts = [*free, *(maps[name] for name in names)]
            A = np.hstack([np.zeros((len(q), 0)), *parts])
            solved, _, rank, _ = np.linalg.lstsq(A, q, rcond=1e-7)
            answer = np.asarray(solved, dtype=float)
            left = q - A @ answer
            price = CAUSE_PRICE * count + PARAMETER_PRICE * int(rank)
            scored.append((float(left @ left) + price, names, left, answer))
    scored.sort(key=lambda s: s[0])
    best, chosen, left, answer = scored[0]
    close = [names for score, names, *_ in scored[1:] if score < best + CLOSE and len(names) <= len(chosen)]
    rivals = {name for names in close for name in names} - set(chosen)
    ends = np.cumsum([part.shape[1] for part in free] + [maps[name].shape[1] for name in chosen])
    values = {
        name: answer[end - maps[name].shape[1] : end] for name, end in zip(chosen, ends[len(free) :], strict=True)
    }
    return values, {name: tuple(sorted(rivals)) for name in chosen if rivals}, root @ left
