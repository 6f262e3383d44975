"""The search for the components that act: rounds of selection and Gauss-Newton steps, from two beginnings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from calibrations.free_forms.chain import Coefficients, ModelEffects, State, base_size, start, state_at
from calibrations.free_forms.components import Component
from calibrations.free_forms.flicker import is_flicker
from calibrations.free_forms.places import components as all_components
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.reml import (
    Gram,
    Sizes,
    coefficients,
    estimate,
    gain_of_columns,
    gram,
    scale_components,
    whiten,
    without,
)
from calibrations.free_forms.selection import ENTER, SPILL, pools_of, prices, select
from calibrations.free_forms.stairs import find_saw
from calibrations.progress import report
from calibrations.table import Array

COARSE = (1e-3, 2e-5)  # of the misfit, at each linearisation: less may be a second-order remainder
ROUNDS = 7
EXCHANGES_AGAIN = 0.3  # noise floors by which the output changes, rms: exchanges of the same components are tried again
CONVERGED = 0.03  # noise floors by which the output changes, rms
SETTLING = 6  # Gauss-Newton steps after components are left out
SMALL_GAIN = 1.0  # of twice the log-likelihood
LARGEST = 4.0  # of the mean square of the first misfit: more is two components against each other
HALVINGS = 6  # of a step that overshoots
NOISE_ALONE, FEW_COMPONENTS = 1.04, 3  # residual over noise and components of a search that needs no second beginning
# The residual over the noise: a smaller one is explained without flicker; a larger one contains effects that the search
# did not find.
LEAST_MISFIT, MOST_MISFIT = 1.2, 2.0
SLOW_MOST = 0.5  # slow noise, in noise floors, at most (rms)
SLOW_FIRST = 0.15  # the same while the first components are found: it would take up part of them


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The end of the search."""

    data: PoseData
    model_effects: ModelEffects
    white: Array
    components: Sequence[Component]
    gram: Gram
    columns: Array  # whitened [base, components, data]
    sizes: Sizes
    values: Coefficients
    state: State
    path: Sequence[str]
    flicker: bool

    def component(self, name: str) -> Component:
        return next(c for c in self.components if c.name == name)

    @property
    def residual(self) -> Array:
        """Whitened residual, (channels * n,)."""
        b, g = self.columns.shape[1] - 1 - len(self.gram.with_data), self.gram
        rows = g.indices(self.sizes.variances)
        base = g.base_inverse @ (g.base_with_data - g.base_products[:, rows] @ self.sizes.coefficients)
        fitted = self.columns[:, :b] @ base + self.columns[:, b + rows] @ self.sizes.coefficients
        return np.asarray(self.columns[:, -1] - fitted)

    @property
    def error(self) -> float:
        """Rms of what all components but slow noise leave, in the output's unit."""
        b = self.columns.shape[1] - 1 - len(self.gram.with_data)
        slow = np.zeros(len(self.columns))
        for component in self.components:
            if component.noise and component.name in self.sizes.variances:
                block = self.gram.blocks[component.name]
                slow += self.columns[:, b + block.start : b + block.stop] @ self.sizes.of(self.gram, component.name)
        return float(np.sqrt(np.mean(((self.residual + slow) * self.white.ravel()) ** 2)))

    @property
    def freedom(self) -> float:
        """Degrees of freedom that the residual keeps: rows less those that base and components take."""
        parameters = sum(
            self.gram.blocks[name].stop - self.gram.blocks[name].start - self.sizes.shrinkage(self.gram, name)
            for name in self.sizes.variances
        )
        return float(max(len(self.columns) - self.gram.base_rank - parameters, 1.0))

    def sizes_without(self, names: Iterable[str]) -> Sizes:
        """Sizes without some components, the other variances held."""
        sizes = self.sizes
        for name in names:
            sizes = without(self.gram, sizes, name)
        return sizes

    def cost_without(self, names: Iterable[str]) -> float:
        """Loss of twice the log-likelihood without some components, to first order."""
        return self.sizes_without(names).deviance - self.sizes.deviance

    @property
    def active(self) -> list[str]:
        return [name for name in self.sizes.variances if not self.component(name).noise]

    @property
    def ratio(self) -> float:
        """The residual over the noise."""
        return float(np.sqrt(self.residual @ self.residual / self.freedom))

    @property
    def criterion(self) -> float:
        """-2 log restricted likelihood, and what each component must gain."""
        return self.sizes.deviance + ENTER * len(self.active) + prices(self.component(name) for name in self.active)


