"""What a noise model is missing on a record: lines, a mixture of processes, and disturbances that are not noise.

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
    most_lines,
    noise_terms,
    shape_grid,
    without_effects,
)
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.lines import Lines
from calibrations.noise.mixtures import Mixture, Mixtures, chance, likelihood, tube
from calibrations.noise.patterns import FOLLOWS, Pattern, pattern_of, refitted
from calibrations.noise.record import Still
from calibrations.noise.signal import with_cleaned_curves
from calibrations.noise.telegraph import Telegraph, telegraph_of


@dataclass(frozen=True)
class Search:
    """What a model lacks: lines and patterns, removed from `still`, and mixtures of processes in the rest."""

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
            tried = {effect.name: self.mixtures.of([*present, effect]).gain - level for effect in remaining}
            best = max(waiting, key=lambda name: tried.get(name, losses[name]))
            yield best
            waiting.remove(best)
            present += [effect for effect in remaining if effect.name == best]
            level += tried.get(best, 0.0)

    @cached_property
    def rivals(self) -> dict[str, tuple[str, ...]]:
        """By missing process, those that explain the record as well in its place."""
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
        for candidate in self.mixtures.others:
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
    """Whether an effect's shape is the longest that a record shows: it then is the process that it contains."""
    shape = effect.parameters[1].name
    return all(
        channel.values[effect.name][shape] > AT_LONGEST_TIME * shape_grid(effect, shape, channel.channel)[-1]
        for channel in mixture.channels
    )


def search(still: Still, model: Model, effects: Mapping[str, Effect]) -> Search:
    """Raises ModelError for a model without noise."""
    own = tuple(term.effect for term in noise_terms(model))
    noises = {name: effect for name, effect in effects.items() if effect.is_noise}
    noises |= {effect.name: effect for effect in own}
    result = _search_once(still, model, noises, own)
    if result.mixture.effects:
        result = replace(result, telegraphs=tuple(filter(None, map(telegraph_of, result.mixture.channels))))
    first = result
    while len(result.patterns) < MOST_PATTERNS * len(still.channels):
        more = _remove_next_pattern(still, result, own)
        if more is result:
            break
        result = more
    return replace(_with_common_amounts(still, result, own), uncleaned=first) if result.patterns else result


def _with_common_amounts(still: Still, search: Search, own: tuple[Effect, ...]) -> Search:
    """With the amounts of all patterns fitted at once, beside the processes that are left."""
    beside = search.mixture.channels
    patterns = _with_amounts(still, search.patterns, beside)
    patterns = _with_amounts(still, tuple(pattern for pattern in patterns if not pattern.needless), beside)
    cleaned = with_cleaned_curves(without_patterns(still, patterns), {pattern.axis for pattern in patterns})
    result = _search_once(cleaned, search.model, search.effects, own)
    return replace(result, patterns=patterns, telegraphs=search.telegraphs)


def _with_amounts(still: Still, patterns: tuple[Pattern, ...], beside: tuple[ChannelFit, ...]) -> tuple[Pattern, ...]:
    """The patterns with their amounts fitted together, channel by channel, to the record that holds them all."""
    fitted: list[Pattern] = []
    for channel, present in zip(still.channels, beside, strict=True):
        own = tuple(pattern for pattern in patterns if pattern.axis == channel.axis)
        fitted += refitted(own, present, channel) if own else ()
    return tuple(fitted)


def _remove_next_pattern(still: Still, search: Search, own: tuple[Effect, ...]) -> Search:
    """The search without the patterns that stand out, if that explains the record better; otherwise `search`.

    A form that is searched for in the record itself must also make a process unnecessary, or be no chance beside the
    best mixture: noise that jumps has steps and slopes of its own. A logged column is independent of the noise.
    """
    sure, likely = (_patterns(search, channels) for channels in (search.mixture.channels, search.mixtures.base))
    tried = [_search_without(still, search, patterns, own) for patterns in (sure, likely) if patterns]
    best = max(tried, key=_worth, default=search)
    logged = any(pattern.kind == FOLLOWS for pattern in best.patterns[len(search.patterns) :])
    least = _worth(search) + (0.0 if logged else INSEPARABLE)
    if _worth(best) <= least or likelihood(best.mixtures.base) < likelihood(search.mixtures.base):
        return search  # without it the model explains less: it was noise
    fewer = len(best.gains) < len(search.gains)
    return best if fewer or logged or any(pattern.certain for pattern in sure) else search


