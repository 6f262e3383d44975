"""How likely noise alone makes an effect look present, over all channels and all shapes that it may take.

A power is not negative: where an effect is absent, twice its gain in log-likelihood is 0 or, half of the time,
chi-square. One whose shape is searched for is the largest of many such gains, which follow each other along a curve on
the unit sphere: of length L, it adds L / (2 pi) exp(-gain / 2), a chi-square of two degrees. Gains of channels add up.

Source  Self and Liang, J. Am. Statist. Assoc. 82 (1987): likelihood ratios at a bound; Hotelling, Am. J. Math. 61
        (1939), and Davies, Biometrika 74 (1987): tubes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc

from calibrations.effect import Effect
from calibrations.still.channel_fit import ChannelFit, spectrum_of
from calibrations.still.fit import tried
from calibrations.table import Array

FINE = 4  # steps along the curve to one that is tried
MOST_GAIN = 1e3


def chance(gain: float, tubes: Sequence[float]) -> float:
    """Of such a gain, summed over channels, where nothing is there; `tubes` has L / (2 pi) of each channel."""
    weights = np.ones(1)  # of chi-square with 0, 1, 2 ... degrees of freedom
    for tube in tubes:
        weights = np.convolve(weights, [0.5, 0.5, tube])
    if gain <= 0:
        return 1.0
    return float(min(1.0, sum(w * chdtrc(k, gain) for k, w in enumerate(weights) if k)))


def least_gain(of_chance: float, tubes: Sequence[float]) -> float:
    """The gain that noise alone makes with this chance."""
    return float(brentq(lambda gain: chance(gain, tubes) - of_chance, 1e-3, MOST_GAIN))


def tube(beside: ChannelFit, effect: Effect) -> float:
    """L / (2 pi) of an effect's shapes beside the effects of a fit; 0 for one that has no shape to be searched for."""
    if len(effect.parameters) < 2:
        return 0.0
    strength, shape = (p.name for p in effect.parameters[:2])
    ends = tried(effect, shape, beside.channel)
    shapes = np.geomspace(ends[0], ends[-1], FINE * len(ends)).tolist()
    columns = np.column_stack([spectrum_of(effect, beside.parts, {strength: 1.0, shape: value}) for value in shapes])
    unit = _beside(columns, beside)
    steps = np.clip(np.sum(unit[:, 1:] * unit[:, :-1], axis=0), -1.0, 1.0)
    return float(np.sum(np.arccos(steps)) / (2 * np.pi))


def _beside(columns: Array, fit: ChannelFit) -> Array:
    """Columns (b, k) of spectra as unit vectors of what they tell beside the fit's own effects."""
    weight = (np.sqrt(fit.freedom / 2) / fit.expected)[:, None]
    own = np.column_stack(
        [spectrum_of(e, fit.parts, {**fit.values[e.name], e.parameters[0].name: 1.0}) for e in fit.effects]
    )
    basis, _ = np.linalg.qr(own * weight / np.linalg.norm(own * weight, axis=0))
    free = columns * weight
    free = free - basis @ (basis.T @ free)
    return np.asarray(free / np.linalg.norm(free, axis=0))