def search(
    data: PoseData, white: Array, model_effects: ModelEffects, general: bool = True, noise_known: bool = True
) -> SearchResult:
    """Places that act, with their sizes, from several beginnings: the likeliest end counts.

    First forms of the catalogue begin, and free forms follow; where that leaves more than noise, or many components,
    all begin together. What is not smooth is found by the one, what has another form by the other. Where the history
    acts, loops that differ from place to place are tried too; without one they resemble most curves with a corner,
    and where they gain little they take up part of what acts elsewhere. Where flicker of any size is likelier than what
    follows the time, all begins again with it. This is not
    tried where a misfit may look like flicker: beside effects of the given model, or with a large residual.

    white    standard deviation of each mean, (channels, n)
    general  whether components that can follow almost anything are tried
    noise_known  whether `white` is the noise of the means; else it is the misfit of an earlier search
    """

    best = _likeliest(data, white, model_effects, general, flicker=False)
    limit = (SLOW_MOST * float(np.sqrt(np.mean(white**2)))) ** 2
    asked = noise_known and not model_effects.columns.shape[2] and LEAST_MISFIT < best.ratio < MOST_MISFIT
    if not asked or not is_flicker(best, limit):
        return best
    return min(best, _likeliest(data, white, model_effects, general, flicker=True), key=lambda end: end.criterion)


def _likeliest(data: PoseData, white: Array, model_effects: ModelEffects, general: bool, flicker: bool) -> SearchResult:
    """The likeliest end of several beginnings."""

    def descent(catalogue_first: bool, loops: bool = False, origin: SearchResult | None = None) -> SearchResult:
        return _descent(data, white, model_effects, general, flicker, catalogue_first, loops, origin)

    by_name = descent(catalogue_first=True)
    if by_name.ratio < NOISE_ALONE and len(by_name.active) <= FEW_COMPONENTS:
        return by_name
    best = min(by_name, descent(catalogue_first=False), key=lambda end: end.criterion)
    if any(best.component(name).place == "history" for name in best.active):
        looped = descent(catalogue_first=True, loops=True)
        best = looped if looped.criterion < best.criterion - SPILL * abs(best.criterion) else best
    return _without_remainders(best, lambda origin: descent(catalogue_first=False, origin=origin))


