"""Where a spectrum differs from a model's: the stretches of frequency whose power is no chance.

Bands are independent chi-square variables, so a stretch of them is one as well. Stretches of all lengths are looked at,
and their number is allowed for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr, chdtrc

from calibrations.still.channel_fit import ChannelFit

LENGTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)  # bands to a stretch
PEAK = 0.371  # cycles to an averaging time at which an Allan variance listens most
ALIKE = 0.02  # of the density: nearer, a model is as good as right


@dataclass(frozen=True)
class Stretch:
    """From `low_hz` to `high_hz` the density is `ratio` times that of the model, by a chance that allows for all."""

    axis: str
    low_hz: float
    high_hz: float
    ratio: float
    deviations: float
    chance: float

    @property
    def tau_s(self) -> tuple[float, float]:
        """The averaging times that it shows at."""
        return PEAK / self.high_hz, PEAK / self.low_hz

    @property
    def text(self) -> str:
        """In words."""
        low, high = self.tau_s
        many = f"{self.ratio:.3g} x" if self.ratio > 1 else f"only {self.ratio:.2g} x"
        where = f"{self.low_hz:.3g} to {self.high_hz:.3g} Hz" if self.high_hz > self.low_hz else f"{self.low_hz:.4g} Hz"
        return (
            f"{self.axis} has {many} the power of the model at {where} (averaging times of {low:.2g} to {high:.2g} s)"
        )


def stretches(found: ChannelFit, most: int = 3) -> list[Stretch]:
    """Those that differ most certainly, none of which overlap, surest first; with chances of 1 where none does."""
    order = np.argsort(found.frequency_hz)
    f, nu = found.frequency_hz[order], found.freedom[order]
    power = nu * (found.seen / found.expected)[order]
    sums = [np.concatenate([[0.0], np.cumsum(x)]) for x in (nu, power)]
    tried = []
    for length in (each for each in LENGTHS if each <= len(f)):
        freedom, got = (x[length:] - x[:-length] for x in sums)
        chance = 2 * np.minimum(chdtr(freedom, got), chdtrc(freedom, got))
        chance = np.where(np.abs(got / freedom - 1) < ALIKE, 1.0, chance)
        tried += [
            (float(p), k, k + length, float(g / n))
            for k, (p, g, n) in enumerate(zip(chance, got, freedom, strict=True))
        ]
    tried.sort(key=lambda each: (each[0], -abs(np.log(each[3])) * (sums[0][each[2]] - sums[0][each[1]])))
    chosen: list[tuple[float, int, int, float]] = []
    for each in tried:
        if len(chosen) == most:
            break
        if all(each[2] <= other[1] or each[1] >= other[2] for other in chosen):
            chosen.append(each)
    return [
        Stretch(
            found.channel.axis, float(f[a]), float(f[b - 1]), ratio,
            float((ratio - 1) * np.sqrt((sums[0][b] - sums[0][a]) / 2)), min(1.0, p * len(tried)),
        )
        for p, a, b, ratio in chosen
    ]  # fmt: skip
