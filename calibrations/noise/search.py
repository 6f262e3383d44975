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
from calibrations.discovery.results import Candidate
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
        each = {name: self.mixtures.lost_without(self.mixture, name) for name in self.mixture.names}
        if self.liner is not None:
            each[self.liner.name] = max(self._of_lines(), sum(map(_gain_of_lines, self.lines)))
        return {name: each[name] for name in self._in_order(each)}

    def _of_lines(self) -> float:
        """Twice the log-likelihood that the bands lose where lines stay in the record."""
        model = self.model
        for name in self.mixture.names:
            model = model.with_effect(self.effects[name])
        return 2 * (likelihood(self.mixture.channels) - fit(model, self.still).log_likelihood)

    def _in_order(self, each: Mapping[str, float]) -> Iterator[str]:
        """Lines gain the same in any order."""
        left, level = list(each), 0.0
        present: list[Effect] = []
        while left:
            rest = [effect for effect in self.mixture.effects if effect.name in left]
            tried = {effect.name: self.mixtures.of([*present, effect]).gain - level for effect in rest}
            best = max(left, key=lambda name: tried.get(name, each[name]))
            yield best
            left.remove(best)
            present += [effect for effect in rest if effect.name == best]
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
        rest = [e for e in self.mixture.effects if e is not effect]
        found = []
        for other in self.mixtures.others:
            if other in self.mixture.effects:
                continue
            swapped = self.mixtures.of([*rest, other])
            if effect.name in other.contains and _at_longest_shape(swapped, other):
                continue
            if self.mixture.gain - swapped.gain < INSEPARABLE and _is_identified(swapped, other):
                found.append(other.name)
        return found


def _gain_of_lines(lines: Lines) -> float:
    """Twice the log-likelihood that lines gain where they are, by their amplitudes."""
    return float(sum((line.amplitude / line.std) ** 2 for line in lines))


def _is_identified(mixture: Mixture, effect: Effect) -> bool:
    """Whether an effect of a mixture is identified in a channel, as in a table of parameters."""
    return any(gain_of(each, effect) > IDENTIFIED for each in mixture.channels)


def _at_longest_shape(mixture: Mixture, effect: Effect) -> bool:
    """Whether an effect's shape is the longest that a record shows: it then is the process that it contains."""
    shape = effect.parameters[1].name
    return all(
        each.values[effect.name][shape] > AT_LONGEST_TIME * shape_grid(effect, shape, each.channel)[-1]
        for each in mixture.channels
    )


def search(still: Still, model: Model, effects: Mapping[str, Effect]) -> Search:
    """Raises ModelError for a model without noise."""
    given = tuple(term.effect for term in noise_terms(model))
    known = {name: effect for name, effect in effects.items() if effect.is_noise}
    known |= {effect.name: effect for effect in given}
    found = _search_once(still, model, known, given)
    if found.mixture.effects:
        found = replace(found, telegraphs=tuple(filter(None, map(telegraph_of, found.mixture.channels))))
    first = found
    while len(found.patterns) < MOST_PATTERNS * len(still.channels):
        more = _remove_next_pattern(still, found, given)
        if more is found:
            break
        found = more
    return replace(_with_common_amounts(still, found, given), uncleaned=first) if found.patterns else found


def _with_common_amounts(whole: Still, found: Search, given: tuple[Effect, ...]) -> Search:
    """With the amounts of all patterns fitted at once, beside the processes that are left."""
    beside = found.mixture.channels
    patterns = _with_amounts(whole, found.patterns, beside)
    patterns = _with_amounts(whole, tuple(each for each in patterns if not each.needless), beside)
    cleaned = with_cleaned_curves(without_patterns(whole, patterns), {each.axis for each in patterns})
    left = _search_once(cleaned, found.model, found.effects, given)
    return replace(left, patterns=patterns, telegraphs=found.telegraphs)


def _with_amounts(whole: Still, patterns: tuple[Pattern, ...], beside: tuple[ChannelFit, ...]) -> tuple[Pattern, ...]:
    """The patterns with their amounts fitted together, channel by channel, to the record that holds them all."""
    fitted: list[Pattern] = []
    for channel, present in zip(whole.channels, beside, strict=True):
        own = tuple(pattern for pattern in patterns if pattern.axis == channel.axis)
        fitted += refitted(own, present, channel) if own else ()
    return tuple(fitted)


def _remove_next_pattern(whole: Still, found: Search, given: tuple[Effect, ...]) -> Search:
    """The search without the patterns that stand out, if that explains the record better; otherwise `found`.

    A form that is searched for in the record itself must also make a process unnecessary, or be no chance beside the
    best mixture: noise that jumps has steps and slopes of its own. A logged column is independent of the noise.
    """
    sure, likely = (_patterns(found, channels) for channels in (found.mixture.channels, found.mixtures.base))
    tried = [_search_without(whole, found, each, given) for each in (sure, likely) if each]
    best = max(tried, key=_worth, default=found)
    logged = any(pattern.kind == FOLLOWS for pattern in best.patterns[len(found.patterns) :])
    least = _worth(found) + (0.0 if logged else INSEPARABLE)
    if _worth(best) <= least or likelihood(best.mixtures.base) < likelihood(found.mixtures.base):
        return found  # without it the model explains less: it was noise
    fewer = len(best.gains) < len(found.gains)
    return best if fewer or logged or any(pattern.certain for pattern in sure) else found


