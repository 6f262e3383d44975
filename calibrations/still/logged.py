"""A column that was logged beside a sensor: as it was read, and without its reader's own scatter.

No sensor feels that scatter, and it makes an output seem to follow the column less: the slope is attenuated. What it
feels is put in place of what was read, as well as the column itself tells it: a level that wanders by itself, read with
white scatter, whose best estimate (Wiener's) is diagonal in the cosine transform. The slope on that is not attenuated.
Where the sensor feels the scatter too, it follows what was read more closely, and the likelihood says so.

Source  Carroll et al., Measurement Error in Nonlinear Models, chapter 4: regression calibration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import dct, idct
from scipy.optimize import minimize_scalar

from calibrations.noise_analysis.decimated import Means
from calibrations.table import Array

LOG_RATIOS = (-12.0, 16.0)  # of the variances of scatter and of a level's steps, that are looked through
FEWEST = 16  # ordinates from which a scatter can be told at all
SLOPES = (0.5, 1.0, 1.5, 2.0)  # of a level's spectrum in powers of the frequency: 1 flickers, 2 walks


@dataclass(frozen=True, eq=False)
class Logged:
    """Means (m,) of a column, over as many samples as the channel's, less their mean. `level`: without scatter."""

    read: Array
    level: Array

    def part(self, which: slice) -> Logged:
        """Some of the record, which is a record of its own."""
        return Logged(*(values[which] - values[which].mean() for values in (self.read, self.level)))


def logged(blocks: Sequence[Array], n: int) -> Logged | None:
    """Of what was read beside n samples, in blocks; None where it is constant or of another length."""
    means, readings, last = Means(), 0, np.nan
    for block in blocks:
        means.add(block)
        readings += int(np.count_nonzero(np.diff(block, prepend=last)))
        last = block[-1] if len(block) else last
    read = means.values()
    if sum(map(len, blocks)) != n or np.ptp(read) == 0:
        return None
    return Logged(read, without_scatter(read, readings))


def without_scatter(read: Array, readings: int) -> Array:
    """The level beneath the scatter of a column's means (m,), of which each of so many `readings` holds until the next.

    What is faster than the readings is left out: it tells nothing of their scatter.
    """
    m = len(read)
    k = np.arange(1, min(m, readings))
    if len(k) < FEWEST:
        return read
    seen = dct(read, type=2, norm="ortho")[k]
    held, turn = max(1.0, m / readings), np.pi * k / (2 * m)
    frequency = 2 * np.sin(turn)
    power = (seen * held * np.sin(turn) / np.sin(held * turn)) ** 2  # as if none had been held
    _, share = min((_fitted(power, frequency**-slope) for slope in SLOPES), key=lambda each: each[0])
    kept = np.zeros(m)
    kept[k] = seen * share
    return np.asarray(idct(kept, type=2, norm="ortho"))


def _fitted(power: Array, level: Array) -> tuple[float, Array]:
    """How unlikely a level of this spectrum is with the scatter that suits it, and its share of each ordinate; (k,)."""
    found = minimize_scalar(_unlikely, bounds=LOG_RATIOS, args=(power, level), method="bounded")
    return float(found.fun), np.asarray(level / (level + np.exp(found.x)))


def _unlikely(log_ratio: float, power: Array, level: Array) -> float:
    """Twice the negative log-likelihood of a level with scatter, at its best scale."""
    both = level + np.exp(log_ratio)
    return float(len(power) * np.log(np.mean(power / both)) + np.sum(np.log(both)))
