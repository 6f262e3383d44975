"""Names within a place: the fewest catalogue forms that explain its curve; if none do, the cause is unknown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.special import betaincc  # scipy.stats takes 0.4 s to load

from calibrations.criteria import SIGNIFICANT
from calibrations.free_forms.components import Component
from calibrations.free_forms.places import is_off_centre
from calibrations.free_forms.places_in_time import DRIFT_LINE, LONGEST_PART
from calibrations.free_forms.search_result import SearchResult
from calibrations.free_forms.shapes import climb
from calibrations.table import Array

FIRST_FORM = 0.2  # of a place's variance: the least that the first form must explain
NEXT_FORM = 0.05  # of a place's variance: the least that a second form must explain; less may be the form of the first
LEAST_NEEDED = 0.02  # of a place's variance: the least that the other forms must lose without this one
NAMED = 0.9  # of a place's variance: the least that the forms must explain together
NAMED_ALONE = 0.5  # the same for the only effect of its place that the curve resembles at all: most of the curve
MOST_FORMS = 2  # forms, at most, that only approximate a curve
MOST_NAMES = 3  # causes of one curve, at most: four forms, each with a shape of its own, approximate any curve
WARM_UPS = ("warm-up-bias", "warm-up-scale")
SETTLED = 0.2  # of the record: the longest time constant of what has settled at its end, to less than 1 %
TWO_MASSES = ((0.04, 0.12), (0.02, 0.06))  # of the record: time constants from which their search starts, and its steps
FIRST_POSES, OVER_SOON = 0.06, 0.8  # of a record, and of the variance of what decays within them
TIME_CONSTANTS = tuple(np.geomspace(0.02, 3.0, 40).tolist())  # of the record, that a decay may have
UNSETTLED = 0.36  # of the record: of a longer time constant, more than a twentieth of the decay is in the last fifth
JUMPS = 4.0  # excess kurtosis of a walk's increments: 500 of a Gaussian process keep within +-1
SWINGS = 2  # periods in a record: the least that a swing has, and a drift has not
FEWEST_WAVES = 8  # that the data determine: of fewer, the largest is large by chance
UNSEEN = 0.3  # noise floors: a smaller residual of an effect does not show that a wider effect is the cause
CLEARLY_LESS = 1.5  # ratio of the rms residuals of two effects from which one of them is not the cause
SAME = 1e-8  # of a column: a smaller part that other columns do not span is rounding
FOLLOWS = 0.97  # of the variance of a curve over time that a line over a column explains: then the column is the cause
FOLLOWERS = {"time-bias": ("temperature-bias", "column:std"), "time-scale": ("temperature-scale",)}

Curves = Mapping[str, Array]  # of each place, over the noise, without its projection on the base


def all_walk(names: Sequence[str]) -> bool:
    """Whether the components are random walks, which follow anything, the errors of readings too."""
    return all("/walk-" in name for name in names)


def causes_of_place(
    result: SearchResult, place: str, names: Sequence[str], curves: Curves, Q: Array
) -> tuple[tuple[str, ...], float, tuple[tuple[str, float], ...]]:
    """The causes of a place's curve, their share of its variance, and constants of a cause that is of another place.

    The components `names` act there. `curves` are those of all places; Q (rows, m) is orthonormal: the base.
    """
    causes, share = _name_effects(result, place, names, curves[place], Q, result.setting.base_size)
    walks = all_walk(names)
    if walks or not causes or not any(result.component(name).cause for name in names):
        followed = _find_followed_column(result, curves, place, Q, 0.0 if walks else share)
        if followed is not None:
            return (followed[0].cause,), followed[1], followed[0].constants
    return causes, share, ()


def is_over_soon(curve: Array, elapsed_share: Array) -> bool:
    """Whether a curve decays within the first poses, as the memory of what came before them does.

    curve           by axis, (channels, n)
    elapsed_share   time of each row, from 0 to 1 along the record, (n,)
    """
    largest = max(curve, key=np.ptp)
    squares = (largest - np.median(largest)) ** 2
    return bool(squares[elapsed_share < FIRST_POSES].sum() > OVER_SOON * squares.sum())


def is_unsettled(curve: Array, elapsed_share: Array) -> bool:
    """Whether the decay that a curve resembles most is not over at the end of the record.

    A drift that becomes slower, such as ageing with the logarithm of the time, looks like that too.
    """
    largest = max(curve, key=np.ptp)
    squares = []
    for part in TIME_CONSTANTS:
        X = np.column_stack([np.ones_like(elapsed_share), np.exp(-elapsed_share / part)])
        remaining = largest - X @ np.linalg.lstsq(X, largest, rcond=None)[0]
        squares.append(float(remaining @ remaining))
    return bool(TIME_CONSTANTS[int(np.argmin(squares))] > UNSETTLED)


def project_off(Q: Array, x: Array) -> Array:
    """Values without their projection on the orthonormal columns of Q."""
    return np.asarray(x - Q @ (Q.T @ x))


def _name_effects(
    result: SearchResult, place: str, names: Sequence[str], curve: Array, Q: Array, b: int
) -> tuple[tuple[str, ...], float]:
    """The fewest catalogue effects that explain the curve, and their share of its variance."""
    forms = _forms_by_cause(result, place, names)
    columns = {cause: _columns(result, comps, names, Q, b) for cause, comps in forms.items()}
    acting_causes = tuple(dict.fromkeys(result.component(name).cause for name in names))
    if all(result.component(name).form is None for name in names):
        total = float(curve @ curve) or 1.0
        needed_causes, share = _necessary({cause: columns[cause][0] for cause in acting_causes}, curve, total)
        return _one_name(result, names, needed_causes, curve, Q), share

    def options_of(cause: str, chosen: Array) -> Sequence[Array]:
        options = [*columns[cause], *_at_best_shapes(result, forms[cause], curve, chosen, Q)]
        return [*options, *_two_masses(result, forms[cause], curve, chosen, Q)] if cause in WARM_UPS else options

    walks = {result.component(name).cause for name in names if "/walk-" in name}
    first = [cause for cause in acting_causes if cause and cause not in walks] if walks else []  # walks follow anything
    chosen_causes, share = _select_causes(tuple(columns), acting_causes, first, curve, options_of)
    if chosen_causes == ("warm-up-bias",) and DRIFT_LINE in names and "bias-drift" in forms:
        drift, share_of_drift = _select_causes(["bias-drift"], acting_causes, (), curve, options_of)
        if drift and 1 - share_of_drift < CLEARLY_LESS**2 * (1 - share):
            chosen_causes, share = drift, share_of_drift
    causes = _one_name(result, names, chosen_causes, curve, Q)
    if share >= NAMED and len(causes) <= MOST_NAMES:
        return causes, share
    narrow = [cause for cause, comps in forms.items() if not any(comp.contains in forms for comp in comps)]
    each_alone = [_select_causes([cause], acting_causes, (), curve, options_of) for cause in narrow]
    resembling = [(named, share_alone) for named, share_alone in each_alone if named]
    return resembling[0] if len(resembling) == 1 and resembling[0][1] >= NAMED_ALONE else ((), share)


def _forms_by_cause(result: SearchResult, place: str, names: Sequence[str]) -> dict[str, list[Component]]:
    """The catalogue forms of a place that may explain its curve, by cause; `names` are the components that act.

    A wider effect that does not act is left out where the effect that it contains acts: the search preferred a curve.
    """
    forms: dict[str, list[Component]] = {}
    acting_causes = {result.component(name).cause for name in names}
    no_walk = any(_is_no_walk(result, name) for name in names if "/walk-" in name)
    for comp in result.components:
        if comp.place == place and comp.cause and (comp.name in names or not _has_better_shape(comp, result, names)):
            smooth = comp.cause == "bias-drift" or (comp.cause == "warm-up-bias" and comp.name not in names)
            preferred = bool(comp.contains) and comp.contains in acting_causes
            if (smooth and no_walk) or ((_follows_many(comp) or preferred) and comp.name not in names):
                continue
            forms.setdefault(comp.cause, []).append(comp)
    return forms


def _select_causes(
    candidates: Sequence[str],
    acting: Sequence[str],
    first: Sequence[str],
    curve: Array,
    options_of: Callable[[str, Array], Sequence[Array]],
) -> tuple[tuple[str, ...], float]:
    """The causes that explain most of the curve, added one at a time, and their share of its variance.

    The causes `first` come before all others. `options_of` gives the columns that a cause may have, beside the
    orthonormal columns of the causes that were chosen before.
    """
    total = float(curve @ curve) or 1.0
    chosen: dict[str, Array] = {}
    chosen_basis = np.zeros((len(curve), 0))
    share = 0.0
    while True:
        at_limit = len(set(chosen) - set(acting)) >= MOST_FORMS
        trials: dict[str, tuple[float, Array]] = {}
        for cause in first or candidates:
            if cause in chosen or (at_limit and cause not in acting):
                continue
            options = options_of(cause, chosen_basis)
            squares, X = min(
                ((_residual_squares([X], curve, chosen_basis), X) for X in options), key=lambda option: option[0]
            )
            trials[cause] = 1 - squares / total, X
        best = max(trials, key=lambda c: trials[c][0], default="")
        if not best or trials[best][0] - share < (NEXT_FORM if chosen else FIRST_FORM):
            if not first:
                return tuple(chosen), share
            first = []
            continue
        share, chosen[best] = trials[best]
        chosen_basis = _orthonormal(list(chosen.values()))


def _one_name(
    result: SearchResult, names: Sequence[str], cause_names: Sequence[str], curve: Array, Q: Array
) -> tuple[str, ...]:
    """The causes, with one name for an effect and a wider effect that contains it.

    The wider effect is the cause on two conditions: the inner one at its best shape leaves a visible residual, and the
    wider one together with the inner one without a shape leaves a clearly smaller one. With both shapes free, the two
    would follow nearly any lag.
    """
    causes = dict.fromkeys(cause_names)

    def residual_rms(comps: Sequence[Component], companions: Array | None = None) -> float:
        squares = min((_residual_at_best(result, c, curve, Q, companions)[0] for c in comps), default=np.inf)
        return float(np.sqrt(squares / len(curve)))

    for outer in (comp for comp in map(result.component, names) if comp.contains):
        at_place = [c for c in result.components if c.place == outer.place and not c.form]
        inner, wider = ([c for c in at_place if c.cause == cause] for cause in (outer.contains, outer.cause))
        unshaped = [c.reshaped((0.0,) * len(c.shape)) if c.reshaped else c for c in inner[:1]]
        companions = _orthonormal([_columns_of(result, c, Q) for c in unshaped]) if unshaped else None
        clear = CLEARLY_LESS * residual_rms(wider, companions)
        name = outer.cause if residual_rms(inner) > max(UNSEEN, clear) else outer.contains
        causes = dict.fromkeys(name if cause in (outer.cause, outer.contains) else cause for cause in causes)
    return tuple(causes)


def _find_followed_column(
    result: SearchResult, curves: Curves, place: str, Q: Array, share: float
) -> tuple[Component, float] | None:
    """The line over a temperature or a logged column that a curve over time follows, and its share of the variance.

    A smooth curve over time is likelier than a column with reading errors, even if the column is its cause: so the
    likelihood cannot decide. None if the place is not over time, if the curve follows no column, or if the line
    explains no more than the `share` of the place's own causes.
    """
    if place not in FOLLOWERS:
        return None
    curve = curves[place] + sum(curves[follower] for follower in FOLLOWERS[place] if follower in curves)
    total, least = float(curve @ curve) or 1.0, 1 - max(FOLLOWS, share)
    best = None
    for comp in result.components:
        if comp.cause and comp.place in FOLLOWERS[place] and comp.form is None and not comp.contains:
            squares, shaped = _residual_at_best(result, comp, curve, Q)
            if squares / total < least:
                best, least = shaped, squares / total
    return None if best is None else (best, 1 - least)


def _residual_at_best(
    result: SearchResult, comp: Component, curve: Array, Q: Array, companions: Array | None = None
) -> tuple[float, Component]:
    """Residual sum of squares of a curve after a component in its best shape, and the component in that shape.

    The curve is also free along the orthonormal columns of `companions`, (rows, k).
    """

    def squares(shape: tuple[float, ...]) -> float:
        shaped = comp.reshaped(shape) if comp.reshaped is not None else comp
        return _residual_squares([_columns_of(result, shaped, Q)], curve, companions)

    if comp.reshaped is None:
        return squares(comp.shape), comp
    best = climb(lambda shape: -squares(shape), comp.shape, comp.step)
    return squares(best), comp.reshaped(best)


def _at_best_shapes(
    result: SearchResult, comps: Sequence[Component], curve: Array, companions: Array, Q: Array
) -> list[Array]:
    """Columns of the components of one cause that have one value of shape, each at the shape that leaves least.

    A warm-up of the bias with the longest time constant is a drift.
    """
    shaped = [c for c in comps if c.reshaped and len(c.shape) == 1 and c.form is None and not c.contains]
    best = [_residual_at_best(result, c, curve, Q, companions)[1] for c in shaped]
    return [_columns_of(result, c, Q) for c in best if c.cause != "warm-up-bias" or c.shape[0] < LONGEST_PART]


def _two_masses(
    result: SearchResult, comps: Sequence[Component], curve: Array, companions: Array, Q: Array
) -> list[Array]:
    """Columns of two exponential approaches, of any signs, that end within the record: those of two thermal masses."""
    reshaped = next((c.reshaped for c in comps if c.reshaped and c.form is None), None)
    if reshaped is None:
        return []

    def columns(shape: Sequence[float]) -> Array:
        return np.hstack([_columns_of(result, reshaped((min(abs(part), SETTLED),)), Q) for part in shape])

    best = climb(lambda shape: -_residual_squares([columns(shape)], curve, companions), *TWO_MASSES)
    return [columns(best)]


def _columns_of(result: SearchResult, comp: Component, Q: Array) -> Array:
    """Columns of a component over the noise, without their projection on the base, (channels * n, m)."""
    X = comp.jacobian(result.state) / result.white[:, :, None]
    return project_off(Q, X.reshape(-1, X.shape[2]))


def _necessary(columns: Mapping[str, Array], curve: Array, total: float) -> tuple[tuple[str, ...], float]:
    """The catalogue forms that the curve needs where no free form acts, and their share of its variance."""
    share = 1 - _residual_squares(list(columns.values()), curve) / total

    def cost_without(cause: str) -> float:
        remaining = [X for name, X in columns.items() if name != cause]
        return share - (1 - _residual_squares(remaining, curve) / total if remaining else 0.0)

    costs = {cause: cost_without(cause) for cause in columns}
    least = min(LEAST_NEEDED, max(costs.values()))
    return tuple(c for c in sorted(costs, key=lambda c: -costs[c]) if costs[c] >= least), share


def _follows_many(comp: Component) -> bool:
    """Whether a cause's columns are of many widths, so that they explain a part of most curves."""
    flexible_kinds = ("clips", "play", "preisach")
    is_flexible = comp.form is not None and comp.form.basis(0).kind in flexible_kinds
    return comp.cause == "quantisation" or is_flexible or is_off_centre(comp)


