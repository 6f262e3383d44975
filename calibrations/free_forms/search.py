"""The search for the components that act: it starts from several beginnings and keeps the likeliest result.

Then it removes the components that this result does not need.

Slow noise is limited in a search, because more of it would explain parts of causes. Flicker above that limit then looks
like random walks and curves over time. Its spectrum separates it from a random walk: for the same power at low
frequencies, flicker has more power at high ones. So the likelihood of all frequencies decides, with a straight drift.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from dataclasses import replace

from calibrations.free_forms.chain import ModelEffects
from calibrations.free_forms.descent import CONVERGED, SLOW_MOST, descend, take_damped_step
from calibrations.free_forms.jumps import STEPS
from calibrations.free_forms.place_names import HISTORY
from calibrations.free_forms.places_in_time import DRIFT_LINE, slow_noise
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.reml import coefficients, estimate
from calibrations.free_forms.search_result import NOISE_ALONE, SearchResult, Setting
from calibrations.free_forms.selection import SPILL
from calibrations.table import Array

SETTLING = 6  # Gauss-Newton steps after components are left out
SMALL_GAIN = 1.0  # of twice the log-likelihood
FEW_COMPONENTS = 3  # up to which one start is enough, if they leave noise alone
# The residual over the noise: a smaller one is explained without flicker; a larger one contains effects that the search
# did not find.
LEAST_MISFIT, MOST_MISFIT = 1.2, 2.0
LIKELIER = 8.0  # of -2 log likelihood: flicker so strong is rare
FLICKER_BEGIN = 0.1  # noise floors: standard deviation from which the estimate of the flicker starts
ANY = 1e8  # a variance that is no limit


def search(
    data: PoseData,
    white: Array,
    model_effects: ModelEffects,
    general: bool = True,
    noise_known: bool = True,
    reason: str = "",
    origin: SearchResult | None = None,
) -> SearchResult:
    """Places that act, with their sizes: the likeliest result of several starts.

    1. Forms of the catalogue first, then free forms. This finds causes that are not smooth.
    2. If that leaves more than noise, or many components: all forms at once. This finds causes of another form.
    3. If the history acts: loops that differ from place to place as well. They resemble most curves with a corner, so
       they have to gain clearly.
    4. If that leaves more than noise: jumps over the output too, where the residual of all smooth forms has any.
    5. If flicker of any size is likelier than the components over time: all again with such flicker. This is left out
       if a misfit may look like flicker: with effects of the given model, a large residual, or no random walks.

    white    standard deviation of each mean, (channels, n)
    general  whether components that can follow almost anything are tried
    noise_known  whether `white` is the noise of the means; else it is the misfit of an earlier search
    reason   why this search follows another one, for the progress
    origin   a search with nearly the same noise that left no more than noise: this one continues from its end
    """
    setting = Setting(data, white, model_effects)
    best = _search_from_all(setting, general, reason) if origin is None else _continue(origin, setting, general, reason)
    may_be_flicker = general and noise_known and not model_effects.columns.shape[2]
    if not may_be_flicker or not LEAST_MISFIT < best.ratio < MOST_MISFIT or not _is_flicker(best):
        return best
    in_flicker = _search_from_all(replace(setting, flicker=True), general, f"{reason}again with flicker noise, ")
    return min(best, in_flicker, key=lambda end: end.criterion)


def _continue(origin: SearchResult, setting: Setting, general: bool, reason: str) -> SearchResult:
    """The end of a descent from the end of another search."""

    def descent(origin: SearchResult) -> SearchResult:
        return descend(setting, general, f"{reason}continued", jumps=STEPS in origin.active, origin=origin)

    return _without_remainders(descent(origin), descent)


def _search_from_all(setting: Setting, general: bool, reason: str) -> SearchResult:
    """The likeliest end of several beginnings."""
    effects_first = descend(setting, general, f"{reason}effects first", catalogue_first=True)
    if effects_first.leaves_noise and len(effects_first.active) <= FEW_COMPONENTS:
        return effects_first
    together = descend(setting, general, f"{reason}all forms together")
    best = min(effects_first, together, key=lambda end: end.criterion)
    if setting.flicker and best.ratio > MOST_MISFIT:
        return best  # flicker of any size does not describe the misfit that it was tried for
    if any(best.component(name).place == HISTORY for name in best.active):
        looped = descend(setting, general, f"{reason}with loops", catalogue_first=True, loops=True)
        best = looped if looped.criterion < best.criterion - SPILL * abs(best.criterion) else best
    if best.ratio >= NOISE_ALONE and setting.first_jumps is not None:
        for catalogue_first, words in ((True, "effects first"), (False, "all forms together")):
            step = f"{reason}with steps of a converter, {words}"
            jumping = descend(setting, general, step, catalogue_first=catalogue_first, jumps=True)
            best = min(best, jumping, key=lambda end: end.criterion)
    step, jumps = f"{reason}without components that are not needed", STEPS in best.active
    return _without_remainders(best, lambda origin: descend(setting, general, step, jumps=jumps, origin=origin))


def _without_remainders(best: SearchResult, descent: Callable[[SearchResult], SearchResult]) -> SearchResult:
    """The search without components that hold the remainder of others, if that is likelier.

    The first steps leave residuals of second order in large effects, which look like other places, and the search adds
    components for them. So each place, and each component, is left out in turn with Gauss-Newton steps of its own; then
    the search continues. Not with a large residual: every component then holds a part of the missing effects.
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
    places = dict.fromkeys(result.component(name).place for name in active)
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
    setting = result.setting
    point = result.point.without({c.name for c in result.components} - names)
    point = replace(point, state=setting.state_at(point.values, point.components))
    limits = setting.slow_limits(point.components, SLOW_MOST)
    for _ in range(SETTLING):
        X, g = setting.linearise(point, result.gram.scales)
        sizes = estimate(g, point.variances, limits)
        values, state = take_damped_step(setting, point.values, coefficients(g, sizes), point.components)
        if not setting.misfit(state) <= 1.5 * setting.misfit(point.state) + 10.0:
            return None
        change = setting.change(point.state, state)
        point = replace(point, variances=sizes.variances, values=values, state=state)
        if change < CONVERGED:
            return SearchResult(setting, point.components, g, X, sizes, values, state)
    return None


