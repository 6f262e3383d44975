"""Whether the level of a record's noise is the same all along.

The record is cut into parts. The faster ordinates of each tell its level, whatever its trend; they are compared by
their likelihood ratio.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import dct
from scipy.special import chdtrc

from calibrations.still.bands import means_without
from calibrations.still.channel_fit import ChannelFit
from calibrations.table import Array

PARTS = 8
UNLIKE = 1.1  # ratio of levels that matters
SLOW = 0.25  # of a part's ordinates, that tell of its trend
FEWEST = 8  # ordinates of a part that tell of its level


@dataclass(frozen=True)
class Levels:
    """The level of one channel's noise in equal parts of its record, as multiples of their mean, and the chance that
    they differ so."""

    axis: str
    levels: Array
    part_s: float
    chance: float

    @property
    def ratio(self) -> float:
        """Of the highest to the lowest."""
        return float(self.levels.max() / self.levels.min())

    @property
    def text(self) -> str:
        """In words."""
        start_s = int(np.argmax(self.levels)) * self.part_s
        return (
            f"the level of {self.axis} changes with time, by a factor of {self.ratio:.3g}: it is highest from "
            f"{start_s:.4g} to {start_s + self.part_s:.4g} s"
        )


def levels(found: ChannelFit) -> Levels | None:
    """Of one channel; None where its record is too short to tell."""
    channel = found.channel
    means, step_s = means_without(channel, found.lines), channel.sampling.interval_s
    length = len(means) // PARTS
    f = np.arange(1, length) / (2 * max(length, 1) * step_s)
    highest_hz = min(channel.highest_hz, 0.5 / step_s)
    told = (f > SLOW * highest_hz) & (f < highest_hz)
    if np.count_nonzero(told) < FEWEST:
        return None
    parts = means[: PARTS * length].reshape(PARTS, length)
    power = dct(parts, type=2, norm="ortho", axis=1)[:, 1:][:, told] ** 2 * step_s
    each = (power / found.level(f[told])).mean(axis=1)
    ratio = each / each.mean()
    gain = float(np.count_nonzero(told) * np.sum(ratio - 1 - np.log(ratio)))
    return Levels(channel.axis, np.sqrt(ratio), length * step_s, float(chdtrc(PARTS - 1, gain)))