def _is_no_walk(result: SearchResult, name: str) -> bool:
    """Whether a curve that a random walk follows is none: it jumps, or swings at one frequency."""
    return _jumps(result, name) or _swings(result, name)


def _jumps(result: SearchResult, name: str) -> bool:
    """Whether the increments of a random walk have tails that a Gaussian process does not have."""
    walk = result.component(name).jacobian(result.state) @ result.values.of[name]
    increments = np.diff(walk[np.argmax(np.ptp(walk, axis=1))])
    squares = (increments - np.mean(increments)) ** 2
    return bool(np.mean(squares**2) > (JUMPS + 3) * np.mean(squares) ** 2)


def _swings(result: SearchResult, name: str) -> bool:
    """Whether one wave of a random walk is larger than its prior allows beside the others (Fisher, 1929).

    The waves of a walk are independent and, over their prior's deviation, of one size: the share of one of m waves in
    the sum of their squares has a beta distribution. Waves of fewer than two periods, which a drift has as well, and
    those that the data do not determine are not counted.
    """
    first, size = result.setting.base_size, result.sizes.variances[name]
    block = result.gram.blocks[name]
    columns = result.columns[:, first + block.start : first + block.stop]
    determined = size * np.sum(columns**2, axis=0) > 1.0  # the data say more of the wave than the prior
    determined[: 2 * SWINGS - 1] = False  # column k has (k + 1) / 2 periods
    squares = result.sizes.of(result.gram, name)[determined] ** 2
    m = len(squares)
    if m < FEWEST_WAVES:
        return False
    return bool(m * betaincc(0.5, (m - 1) / 2, squares.max() / squares.sum()) < SIGNIFICANT)