def _descent(
    data: PoseData,
    white: Array,
    model_effects: ModelEffects,
    general: bool,
    flicker: bool,
    catalogue_first: bool,
    loops: bool,
    origin: SearchResult | None = None,
) -> SearchResult:
    """Rounds of selection and Gauss-Newton steps from the base, or from the components of an earlier search."""
    values = start(data, model_effects)
    state = state_at(data, model_effects, values, ())
    components = [
        c for c in all_components(data, state, flicker) if (general or not c.general) and (loops or not c.has_loops)
    ]
    scales: dict[str, float] = {}
    noise = [c.name for c in components if c.noise]
    floor = float(np.sqrt(np.mean(white**2)))
    variances = dict.fromkeys(noise, (0.1 * floor) ** 2)
    most: dict[str, float] = {} if flicker else dict.fromkeys(noise, (SLOW_MOST * floor) ** 2)
    path: list[str] = []
    b = base_size(data, model_effects)
    rejected: list[float] = []
    first = find_saw(data, state, white, data.outputs - state.predicted, rejected, ENTER)
    components += [first] if first is not None else []
    caution, change = 1.0, np.inf
    first_round, exchanged = 0, set[str]()
    if origin is not None:
        values, state, components = origin.values, origin.state, list(origin.components)
        variances, first_round = dict(origin.sizes.variances), len(COARSE)
    beginning = "effects first" if catalogue_first else "all forms together"
    beginning += ", loops" * loops + ", flicker" * flicker
    for number in range(first_round, ROUNDS):
        report(f"searching for places ({beginning}), pass {number + 1} of at most {ROUNDS}")
        X, blocks, scales = whiten(state, model_effects, values, components, scales, white)
        g = gram(X, blocks, scales, b)
        if number == first_round:
            X, scales = scale_components(X, g, b)
            g = gram(X, blocks, scales, b)
            largest = LARGEST * g.squares / g.rows * floor**2
            most |= {c.name: largest for c in components if not c.noise}
        slow = SLOW_FIRST if number < len(COARSE) else SLOW_MOST
        most |= {} if flicker else dict.fromkeys(noise, (slow * floor) ** 2)
        limit = caution * (max(ENTER, COARSE[number] * g.squares) if number < len(COARSE) else ENTER)
        previous_names = set(variances)
        previous = values, dict(variances), state, components
        sizes = estimate(g, variances, most)
        pools = pools_of(components, catalogue_first and number < len(COARSE))
        is_same = set(variances) == exchanged and change < EXCHANGES_AGAIN
        sizes, steps = select(g, sizes, components, pools, most, limit, number >= len(COARSE) and not is_same)
        path += steps
        variances = dict(sizes.variances)
        exchanged = set(variances) if number >= len(COARSE) else set()
        values, moved_state = _take_damped_step(
            data, model_effects, previous[0], coefficients(g, sizes), components, white
        )
        reshaped = _refine_shapes(components, g, sizes, X, b, state, scales, white)
        if reshaped is not None:
            X, blocks, scales = whiten(state, model_effects, previous[0], reshaped, scales, white)
            g = gram(X, blocks, scales, b)
            sizes = estimate(g, variances, most)
            reshaped_values = coefficients(g, sizes)
            reshaped_state = state_at(data, model_effects, reshaped_values, reshaped)
            if _misfit(reshaped_state, white) < _misfit(moved_state, white):
                components, values, moved_state = reshaped, reshaped_values, reshaped_state
                variances = dict(sizes.variances)
        change = float(np.sqrt(np.mean(((moved_state.predicted - state.predicted) / white) ** 2)))
        state = moved_state
        if _misfit(moved_state, white) > 1.5 * g.squares / g.rows + 10.0:  # components against each other: no step
            values, variances, state, components = previous
            saws = {c.name for c in components if c.cause == "quantisation"} & set(sizes.variances)
            rejected += [c.shape[0] for c in components if c.name in saws]
            components = [c for c in components if c.name not in saws]
            variances = {k: v for k, v in variances.items() if k not in saws}
            values = Coefficients(values.base, {k: v for k, v in values.of.items() if k not in saws})
            caution *= 1.0 if saws else 30.0
            continue
        if not any(c.cause == "quantisation" for c in components):
            extra = find_saw(data, state, white, data.outputs - state.predicted, rejected, ENTER)
            if extra is not None:
                components = [*components, extra]
                continue
        if number >= len(COARSE) and set(variances) == previous_names and change < CONVERGED:
            break
    X, blocks, scales = whiten(state, model_effects, values, components, scales, white)
    g = gram(X, blocks, scales, b)
    sizes = estimate(g, variances, most)
    values = coefficients(g, sizes)
    state = state_at(data, model_effects, values, components)
    return SearchResult(data, model_effects, white, components, g, X, sizes, values, state, path, flicker)


def _without_remainders(best: SearchResult, descent: Callable[[SearchResult], SearchResult]) -> SearchResult:
    """The search without components that hold the remainder of others, if that is likelier.

    While the first components are found, what they leave is of second order in large effects, and looks like other
    places. The derivatives at the end rely on these. So each place, and each component, is left out in turn with
    Gauss-Newton steps of its own; what is then missing is searched for again. Not where the residual is large: what
    the search did not find is then in every component.
    """
    if best.ratio > MOST_MISFIT:
        return best
    simplified = best
    while (simpler := _likelier_without_one(simplified)) is not None:
        simplified = simpler
    if simplified is best:
        return best
    names = set(simplified.sizes.variances)
    components = [simplified.component(c.name) if c.name in names else c for c in best.components]
    return min(best, descent(replace(simplified, components=components)), key=lambda end: end.criterion)


def _likelier_without_one(result: SearchResult) -> SearchResult | None:
    """The search without one place or component, the smallest that makes it likelier; None if there is none."""
    active = result.active
    places = {result.component(name).place for name in active}
    groups = [[n for n in active if result.component(n).place == place] for place in places]
    groups += [[name] for group in groups if len(group) > 1 for name in group]
    for group in sorted(groups, key=result.cost_without):
        if result.cost_without(group) > SPILL * result.gram.squares:
            break
        without_group = _converge(result, set(result.sizes.variances) - set(group))
        if without_group is not None and without_group.criterion < result.criterion - SMALL_GAIN:
            return without_group
    return None


