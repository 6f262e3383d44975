"""Search for the missing parts of a noise model on a record: lines, a mixture of processes, and other disturbances.

1. Lines that exceed the widest mixture are removed, if an effect of the catalogue describes lines.
2. Every mixture of processes is fitted to the remaining spectrum (`mixtures`).
3. A step, a drift or an output that follows a logged column is removed if it makes a process unnecessary. This repeats
   until no such pattern remains.

`candidates` ranks every process alone, added to the model.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibrations.criteria import AT_LONGEST_TIME, IDENTIFIED, INSEPARABLE, MOST_PATTERNS
from calibrations.discovery.findings import Candidate
from calibrations.effects import Effect
from calibrations.model import Model
from calibrations.noise.fit import (
    NoiseFit,
    find_lines,
    fit,
    gain_of,
    line_capacity,
    noise_terms,
    shape_grid,
    without_effects,
)
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.lines import Lines
from calibrations.noise.mixtures import Mixture, Mixtures, chance, likelihood, tube
from calibrations.noise.patterns import FOLLOWS, Pattern, pattern_of, refit_patterns
from calibrations.noise.record import Still
from calibrations.noise.signal import with_cleaned_curves
from calibrations.noise.telegraph import Telegraph, telegraph_of


@dataclass(frozen=True)
class Search:
    """The missing parts of a model: lines and patterns, removed from `still`, and mixtures of processes."""

    still: Still
    model: Model
    effects: Mapping[str, Effect]  # of noise, by name
    lines: tuple[Lines, ...]  # per channel
    patterns: tuple[Pattern, ...]
    mixtures: Mixtures
    telegraphs: tuple[Telegraph, ...] = ()
    uncleaned: Search | None = None  # the same search before patterns were removed, where some were

    @property
    def mixture(self) -> Mixture:
        """The mixture with the greatest worth."""
        return self.mixtures.best

    @cached_property
    def liner(self) -> Effect | None:
        """The effect that lines are named by, where the model does not hold it and there are some."""
        missing = (e for e in self.effects.values() if "lines" in e.places and e.name not in self.model.effects)
        return next(missing, None) if any(self.lines) else None

    @cached_property
    def gains(self) -> dict[str, float]:
        """Missing effects, and twice the log-likelihood that the final fit loses without each.

        Each one gains most on top of those before it, so that the error falls early.
        """
        losses = {name: self.mixtures.lost_without(self.mixture, name) for name in self.mixture.names}
        if self.liner is not None:
            losses[self.liner.name] = max(self._of_lines(), sum(map(_gain_of_lines, self.lines)))
        return {name: losses[name] for name in self._in_order(losses)}

    def _of_lines(self) -> float:
        """Twice the log-likelihood that the bands lose where lines stay in the record."""
        model = self.model
        for name in self.mixture.names:
            model = model.with_effect(self.effects[name])
        return 2 * (likelihood(self.mixture.channels) - fit(model, self.still).log_likelihood)

    def _in_order(self, losses: Mapping[str, float]) -> Iterator[str]:
        """Lines gain the same in any order."""
        waiting, level = list(losses), 0.0
        present: list[Effect] = []
        while waiting:
            remaining = [effect for effect in self.mixture.effects if effect.name in waiting]
            gains_by_name = {effect.name: self.mixtures.of([*present, effect]).gain - level for effect in remaining}
            best = max(waiting, key=lambda name: gains_by_name.get(name, losses[name]))
            yield best
            waiting.remove(best)
            present += [effect for effect in remaining if effect.name == best]
            level += gains_by_name.get(best, 0.0)

    @cached_property
    def rivals(self) -> dict[str, tuple[str, ...]]:
        """For each missing process, those that explain the record as well in its place."""
        return {effect.name: tuple(self._rivals(effect)) for effect in self.mixture.effects}

    @cached_property
    def end(self) -> NoiseFit:
        """The fit of the model with all missing effects."""
        model = self.model
        for name in self.gains:
            model = model.with_effect(self.effects[name])
        return NoiseFit(self.still, model, self.mixture.channels)

    def _rivals(self, effect: Effect) -> list[str]:
        remaining = [e for e in self.mixture.effects if e is not effect]
        names_of_rivals = []
        for candidate in self.mixtures.missing:
            if candidate in self.mixture.effects:
                continue
            swapped = self.mixtures.of([*remaining, candidate])
            if effect.name in candidate.contains and _at_longest_shape(swapped, candidate):
                continue
            if self.mixture.gain - swapped.gain < INSEPARABLE and _is_identified(swapped, candidate):
                names_of_rivals.append(candidate.name)
        return names_of_rivals


def _gain_of_lines(lines: Lines) -> float:
    """Twice the log-likelihood that lines gain where they are, by their amplitudes."""
    return float(sum((line.amplitude / line.std) ** 2 for line in lines))


def _is_identified(mixture: Mixture, effect: Effect) -> bool:
    """Whether an effect of a mixture is identified in a channel, as in a table of parameters."""
    return any(gain_of(channel, effect) > IDENTIFIED for channel in mixture.channels)


def _at_longest_shape(mixture: Mixture, effect: Effect) -> bool:
    """Whether an effect has the longest time constant that the record can show, so that a simpler process equals it."""
    shape = effect.parameters[1].name
    return all(
        channel.values[effect.name][shape] > AT_LONGEST_TIME * shape_grid(effect, shape, channel.channel)[-1]
        for channel in mixture.channels
    )


def search(still: Still, model: Model, effects: Mapping[str, Effect]) -> Search:
    """Raises ModelError for a model without noise."""
    model_effects = tuple(term.effect for term in noise_terms(model))
    noises = {name: effect for name, effect in effects.items() if effect.is_noise}
    noises |= {effect.name: effect for effect in model_effects}
    result = _search_once(still, model, noises, model_effects)
    if result.mixture.effects:
        result = replace(result, telegraphs=tuple(filter(None, map(telegraph_of, result.mixture.channels))))
    first = result
    while len(result.patterns) < MOST_PATTERNS * len(still.channels):
        cleaned = _remove_next_pattern(still, result, model_effects)
        if cleaned is result:
            break
        result = cleaned
    return replace(_with_common_amounts(still, result, model_effects), uncleaned=first) if result.patterns else result


def _with_common_amounts(still: Still, search: Search, model_effects: tuple[Effect, ...]) -> Search:
    """The search with the amounts of all patterns fitted together with the processes."""
    channel_fits = search.mixture.channels
    patterns = _with_amounts(still, search.patterns, channel_fits)
    patterns = _with_amounts(still, tuple(pattern for pattern in patterns if not pattern.needless), channel_fits)
    cleaned = with_cleaned_curves(without_patterns(still, patterns), {pattern.axis for pattern in patterns})
    result = _search_once(cleaned, search.model, search.effects, model_effects)
    return replace(result, patterns=patterns, telegraphs=search.telegraphs)


def _with_amounts(
    still: Still, patterns: tuple[Pattern, ...], channel_fits: tuple[ChannelFit, ...]
) -> tuple[Pattern, ...]:
    """The patterns with their amounts fitted together, channel by channel, to the record with all patterns."""
    fitted: list[Pattern] = []
    for channel, present in zip(still.channels, channel_fits, strict=True):
        channel_patterns = tuple(pattern for pattern in patterns if pattern.axis == channel.axis)
        fitted += refit_patterns(channel_patterns, present, channel) if channel_patterns else ()
    return tuple(fitted)


def _remove_next_pattern(still: Still, search: Search, model_effects: tuple[Effect, ...]) -> Search:
    """The search on a record without the next patterns, if it explains the record better; otherwise `search`.

    A pattern found in the record itself must also make a process unnecessary, or be significant together with the best
    mixture: noise that jumps has steps and slopes of its own. A logged column is independent of the noise.
    """
    significant, likely = (_patterns(search, channels) for channels in (search.mixture.channels, search.mixtures.base))
    searches = [
        _search_without(still, search, patterns, model_effects) for patterns in (significant, likely) if patterns
    ]
    best = max(searches, key=_score, default=search)
    logged = any(pattern.kind == FOLLOWS for pattern in best.patterns[len(search.patterns) :])
    threshold = _score(search) + (0.0 if logged else INSEPARABLE)
    if _score(best) <= threshold or likelihood(best.mixtures.base) < likelihood(search.mixtures.base):
        return search  # without it the model explains less: it was noise
    is_smaller = len(best.gains) < len(search.gains)
    return best if is_smaller or logged or any(pattern.certain for pattern in significant) else search


def _search_without(
    still: Still, search: Search, patterns: tuple[Pattern, ...], model_effects: tuple[Effect, ...]
) -> Search:
    """The search without further patterns. It refits all amounts, because a curvature changes the slope."""
    all_patterns = search.patterns + patterns
    all_patterns = _with_amounts(still, all_patterns, search.mixture.channels) if search.patterns else all_patterns
    result = _search_once(without_patterns(still, all_patterns), search.model, search.effects, model_effects)
    return replace(result, patterns=all_patterns, telegraphs=search.telegraphs)


def _patterns(search: Search, channels: tuple[ChannelFit, ...]) -> tuple[Pattern, ...]:
    """The pattern of each channel that has one. A channel that jumps between levels has steps anyway."""
    jumping = {telegraph.axis for telegraph in search.telegraphs}
    free = (fit for fit in channels if fit.channel.axis not in jumping)
    return tuple(filter(None, (pattern_of(fit, search.patterns) for fit in free)))


def without_patterns(still: Still, patterns: tuple[Pattern, ...]) -> Still:
    """The record less the patterns; its Allan deviations are still those with them."""
    channels = still.channels
    for pattern in patterns:
        channels = tuple(pattern.remove_from(channel) for channel in channels)
    return replace(still, channels=channels)


def _score(search: Search) -> float:
    """Twice the log-likelihood of the best mixture, minus the prices of its effects and of the patterns."""
    price = sum(search.mixtures.prices[name] for name in search.mixture.names)
    price += sum(pattern.price for pattern in search.patterns)
    return 2 * sum(channel.log_likelihood for channel in search.mixture.channels) - price


def _search_once(still: Still, model: Model, noises: Mapping[str, Effect], model_effects: tuple[Effect, ...]) -> Search:
    smooth = tuple(effect for effect in model_effects if "spectrum" in effect.places)
    missing = tuple(e for e in noises.values() if "spectrum" in e.places and e not in smooth)
    simple_effects = tuple(effect for effect in (*smooth, *missing) if len(effect.parameters) == 1)
    max_lines = line_capacity(noises.values())
    channel_fits = tuple(
        find_lines(c, simple_effects, max_lines) if max_lines else without_effects(c) for c in still.channels
    )
    return Search(
        still, model, noises, tuple(fit.lines for fit in channel_fits), (), Mixtures(channel_fits, smooth, missing)
    )


def candidates(search: Search, base: NoiseFit, doubts: Mapping[str, tuple[str, ...]]) -> tuple[Candidate, ...]:
    """Every effect that the model does not hold, each alone on top of it; those that are missed come first."""
    missing = [effect for name, effect in search.effects.items() if name not in base.model.effects]
    extended_fits = {effect.name: fit(base.model.with_effect(effect), search.still) for effect in missing}
    gains = {name: 2 * (extended.log_likelihood - base.log_likelihood) for name, extended in extended_fits.items()}
    if search.liner is not None:
        gains[search.liner.name] = max(gains[search.liner.name], search.gains[search.liner.name])
    bands = sum(len(extended.density) for extended in base.channels)
    scores = np.array([_schwarz(effect, gains[effect.name], base, bands) for effect in missing])
    odds = np.exp(np.minimum(np.append(scores, 0.0) - max([*scores, 0.0]), 0.0) / 2)
    probability = odds / odds.sum()
    result = [
        Candidate(
            effect=effect,
            gain=gains[effect.name],
            p_value=_p_value(effect, gains[effect.name], base, len(missing)),
            probability=float(probability[k]),
            excess_after=extended_fits[effect.name].pooled_excess,
            held_out_after=extended_fits[effect.name].held_out_excess,
            indistinguishable_from=doubts.get(effect.name, ()),
        )
        for k, effect in enumerate(missing)
    ]
    order = {name: k for k, name in enumerate(search.gains)}
    result.sort(key=lambda c: (order.get(c.name, len(order)), -_schwarz(c.effect, c.gain, base, bands)))
    return tuple(result)


def _schwarz(effect: Effect, gain: float, base: NoiseFit, bands: int) -> float:
    """Gain minus the price of the parameters, log(bands) each; of lines, the parameters of one line."""
    count = 2 if "lines" in effect.places else len(effect.parameters)
    return gain - len(base.channels) * count * float(np.log(bands))


def _p_value(effect: Effect, gain: float, base: NoiseFit, trials: int) -> float:
    """Chance of such a gain anywhere in the search for a complete model."""
    if "lines" in effect.places:
        ordinates = sum(channel.channel.n / 2 for channel in base.channels)
        return float(min(1.0, trials * ordinates * np.exp(-gain / 2)))
    return min(1.0, trials * chance(gain, [tube(channel, effect) for channel in base.channels]))
