"""What a fitted noise model leaves that is no noise of its kind, in words: a line, a level that changes, a stretch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from calibrations.noise_analysis.lines import Line
from calibrations.search.candidates import SIGNIFICANT
from calibrations.still.bands import strongest
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.fit import NoiseFit
from calibrations.still.scan import stretches
from calibrations.still.stationary import levels

LINE, LEVEL, STRETCH = "line", "level", "spectrum"


@dataclass(frozen=True)
class Left:
    """Of what kind it is, and in words."""

    kind: str
    text: str


def left(found: NoiseFit) -> str | None:
    """In words; None where what is left is noise."""
    first = left_in(found.channels)
    return None if first is None else first.text


def left_in(channels: Sequence[ChannelFit]) -> Left | None:
    """The first that is no chance over all channels."""
    limit = SIGNIFICANT / (len((LINE, LEVEL, STRETCH)) * len(channels))
    told = (_line(each) or _level(each, limit) or _stretch(each, limit) for each in channels)
    return next((each for each in told if each is not None), None)


def _line(found: ChannelFit) -> Left | None:
    line = strongest(found.channel, found.lines, found.level)
    if not isinstance(line, Line):
        return None
    where = f"at {line.frequency_hz:.6g} Hz, of amplitude {line.amplitude:.3g}"
    return Left(LINE, f"a line of {found.channel.axis} {where}")


def _level(found: ChannelFit, limit: float) -> Left | None:
    level = levels(found)
    return Left(LEVEL, level.text) if level is not None and level.chance < limit else None


def _stretch(found: ChannelFit, limit: float) -> Left | None:
    worst = stretches(found, most=1)[0]
    return Left(STRETCH, worst.text) if worst.chance < limit else None