def _converge(result: SearchResult, names: Set[str]) -> SearchResult | None:
    """The search with these components alone, after Gauss-Newton steps; None where these do not converge."""
    data, model_effects, white = result.data, result.model_effects, result.white
    components = [c for c in result.components if c.name in names]
    floor = float(np.sqrt(np.mean(white**2)))
    most = {} if result.flicker else {c.name: (SLOW_MOST * floor) ** 2 for c in components if c.noise}
    b = base_size(data, model_effects)
    variances = {name: v for name, v in result.sizes.variances.items() if name in names}
    values = Coefficients(result.values.base, {name: v for name, v in result.values.of.items() if name in names})
    state = state_at(data, model_effects, values, components)
    scales: Mapping[str, float] = result.gram.scales
    for _ in range(SETTLING):
        X, blocks, scales = whiten(state, model_effects, values, components, scales, white)
        g = gram(X, blocks, scales, b)
        sizes = estimate(g, variances, most)
        variances = dict(sizes.variances)
        values, next_state = _take_damped_step(data, model_effects, values, coefficients(g, sizes), components, white)
        change = float(np.sqrt(np.mean(((next_state.predicted - state.predicted) / white) ** 2)))
        if not _misfit(next_state, white) <= 1.5 * _misfit(state, white) + 10.0:
            return None
        state = next_state
        if change < CONVERGED:
            return replace(result, components=components, gram=g, columns=X, sizes=sizes, values=values, state=state)
    return None


def _take_damped_step(
    data: PoseData,
    model_effects: ModelEffects,
    origin: Coefficients,
    target: Coefficients,
    components: Sequence[Component],
    white: Array,
) -> tuple[Coefficients, State]:
    """The step from `origin` to `target`, halved as long as half of it leaves less."""
    state = state_at(data, model_effects, target, components)
    for _ in range(HALVINGS):
        half = _midpoint(origin, target)
        half_state = state_at(data, model_effects, half, components)
        if _misfit(half_state, white) >= _misfit(state, white):
            break
        target, state = half, half_state
    return target, state


def _misfit(state: State, white: Array) -> float:
    """Mean square of the residual over the noise."""
    return float(np.mean(((state.data.outputs - state.predicted) / white) ** 2))


def _midpoint(origin: Coefficients, end: Coefficients) -> Coefficients:
    """Halfway; a component that only one of them has, begins or ends at zero."""
    names = {**origin.of, **end.of}
    zero = np.zeros(1)
    coefficients_by_name = {name: (origin.of.get(name, zero) + end.of.get(name, zero)) / 2 for name in names}
    return Coefficients((origin.base + end.base) / 2, coefficients_by_name)


def _refine_shapes(
    components: list[Component],
    g: Gram,
    sizes: Sizes,
    X: Array,
    b: int,
    state: State,
    scales: Mapping[str, float],
    white: Array,
) -> list[Component] | None:
    """The active components at their likeliest shapes, the others held; None: no change."""
    reshaped_components = list(components)
    is_reshaped = False
    for i, comp in enumerate(components):
        if comp.name not in sizes.variances or comp.reshaped is None:
            continue
        gain = gain_of_columns(g, without(g, sizes, comp.name), X, b)

        def gained(shape: tuple[float, ...], comp: Component = comp, gain: Callable[[Array], float] = gain) -> float:
            assert comp.reshaped is not None  # noqa: S101 checked above
            J = comp.reshaped(shape).jacobian(state) / scales[comp.name] / white[:, :, None]
            return gain(J.reshape(-1, J.shape[2]))

        best = climb(gained, comp.shape, comp.step)
        if best != comp.shape:
            reshaped_components[i] = comp.reshaped(best)
            is_reshaped = True
    return reshaped_components if is_reshaped else None


def climb(
    gained: Callable[[tuple[float, ...]], float], shape: tuple[float, ...], step: tuple[float, ...]
) -> tuple[float, ...]:
    """The shape of greatest gain nearby: each value in turn, by a parabola through three points, steps halved."""
    best, top = list(shape), gained(shape)
    for _ in range(3):
        for k in range(len(best)):
            size = step[k]
            for _ in range(5):
                sides = []
                for sign in (-1.0, 1.0):
                    trial = tuple(v + sign * size if j == k else v for j, v in enumerate(best))
                    sides.append((gained(trial), trial))
                value, trial = max(sides)
                if value > top:
                    top, best = value, list(trial)
                else:
                    size *= 0.4
        step = tuple(0.2 * s for s in step)
    return tuple(best)
