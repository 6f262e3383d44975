"""One descent of the search: rounds of selection and Gauss-Newton steps until nothing changes.

Each round linearises the chain at the present point, selects the components that act, and takes a step. The first
rounds take only large components: a small one may be a second-order remainder of large ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibrations.free_forms.chain import Coefficients, State, start
from calibrations.free_forms.components import Component
from calibrations.free_forms.jumps import STEPS, find_jumps
from calibrations.free_forms.places import components as all_components
from calibrations.free_forms.places import is_off_centre
from calibrations.free_forms.reml import (
    Gram,
    Sizes,
    coefficients,
    estimate,
    scale_components,
    without,
)
from calibrations.free_forms.saw import find_saw
from calibrations.free_forms.search_result import MISFIT, Point, SearchResult, Setting, finish
from calibrations.free_forms.selection import ENTER, pools_of, select
from calibrations.free_forms.shapes import refine_shapes
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
JUMP_TRIALS = 2  # of steps over the output, in one descent
CAUTION = 30.0  # times the gain that a component needs after a step that failed


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


def _begin(setting: Setting, general: bool, loops: bool, jumps: bool) -> Point:
    """The base, and all components that these poses can show."""
    data = setting.data
    values = start(data, setting.model_effects)
    state = setting.state_at(values, ())
    components = [
        c
        for c in all_components(data, state, setting.flicker)
        if (general or not c.general) and (loops or not c.has_loops) and not (jumps and is_off_centre(c))
    ]
    steps = setting.first_jumps if jumps else None
    slow = {c.name: (SLOW_BEGIN * setting.floor) ** 2 for c in components if c.noise}
    return Point([*components, *([steps] if steps else [])], slow, values, state)


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
    is_same = set(moved.variances) == set(point.variances)
    if is_same and not any(c.cause == "quantisation" for c in moved.components):
        residual = setting.data.outputs - moved.state.predicted
        saw = find_saw(setting.data, moved.state, setting.white, residual, progress.rejected, ENTER)
        if saw is not None:
            return replace(progress, point=replace(moved, components=[*moved.components, saw]))
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