def _is_flicker(result: SearchResult) -> bool:
    """Whether flicker of any size and a straight drift are clearly likelier than the walks and curves that act."""
    following = {name for name in result.active if _follows_time(result, name)}
    if not following:
        return False
    data, setting = result.data, result.setting
    noise = slow_noise(data, all_frequencies=True)
    others = [
        c for c in result.components if not c.noise and (c.name in result.sizes.variances or c.name == DRIFT_LINE)
    ]
    scales = {**result.gram.scales, **{component.name: 1.0 for component in noise}}
    g = setting.linearise(replace(result.point, components=[*others, *noise]), scales)[1]
    begin = {component.name: (FLICKER_BEGIN * setting.floor) ** 2 for component in noise}
    acting_variances = {name: v for name, v in result.sizes.variances.items() if name not in begin}
    drift = {DRIFT_LINE: acting_variances.get(DRIFT_LINE, 1.0)} if DRIFT_LINE in g.blocks else {}
    other_variances: Mapping[str, float] = (
        {n: v for n, v in acting_variances.items() if n not in following} | drift | begin
    )
    limited = estimate(g, acting_variances | begin, setting.slow_limits(noise, SLOW_MOST))
    return estimate(g, other_variances, dict.fromkeys(other_variances, ANY)).deviance < limited.deviance - LIKELIER


def _follows_time(result: SearchResult, name: str) -> bool:
    """Whether a component is a bias over time that can have almost any form."""
    component = result.component(name)
    return component.place == "time-bias" and component.form is not None and name != DRIFT_LINE
