"""One descent of the search: rounds of selection and Gauss-Newton steps until nothing changes.

Each round linearises the chain at the present point, selects the components that act, and takes a step. The first
rounds take only large components: a small one may be a second-order remainder of large ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibrations.free_forms.chain import Coefficients, ModelEffects, State, base_size, start, state_at
from calibrations.free_forms.components import Component
from calibrations.free_forms.jumps import STEPS, find_jumps
from calibrations.free_forms.places import components as all_components
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.reml import (
    Gram,
    Sizes,
    coefficients,
    estimate,
    gram,
    scale_components,
    whiten,
    without,
)
from calibrations.free_forms.selection import ENTER, pools_of, prices, select
from calibrations.free_forms.shapes import refine_shapes
from calibrations.free_forms.stairs import find_saw
from calibrations.means.noise import rms
from calibrations.progress import report
from calibrations.table import Array

COARSE = (1e-3, 2e-5)  # of the misfit, in the first rounds: a smaller component may be a second-order remainder
ROUNDS = 7
EXCHANGES_AGAIN = 0.3  # noise floors by which the output changes, rms: exchanges of the same components are tried again
CONVERGED = 0.03  # noise floors by which the output changes, rms
LARGEST = 4.0  # of the mean square of the first misfit: larger components cancel each other
HALVINGS = 6  # of a step that overshoots
SLOW_BEGIN = 0.1  # slow noise, in noise floors (rms): where its estimate starts
SLOW_FIRST = 0.15  # the most slow noise while the first components are found: more would explain a part of them
SLOW_MOST = 0.5  # at most
MOST_SLOW = 1.0  # noise floors (rms) that such slow noise takes up: more is something that moves with time
NOISE_ALONE = 1.04  # residual over noise, up to which it is noise
JUMP_TRIALS = 2  # of steps over the output, in one descent
MISFIT = 1.08  # mean square of the residual over the noise: from there on steps over the output are tried
CAUTION = 30.0  # times the gain that a component needs after a step that failed


@dataclass(frozen=True, eq=False)
class Setting:
    """The input of a descent.

    white    standard deviation of each mean, (channels, n)
    flicker  whether slow noise may be of any size
    """

    data: PoseData
    white: Array
    model_effects: ModelEffects
    flicker: bool = False

    @property
    def floor(self) -> float:
        """The noise of a mean, rms."""
        return float(np.sqrt(np.mean(self.white**2)))

    @property
    def base_size(self) -> int:
        """Number of base columns."""
        return base_size(self.data, self.model_effects)

    def slow_limits(self, components: Iterable[Component], most: float) -> dict[str, float]:
        """Limits of the variances of slow noise; `most` in noise floors."""
        return {} if self.flicker else {c.name: (most * self.floor) ** 2 for c in components if c.noise}

    def state_at(self, values: Coefficients, components: Sequence[Component]) -> State:
        """All signals of the chain."""
        return state_at(self.data, self.model_effects, values, components)

    def linearise(self, point: Point, scales: Mapping[str, float]) -> tuple[Array, Gram]:
        """Columns [base, components, data] over the noise, and their products."""
        X, blocks, all_scales = whiten(
            point.state, self.model_effects, point.values, point.components, scales, self.white
        )
        return X, gram(X, blocks, all_scales, self.base_size, self.data.channels)

    @cached_property
    def first_jumps(self) -> Component | None:
        """Steps over the output beside everything smooth that these poses can show, whether it acts or not."""
        values = start(self.data, self.model_effects)
        state = self.state_at(values, ())
        misfit = self.misfit(state)
        if misfit < MISFIT:
            return None
        components = [c for c in all_components(self.data, state) if not c.general and not c.has_loops]
        X, g = self.linearise(Point(components, {}, values, state), {})
        X, g = scale_components(X, g)
        sizes = estimate(g, {c.name: misfit * self.floor**2 for c in components}, {}, rounds=0)
        return find_jumps(state, self.white, X, g, sizes)

    def misfit(self, state: State) -> float:
        """Mean square of the residual over the noise."""
        return float(np.mean(((self.data.outputs - state.predicted) / self.white) ** 2))

    def change(self, before: State, after: State) -> float:
        """Change of the output, rms in noise floors."""
        return float(np.sqrt(np.mean(((after.predicted - before.predicted) / self.white) ** 2)))


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a descent: all components, the variances of those that act, and the chain at their coefficients."""

    components: Sequence[Component]
    variances: Mapping[str, float]
    values: Coefficients
    state: State

    def without(self, names: Iterable[str]) -> Point:
        """Without components that have not changed the state yet."""
        left_out = set(names)
        return Point(
            [c for c in self.components if c.name not in left_out],
            {name: v for name, v in self.variances.items() if name not in left_out},
            Coefficients(self.values.base, {k: v for k, v in self.values.of.items() if k not in left_out}),
            self.state,
        )


