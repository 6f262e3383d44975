"""Disturbances: everything in a still record that is not a noise process.

pattern          a step, a drift, a settling, an output that follows a logged column; removed before the fit
odd samples      wild samples, a stretch of equal samples, noise below one converter step; reported
two levels       random telegraph noise, which has the spectrum of a Gauss-Markov process; reported
misfit           a line, a noise level that changes with time, a stretch of the spectrum that no process explains
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from calibrations.criteria import SIGNIFICANT
from calibrations.noise.channel_spectrum import Line, strongest_line
from calibrations.noise.likelihood import ChannelFit
from calibrations.noise.patterns import Pattern
from calibrations.noise.places import noise_levels, stretches
from calibrations.noise.search import Search
from calibrations.noise.telegraph import TWO_LEVELS

LINE, LEVEL, STRETCH = "line", "level", "spectrum"
MISFITS = (LINE, LEVEL, STRETCH)


@dataclass(frozen=True)
class Disturbance:
    """One disturbance of one channel.

    kind     such as `step`, `follows`, `wild-samples`, `level`
    matters  whether it changes the noise coefficients by more than their uncertainty
    pattern  what was removed from the record, if it was
    """

    kind: str
    axis: str
    text: str
    matters: bool = True
    pattern: Pattern | None = None


def disturbances(search: Search) -> tuple[Disturbance, ...]:
    """All disturbances: removed patterns, two levels, odd samples; a misfit only where none of these matters."""
    patterns = [Disturbance(each.kind, each.axis, each.text, True, each) for each in search.patterns]
    two_levels = [Disturbance(TWO_LEVELS, each.axis, each.text, False) for each in search.telegraphs]
    odd = [
        Disturbance(each.kind, channel.axis, f"of {channel.axis}, {each.text}", each.matters)
        for channel in search.still.channels
        for each in channel.oddities
    ]
    known = (*patterns, *two_levels, *odd)
    if any(each.matters for each in known):
        return known
    misfit = misfit_of(search.end.channels)
    return known if misfit is None else (*known, misfit)


def misfit_of(channels: tuple[ChannelFit, ...]) -> Disturbance | None:
    """The first misfit that chance does not explain, over all channels."""
    limit = SIGNIFICANT / (len(MISFITS) * len(channels))
    each = (_line(fit) or _level(fit, limit) or _stretch(fit, limit) for fit in channels)
    return next((misfit for misfit in each if misfit is not None), None)


def disturbance_document(disturbance: Disturbance) -> dict[str, Any]:
    """One entry of `disturbances` in every JSON document on a still record."""
    entry = {name: getattr(disturbance, name) for name in ("kind", "axis", "text", "matters")}
    pattern = disturbance.pattern
    if pattern is None:
        return entry
    return entry | {
        "text": pattern.plain,
        "column": pattern.cause or None,
        "value": pattern.size,
        "std": pattern.std,
        "cannot_be_told_from": [rival.plain for rival in pattern.rivals],
    }


def _line(fit: ChannelFit) -> Disturbance | None:
    line = strongest_line(fit.channel, fit.lines, fit.level)
    if not isinstance(line, Line):
        return None
    axis = fit.channel.axis
    return Disturbance(LINE, axis, f"a line of {axis} at {line.frequency_hz:.6g} Hz, of amplitude {line.amplitude:.3g}")


def _level(fit: ChannelFit, limit: float) -> Disturbance | None:
    level = noise_levels(fit)
    return Disturbance(LEVEL, level.axis, level.text) if level is not None and level.chance < limit else None


def _stretch(fit: ChannelFit, limit: float) -> Disturbance | None:
    worst = stretches(fit, most=1)[0]
    return Disturbance(STRETCH, worst.axis, worst.text) if worst.chance < limit else None