def _search_without(whole: Still, found: Search, patterns: tuple[Pattern, ...], given: tuple[Effect, ...]) -> Search:
    """The search without further patterns. A curvature changes the slope beside it, so that amounts are fitted anew."""
    together = found.patterns + patterns
    together = _with_amounts(whole, together, found.mixture.channels) if found.patterns else together
    rest = _search_once(without_patterns(whole, together), found.model, found.effects, given)
    return replace(rest, patterns=together, telegraphs=found.telegraphs)


def _patterns(found: Search, channels: tuple[ChannelFit, ...]) -> tuple[Pattern, ...]:
    """The pattern of each channel that has one. A channel that jumps between two levels has steps anyway."""
    jumping = {telegraph.axis for telegraph in found.telegraphs}
    free = (each for each in channels if each.channel.axis not in jumping)
    return tuple(filter(None, (pattern_of(each, found.patterns) for each in free)))


def without_patterns(still: Still, patterns: tuple[Pattern, ...]) -> Still:
    """The record less the patterns; its Allan deviations are still those with them."""
    channels = still.channels
    for pattern in patterns:
        channels = tuple(pattern.taken_off(channel) for channel in channels)
    return replace(still, channels=channels)


def _worth(found: Search) -> float:
    """Twice the log-likelihood of the best mixture, less the prices of its effects and of the patterns."""
    price = sum(found.mixtures.prices[name] for name in found.mixture.names)
    price += sum(pattern.price for pattern in found.patterns)
    return 2 * sum(each.log_likelihood for each in found.mixture.channels) - price


def _search_once(still: Still, model: Model, known: Mapping[str, Effect], given: tuple[Effect, ...]) -> Search:
    smooth = tuple(effect for effect in given if "spectrum" in effect.places)
    others = tuple(e for e in known.values() if "spectrum" in e.places and e not in smooth)
    plain = tuple(effect for effect in (*smooth, *others) if len(effect.parameters) == 1)
    most = most_lines(known.values())
    shown = tuple(find_lines(c, plain, most) if most else without_effects(c) for c in still.channels)
    return Search(still, model, known, tuple(each.lines for each in shown), (), Mixtures(shown, smooth, others))


def candidates(found: Search, before: NoiseFit, doubts: Mapping[str, tuple[str, ...]]) -> tuple[Candidate, ...]:
    """Every effect that the model does not hold, each alone on top of it; those that are missed come first."""
    others = [effect for name, effect in found.effects.items() if name not in before.model.effects]
    after = {effect.name: fit(before.model.with_effect(effect), found.still) for effect in others}
    gains = {name: 2 * (each.log_likelihood - before.log_likelihood) for name, each in after.items()}
    if found.liner is not None:
        gains[found.liner.name] = max(gains[found.liner.name], found.gains[found.liner.name])
    bands = sum(len(each.seen) for each in before.channels)
    worth = np.array([_schwarz(effect, gains[effect.name], before, bands) for effect in others])
    odds = np.exp(np.minimum(np.append(worth, 0.0) - max([*worth, 0.0]), 0.0) / 2)
    probability = odds / odds.sum()
    made = [
        Candidate(
            effect=effect,
            gain=gains[effect.name],
            p_value=_p_value(effect, gains[effect.name], before, len(others)),
            probability=float(probability[k]),
            excess_after=after[effect.name].pooled_excess,
            held_out_after=after[effect.name].held_out_excess,
            indistinguishable_from=doubts.get(effect.name, ()),
        )
        for k, effect in enumerate(others)
    ]
    order = {name: k for k, name in enumerate(found.gains)}
    made.sort(key=lambda c: (order.get(c.name, len(order)), -_schwarz(c.effect, c.gain, before, bands)))
    return tuple(made)


def _schwarz(effect: Effect, gain: float, before: NoiseFit, bands: int) -> float:
    """Gain less the price of the parameters, log(bands) each; of lines, those that it takes for one."""
    count = 2 if "lines" in effect.places else len(effect.parameters)
    return gain - len(before.channels) * count * float(np.log(bands))


def _p_value(effect: Effect, gain: float, before: NoiseFit, tried: int) -> float:
    """Chance of such a gain anywhere in the search where nothing is missing."""
    if "lines" in effect.places:
        ordinates = sum(each.channel.n / 2 for each in before.channels)
        return float(min(1.0, tried * ordinates * np.exp(-gain / 2)))
    return min(1.0, tried * chance(gain, [tube(each, effect) for each in before.channels]))