@dataclass(frozen=True, eq=False)
class _Progress:
    """A descent after some rounds.

    limits     of the variances
    caution    factor on the gain that a component needs
    rejected   frequencies of saws that failed
    exchanged  components among which exchanges were tried
    change     of the output in the last round, rms in noise floors
    """

    point: Point
    scales: Mapping[str, float]
    limits: Mapping[str, float] | None = None
    caution: float = 1.0
    rejected: tuple[float, ...] = ()
    exchanged: frozenset[str] = frozenset()
    change: float = np.inf
    converged: bool = False


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The result of a descent or of a search."""

    setting: Setting
    components: Sequence[Component]
    gram: Gram
    columns: Array  # whitened [base, components, data]
    sizes: Sizes
    values: Coefficients
    state: State

    @property
    def data(self) -> PoseData:
        """The poses."""
        return self.setting.data

    @property
    def white(self) -> Array:
        """Standard deviation of each mean, (channels, n)."""
        return self.setting.white

    @property
    def point(self) -> Point:
        """Where the descent ended."""
        return Point(self.components, self.sizes.variances, self.values, self.state)

    def component(self, name: str) -> Component:
        return next(c for c in self.components if c.name == name)

    @property
    def residual(self) -> Array:
        """Whitened residual, (channels * n,)."""
        b, g = self.setting.base_size, self.gram
        rows = g.indices(self.sizes.variances)
        base = g.base_inverse @ (g.base_with_data - g.base_products[:, rows] @ self.sizes.coefficients)
        fitted = self.columns[:, :b] @ base + self.columns[:, b + rows] @ self.sizes.coefficients
        return np.asarray(self.columns[:, -1] - fitted)

    @cached_property
    def slow(self) -> Array:
        """What slow noise takes up, over the white noise, (channels * n,)."""
        b = self.setting.base_size
        slow = np.zeros(len(self.columns))
        for component in self.components:
            if component.noise and component.name in self.sizes.variances:
                block = self.gram.blocks[component.name]
                slow += self.columns[:, b + block.start : b + block.stop] @ self.sizes.of(self.gram, component.name)
        return slow

    @property
    def error(self) -> float:
        """Rms of what all components but slow noise leave, in the output's unit."""
        return float(np.sqrt(np.mean(((self.residual + self.slow) * self.white.ravel()) ** 2)))

    @property
    def leaves_noise(self) -> bool:
        """Whether what the components leave is noise: white noise, and no more slow noise than there may be."""
        slow = 0.0 if self.setting.flicker else float(rms(self.slow))
        return self.ratio < NOISE_ALONE and slow < MOST_SLOW

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
        """The minimised criterion: -2 log restricted likelihood, plus a price for each component that acts."""
        return self.sizes.deviance + ENTER * len(self.active) + prices(self.component(name) for name in self.active)


def descend(
    setting: Setting,
    general: bool,
    step: str,
    catalogue_first: bool = False,
    loops: bool = False,
    jumps: bool = False,
    origin: SearchResult | None = None,
) -> SearchResult:
    """The end of a descent from the base, or from the components of an earlier search.

    general          whether components that can follow almost anything are tried
    step             which of several searches this is, for the progress
    catalogue_first  whether the first rounds prefer forms of the catalogue to free ones
    loops            whether hysteresis whose loops differ from place to place is tried
    jumps            whether steps over the output are tried
    """
    point = _begin(setting, general, loops, jumps) if origin is None else origin.point
    progress = _Progress(point, {})
    first, trials = 0 if origin is None else len(COARSE), 0
    for number in range(first, ROUNDS):
        report(f"searching for places ({step}), pass {number - first + 1} of at most {ROUNDS - first}")
        progress = _advance(setting, progress, number, catalogue_first)
        if jumps and trials < JUMP_TRIALS and (progress.converged or number == ROUNDS - 3):
            trials += 1
            progress = _with_jumps(setting, progress)
        if progress.converged:
            break
    return finish(setting, progress.point, progress.scales, progress.limits or {})


def finish(setting: Setting, point: Point, scales: Mapping[str, float], limits: Mapping[str, float]) -> SearchResult:
    """The result at a point, linearised once more."""
    X, g = setting.linearise(point, scales)
    sizes = estimate(g, point.variances, limits)
    values = coefficients(g, sizes)
    return SearchResult(setting, point.components, g, X, sizes, values, setting.state_at(values, point.components))


def _begin(setting: Setting, general: bool, loops: bool, jumps: bool) -> Point:
    """The base, and all components that these poses can show."""
    data = setting.data
    values = start(data, setting.model_effects)
    state = setting.state_at(values, ())
    components = [
        c
        for c in all_components(data, state, setting.flicker)
        if (general or not c.general) and (loops or not c.has_loops)
    ]
    saw = find_saw(data, state, setting.white, data.outputs - state.predicted, (), ENTER)
    steps = setting.first_jumps if jumps else None
    slow = {c.name: (SLOW_BEGIN * setting.floor) ** 2 for c in components if c.noise}
    return Point([*components, *([saw] if saw else []), *([steps] if steps else [])], slow, values, state)


