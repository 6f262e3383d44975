"""What a fitted noise model leaves that is no noise of its kind, in words: a line, a level that changes, a stretch."""

from __future__ import annotations

from calibrations.noise_analysis.lines import Line
from calibrations.search.candidates import SIGNIFICANT
from calibrations.still.bands import strongest
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.fit import NoiseFit
from calibrations.still.scan import stretches
from calibrations.still.stationary import levels

KINDS = 3  # of things that are looked for


def left(found: NoiseFit) -> str | None:
    """The first that is no chance over all channels; None where what is left is noise."""
    limit = SIGNIFICANT / (KINDS * len(found.channels))
    told = (_line(each) or _level(each, limit) or _stretch(each, limit) for each in found.channels)
    return next((text for text in told if text is not None), None)


def _line(found: ChannelFit) -> str | None:
    line = strongest(found.channel, found.lines, found.level)
    if not isinstance(line, Line):
        return None
    return f"a line of {found.channel.axis} at {line.frequency_hz:.6g} Hz, of amplitude {line.amplitude:.3g}"


def _level(found: ChannelFit, limit: float) -> str | None:
    level = levels(found)
    return level.text if level is not None and level.chance < limit else None


def _stretch(found: ChannelFit, limit: float) -> str | None:
    worst = stretches(found, most=1)[0]
    return worst.text if worst.chance < limit else None