def _search_without(still: Still, search: Search, patterns: tuple[Pattern, ...], own: tuple[Effect, ...]) -> Search:
    """The search without further patterns. A curvature changes the slope beside it, so that amounts are fitted anew."""
    together = search.patterns + patterns
    together = _with_amounts(still, together, search.mixture.channels) if search.patterns else together
    result = _search_once(without_patterns(still, together), search.model, search.effects, own)
    return replace(result, patterns=together, telegraphs=search.telegraphs)


def _patterns(search: Search, channels: tuple[ChannelFit, ...]) -> tuple[Pattern, ...]:
    """The pattern of each channel that has one. A channel that jumps between two levels has steps anyway."""
    jumping = {telegraph.axis for telegraph in search.telegraphs}
    free = (fit for fit in channels if fit.channel.axis not in jumping)
    return tuple(filter(None, (pattern_of(fit, search.patterns) for fit in free)))


def without_patterns(still: Still, patterns: tuple[Pattern, ...]) -> Still:
    """The record less the patterns; its Allan deviations are still those with them."""
    channels = still.channels
    for pattern in patterns:
        channels = tuple(pattern.taken_off(channel) for channel in channels)
    return replace(still, channels=channels)


def _worth(search: Search) -> float:
    """Twice the log-likelihood of the best mixture, less the prices of its effects and of the patterns."""
    price = sum(search.mixtures.prices[name] for name in search.mixture.names)
    price += sum(pattern.price for pattern in search.patterns)
    return 2 * sum(channel.log_likelihood for channel in search.mixture.channels) - price


def _search_once(still: Still, model: Model, noises: Mapping[str, Effect], own: tuple[Effect, ...]) -> Search:
    smooth = tuple(effect for effect in own if "spectrum" in effect.places)
    missing = tuple(e for e in noises.values() if "spectrum" in e.places and e not in smooth)
    plain = tuple(effect for effect in (*smooth, *missing) if len(effect.parameters) == 1)
    most = most_lines(noises.values())
    shown = tuple(find_lines(c, plain, most) if most else without_effects(c) for c in still.channels)
    return Search(still, model, noises, tuple(fit.lines for fit in shown), (), Mixtures(shown, smooth, missing))


def candidates(search: Search, before: NoiseFit, doubts: Mapping[str, tuple[str, ...]]) -> tuple[Candidate, ...]:
    """Every effect that the model does not hold, each alone on top of it; those that are missed come first."""
    missing = [effect for name, effect in search.effects.items() if name not in before.model.effects]
    after = {effect.name: fit(before.model.with_effect(effect), search.still) for effect in missing}
    gains = {name: 2 * (extended.log_likelihood - before.log_likelihood) for name, extended in after.items()}
    if search.liner is not None:
        gains[search.liner.name] = max(gains[search.liner.name], search.gains[search.liner.name])
    bands = sum(len(extended.seen) for extended in before.channels)
    worth = np.array([_schwarz(effect, gains[effect.name], before, bands) for effect in missing])
    odds = np.exp(np.minimum(np.append(worth, 0.0) - max([*worth, 0.0]), 0.0) / 2)
    probability = odds / odds.sum()
    result = [
        Candidate(
            effect=effect,
            gain=gains[effect.name],
            p_value=_p_value(effect, gains[effect.name], before, len(missing)),
            probability=float(probability[k]),
            excess_after=after[effect.name].pooled_excess,
            held_out_after=after[effect.name].held_out_excess,
            indistinguishable_from=doubts.get(effect.name, ()),
        )
        for k, effect in enumerate(missing)
    ]
    order = {name: k for k, name in enumerate(search.gains)}
    result.sort(key=lambda c: (order.get(c.name, len(order)), -_schwarz(c.effect, c.gain, before, bands)))
    return tuple(result)


def _schwarz(effect: Effect, gain: float, before: NoiseFit, bands: int) -> float:
    """Gain less the price of the parameters, log(bands) each; of lines, those that it takes for one."""
    count = 2 if "lines" in effect.places else len(effect.parameters)
    return gain - len(before.channels) * count * float(np.log(bands))


def _p_value(effect: Effect, gain: float, before: NoiseFit, tried: int) -> float:
    """Chance of such a gain anywhere in the search where nothing is missing."""
    if "lines" in effect.places:
        ordinates = sum(channel.channel.n / 2 for channel in before.channels)
        return float(min(1.0, tried * ordinates * np.exp(-gain / 2)))
    return min(1.0, tried * chance(gain, [tube(channel, effect) for channel in before.channels]))