def _advance(setting: Setting, progress: _Progress, number: int, catalogue_first: bool) -> _Progress:
    """One round: a linearisation, a selection and a step."""
    point, is_coarse = progress.point, number < len(COARSE)
    X, g = setting.linearise(point, progress.scales)
    if progress.limits is None:
        X, g = scale_components(X, g)
        largest = LARGEST * g.squares / g.rows * setting.floor**2
        progress = replace(progress, limits={c.name: largest for c in point.components if not c.noise})
    limits = {
        **(progress.limits or {}), **setting.slow_limits(point.components, SLOW_FIRST if is_coarse else SLOW_MOST)
    }  # fmt: skip
    least_gain = progress.caution * (max(ENTER, COARSE[number] * g.squares) if is_coarse else ENTER)
    exchanges = not is_coarse and not (set(point.variances) == progress.exchanged and progress.change < EXCHANGES_AGAIN)
    sizes = select(
        g, estimate(g, point.variances, limits), point.components,
        pools_of(point.components, catalogue_first and is_coarse), limits, least_gain, exchanges,
    )  # fmt: skip
    moved = _take_step(setting, point, X, g, sizes, limits)
    progress = replace(
        progress,
        scales=g.scales,
        limits=limits,
        exchanged=frozenset() if is_coarse else frozenset(sizes.variances),
        change=setting.change(point.state, moved.state),
    )
    if setting.misfit(moved.state) > 1.5 * g.squares / g.rows + 10.0:  # components against each other: no step
        return _after_failure(progress, moved)
    progress = replace(progress, point=moved)
    if not any(c.cause == "quantisation" for c in moved.components):
        residual = setting.data.outputs - moved.state.predicted
        saw = find_saw(setting.data, moved.state, setting.white, residual, progress.rejected, ENTER)
        if saw is not None:
            return replace(progress, point=replace(moved, components=[*moved.components, saw]))
    is_same = set(moved.variances) == set(point.variances)
    return replace(progress, converged=not is_coarse and is_same and progress.change < CONVERGED)


def _with_jumps(setting: Setting, progress: _Progress) -> _Progress:
    """The descent with steps over the output to try, where the residual shows other ones than those that act."""
    point = progress.point
    if setting.misfit(point.state) < MISFIT:
        return progress
    X, g = setting.linearise(point, progress.scales)
    sizes = estimate(g, point.variances, progress.limits or {})
    beside = without(g, sizes, STEPS) if STEPS in sizes.variances else sizes
    steps = find_jumps(point.state, setting.white, X, g, beside)
    before = next((c for c in point.components if c.name == STEPS), None)
    if steps is None or (before is not None and before.form == steps.form):
        return progress
    others = point.without({STEPS})
    components = [*others.components, steps]
    state = setting.state_at(others.values, others.components)
    scales = {name: scale for name, scale in progress.scales.items() if name != STEPS}
    return replace(progress, point=replace(others, components=components, state=state), scales=scales, converged=False)


def _take_step(setting: Setting, point: Point, X: Array, g: Gram, sizes: Sizes, limits: Mapping[str, float]) -> Point:
    """The point after a Gauss-Newton step, with the shapes of the active components changed where that leaves less."""
    target = coefficients(g, sizes)
    values, state = take_damped_step(setting, point.values, target, point.components)
    moved = Point(point.components, sizes.variances, values, state)
    reshaped = refine_shapes(point.components, point.state, setting.white, X, g, sizes)
    if reshaped is None:
        return moved
    acting = [c for c in reshaped if c.name in sizes.variances]
    reshaped_g = setting.linearise(replace(point, components=acting), g.scales)[1]
    reshaped_sizes = estimate(reshaped_g, sizes.variances, limits)
    reshaped_values = coefficients(reshaped_g, reshaped_sizes)
    reshaped_state = setting.state_at(reshaped_values, reshaped)
    if setting.misfit(reshaped_state) < setting.misfit(state):
        return Point(reshaped, reshaped_sizes.variances, reshaped_values, reshaped_state)
    return moved


def _after_failure(progress: _Progress, failed: Point) -> _Progress:
    """The descent before a step that failed: without the saws that acted, or else with more caution."""
    saws = [c for c in failed.components if c.cause == "quantisation" and c.name in failed.variances]
    rejected = (*progress.rejected, *(saw.shape[0] for saw in saws))
    caution = progress.caution * (1.0 if saws else CAUTION)
    return replace(progress, point=progress.point.without(c.name for c in saws), rejected=rejected, caution=caution)


def take_damped_step(
    setting: Setting, origin: Coefficients, target: Coefficients, components: Sequence[Component]
) -> tuple[Coefficients, State]:
    """The step from `origin` to `target`, halved as long as half of it leaves less."""
    state = setting.state_at(target, components)
    for _ in range(HALVINGS):
        half = _midpoint(origin, target)
        half_state = setting.state_at(half, components)
        if setting.misfit(half_state) >= setting.misfit(state):
            break
        target, state = half, half_state
    return target, state


def _midpoint(origin: Coefficients, end: Coefficients) -> Coefficients:
    """Halfway; a component that only one of them has, begins or ends at zero."""
    names = {**origin.of, **end.of}
    zero = np.zeros(1)
    coefficients_by_name = {name: (origin.of.get(name, zero) + end.of.get(name, zero)) / 2 for name in names}
    return Coefficients((origin.base + end.base) / 2, coefficients_by_name)
