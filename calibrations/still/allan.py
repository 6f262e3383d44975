"""The Allan deviation that a noise model expects, and how far the measured one is from it.

It is computed from the spectra of the effects (`noise_analysis.expected`). Behind a filter it is only asked from a few
times of its time constant on: what the converter adds shows at shorter ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr, chdtrc, digamma, polygamma

from calibrations.noise_analysis.expected import of_line, steps_of, weighted
from calibrations.noise_analysis.octaves import Curve
from calibrations.still.channel_fit import ChannelFit, spectrum_of
from calibrations.table import Array

BEHIND = 4.0  # periods of a filter's corner from which on it is judged


@dataclass(frozen=True)
class Averaged:
    """Measured and expected deviations at the times that are judged (k,), with the chance of each ratio."""

    tau_s: Array
    measured: Array
    low: Array
    high: Array
    modelled: Array
    edf: Array
    chance: Array  # two-sided, of a variance ratio as far from 1

    @property
    def ratio(self) -> Array:
        """Measured over modelled deviation."""
        return self.measured / self.modelled

    @property
    def deviations(self) -> Array:
        """How many standard deviations the variance is off."""
        return np.asarray((self.ratio**2 - 1) * np.sqrt(self.edf / 2))

    @property
    def mismatch(self) -> float:
        """Rms of the logarithm of the ratio, each time weighted by its degrees of freedom."""
        return float(np.sqrt(np.average(np.log(self.ratio) ** 2, weights=self.edf)))

    @property
    def by_chance(self) -> float:
        """The mismatch that chance alone leaves: of half the logarithm of chi-square over its degrees of freedom."""
        half = self.edf / 2
        square = (polygamma(1, half) + (digamma(half) - np.log(half)) ** 2) / 4
        return float(np.sqrt(np.average(square, weights=self.edf)))


def averaged(found: ChannelFit, curve: Curve) -> Averaged:
    """The measured curve beside the model's. A variance is distributed as chi-square over its degrees of freedom."""
    judged = curve.tau_s >= (BEHIND / found.channel.corner_hz if np.isfinite(found.channel.corner_hz) else 0.0)
    tau_s, measured, edf = curve.tau_s[judged], curve.deviation[judged], curve.edf[judged]
    modelled = deviation(found, tau_s)
    scaled = edf * (measured / modelled) ** 2
    chance = np.minimum(1.0, 2 * np.minimum(chdtr(edf, scaled), chdtrc(edf, scaled)))
    return Averaged(tau_s, measured, curve.low[judged], curve.high[judged], modelled, edf, chance)


def deviation(found: ChannelFit, tau_s: Array) -> Array:
    """Of all effects and lines, shape of `tau_s`."""
    total = sum(parts(found, tau_s).values(), np.zeros(len(tau_s)))
    return np.asarray(np.sqrt(np.maximum(total, np.finfo(float).tiny)))


def parts(found: ChannelFit, tau_s: Array) -> dict[str, Array]:
    """The variance that each effect makes at averaging times (k,), which are taken to whole samples."""
    rate_hz, steps = found.channel.rate_hz, steps_of(tau_s, found.channel.rate_hz)
    asked = [weighted(m, rate_hz, found.channel.corner_hz) for m in steps]
    each = {
        effect.name: np.array([w @ spectrum_of(effect, (at,), found.values[effect.name]) for at, w in asked])
        for effect in found.effects
    }
    for line in found.lines:
        each[f"{line.frequency_hz:.4g} Hz"] = line.amplitude**2 * of_line(line.frequency_hz / rate_hz, steps)
    return each
