"""What in a noise analysis is no noise, and which coefficients it spoils: the checks of the loop, on one channel.

Samples that are odd, a pattern (a step, a drift, a settling, what follows a logged column), and what the processes
leave. Patterns are taken off, and the processes are told once more from what is left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from calibrations.effect import catalogue
from calibrations.model_file import read_model
from calibrations.noise_analysis.analysis import Coefficient, NoiseAnalysis, analysed
from calibrations.noise_analysis.oddities import COARSE, CONSTANT, WILD
from calibrations.noise_analysis.processes import GAUSS_MARKOV
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.fit import seen, with_effects
from calibrations.still.left import left_in
from calibrations.still.patterns import Pattern, pattern_of
from calibrations.still.record import Channel, Still, columns_beside
from calibrations.still.search import search
from calibrations.still.telegraph import TWO_LEVELS, telegraph_of
from calibrations.table import Array

MODEL = "still"
FAR = 2.0  # standard deviations by which a coefficient changes, to be called spoilt
EXPLAINS = (CONSTANT, COARSE)  # whatever the spectrum shows beside
SPOILT = {WILD: ("white-noise", "quantisation-noise")}  # all others spoil whatever was identified


@dataclass(frozen=True)
class Disturbance:
    """Something that is no noise, the coefficients that it spoils, and whether it moves them beyond their doubt."""

    kind: str
    text: str
    spoils: tuple[str, ...]
    matters: bool = True


@dataclass(frozen=True)
class Disturbed:
    """All that is no noise, and the analysis without what could be taken off; None where nothing was."""

    disturbances: tuple[Disturbance, ...]
    rest: NoiseAnalysis | None


def disturbed(found: NoiseAnalysis, axis: str, logged: Mapping[str, Sequence[Array]]) -> Disturbed:
    """Of an analysis of the channel called `axis`; `logged`: blocks of what was read beside it."""
    of = found.record
    channel = Channel(
        axis, of.unit, of.rate_hz, of.corner_hz, of.n, of.means, of.size, of.segments, columns_beside(logged, of.n),
        of.oddities,
    )  # fmt: skip
    two = telegraph_of(_fit(found, channel)) if len(found.found.power) > 1 else None
    patterns, rest = ((), None) if two else _patterns(found, channel)
    named = _identified(found.coefficients)
    told = [
        Disturbance(each.kind, f"of {axis}, {each.text}", _of(named, SPOILT.get(each.kind, named)), each.matters)
        for each in of.oddities
    ]
    told += [Disturbance(each.kind, each.text, _spoilt(found, rest)) for each in patterns]
    told += [Disturbance(TWO_LEVELS, two.text, (), False)] if two else []
    more = left_in([_fit(rest or found, channel)])
    if more is not None and not any(each.kind in EXPLAINS for each in of.oddities):
        told.append(Disturbance(more.kind, more.text, named))
    return Disturbed(tuple(told), rest if patterns else None)


def _patterns(found: NoiseAnalysis, channel: Channel) -> tuple[tuple[Pattern, ...], NoiseAnalysis | None]:
    """Those that the loop would take off, which is asked only where one stands out at all."""
    white = with_effects(seen(channel, found.lines), [catalogue()["white-noise"]])
    if not (pattern_of(_fit(found, channel)) or pattern_of(white)):
        return (), None
    still = Still(channel.axis, channel.unit, (channel,), {channel.axis: found.allan}, "")
    taken = search(still, read_model(MODEL), catalogue())
    means = taken.still.channels[0].means
    return taken.patterns, analysed(replace(found.record, means=means - means.mean()), found.curves)


def _fit(found: NoiseAnalysis, channel: Channel) -> ChannelFit:
    """The analysis as the loop would have fitted it."""
    effects = tuple(catalogue()[name] for name in found.found.power)
    values = {}
    for effect in effects:
        strength, *shape = (p.name for p in effect.parameters)
        values[effect.name] = {strength: found.found.power[effect.name] ** 0.5}
        if effect.name == GAUSS_MARKOV:
            values[effect.name][shape[0]] = found.found.time_constant_s
    return ChannelFit(replace(channel, means=found.record.means), found.spectrum.parts, found.lines, effects, values)


def _identified(coefficients: Mapping[str, Coefficient]) -> tuple[str, ...]:
    return tuple(name for name, each in coefficients.items() if each.identified)


def _of(named: tuple[str, ...], kinds: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name in named if name in kinds)


def _spoilt(found: NoiseAnalysis, rest: NoiseAnalysis | None) -> tuple[str, ...]:
    """What is not identified without the patterns, or is something else."""
    if rest is None:
        return ()
    before, after = found.coefficients, rest.coefficients
    return tuple(
        name
        for name in before
        if before[name].identified != after[name].identified
        or (before[name].identified and abs(after[name].value - before[name].value) > FAR * before[name].std)
    )