def _has_better_shape(comp: Component, result: SearchResult, names: Sequence[str]) -> bool:
    """Whether another member of its family acts, at a better shape."""
    return bool(comp.family) and any(result.component(n).family == comp.family for n in names)


def _columns(result: SearchResult, comps: Sequence[Component], names: Sequence[str], Q: Array, b: int) -> list[Array]:
    """Candidates of one cause: of all its components together where they act, else each by itself."""
    parts = []
    for comp in comps:
        block = result.gram.blocks[comp.name]
        X = result.columns[:, b + block.start : b + block.stop]
        parts.append(X - Q @ (Q.T @ X))
    acting_parts = [X for comp, X in zip(comps, parts, strict=True) if comp.name in names]
    return [np.hstack(acting_parts)] if acting_parts else parts


def _residual_squares(columns: Sequence[Array], y: Array, companions: Array | None = None) -> float:
    """Sum of squares of y after its projection on columns, and on the orthonormal `companions`, (rows, k)."""
    X = np.hstack(columns)
    X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    if companions is not None:
        X, y = project_off(companions, X), project_off(companions, y)
        X[:, np.linalg.norm(X, axis=0) < SAME] = 0.0
    residual = y - X @ np.linalg.lstsq(X, y, rcond=SAME)[0]
    return float(residual @ residual)


def _orthonormal(columns: Sequence[Array]) -> Array:
    """Orthonormal columns that span the given ones, (rows, k)."""
    X = np.hstack(columns)
    U, sizes, _ = np.linalg.svd(X / np.maximum(np.linalg.norm(X, axis=0), 1e-300), full_matrices=False)
    return np.asarray(U[:, sizes > SAME * sizes[0]])
