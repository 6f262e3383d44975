"""The Allan deviation that a noise model expects, and how far the measured one is from it.

    sigma^2(m) = int S(f) 2 sin^4(pi f m dt) / (m sin(pi f dt))^2 df        over all frequencies of the sampled process

This is exact at one sample too, where formulas of continuous time are wrong by up to a half. Behind a filter, times
below a few periods of its corner are not compared: there the noise of the converter dominates.

Source  NIST SP 1065, 3.2; Percival and Walden, Spectral Analysis for Physical Applications, 8.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr, chdtrc, digamma, polygamma

from calibrations.criteria import FILTER_PERIODS
from calibrations.noise.deviations import Curve
from calibrations.noise.likelihood import ChannelFit, effect_spectrum
from calibrations.noise.processes import Sampling
from calibrations.noise.spectrum import Bands
from calibrations.table import Array

# The Allan variance that a spectrum makes.
#
#     sigma^2(m) = int S(f) 2 sin^4(pi f m dt) / (m sin(pi f dt))^2 df        over all frequencies of the sampled
#     process
#
# It is exact at one sample as well, where formulas of continuous time are off by up to a half.
#
# Source  NIST SP 1065, 3.2; Percival and Walden, Spectral Analysis for Physical Applications, 8.6.

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
SLOWEST = 1e-7  # in cycles to an averaging time
WHOLE = 8.0  # cycles beyond which a fourth power of a sine is its mean
MEAN = 3 / 8


def steps_of(tau_s: Array, rate_hz: float) -> Array:
    """Averaging times in whole samples, shape of `tau_s`."""
    return np.asarray(np.maximum(1, np.round(tau_s * rate_hz)))


def quadrature(m: float, rate_hz: float, corner_hz: float) -> tuple[Bands, Array]:
    """Frequencies at which spectra are asked, and what to add them up with to a variance at `m` samples, (k,)."""
    cycles, width = _nodes(m / 2)
    f = cycles * rate_hz / m
    sine = np.sin(np.pi * f / rate_hz)
    power = np.where(cycles < WHOLE, np.sin(np.pi * cycles) ** 4, MEAN)
    none = np.zeros(len(f))
    at = Bands(f, none, none, Sampling(rate_hz), none, corner_hz)
    return at, 2 * width * rate_hz / m * 2 * power / (m * sine) ** 2


def line_variance(turns: float, m: Array) -> Array:
    """Variance at `m` samples of a sinusoid of unit amplitude, `turns` of it to a sample."""
    return np.asarray(np.sin(np.pi * turns * m) ** 4 / (m * np.sin(np.pi * turns)) ** 2)


def _nodes(end: float) -> tuple[Array, Array]:
    """Gauss's nodes and weights from 0 to `end` cycles, in panels: fine where the sine turns, else by decades."""
    fine = np.arange(0.25, min(end, WHOLE) + 0.25, 0.25)
    slow, fast = np.geomspace(SLOWEST, 0.25, 30), np.geomspace(WHOLE, max(end, WHOLE), 60)
    edges = np.unique(np.concatenate([[0.0], slow, fine, fast]))
    edges = np.append(edges[edges < end], end)
    half = np.diff(edges)[:, None] / 2
    return ((edges[:-1, None] + half) + half * NODES).ravel(), (half * WEIGHTS).ravel()


@dataclass(frozen=True)
class DeviationComparison:
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


def compare_deviations(found: ChannelFit, curve: Curve) -> DeviationComparison:
    """The measured curve beside the model's. A variance is distributed as chi-square over its degrees of freedom."""
    judged = curve.tau_s >= (FILTER_PERIODS / found.channel.corner_hz if np.isfinite(found.channel.corner_hz) else 0.0)
    tau_s, measured, edf = curve.tau_s[judged], curve.deviation[judged], curve.edf[judged]
    modelled = deviation(found, tau_s)
    scaled = edf * (measured / modelled) ** 2
    chance = np.minimum(1.0, 2 * np.minimum(chdtr(edf, scaled), chdtrc(edf, scaled)))
    return DeviationComparison(tau_s, measured, curve.low[judged], curve.high[judged], modelled, edf, chance)


def deviation(found: ChannelFit, tau_s: Array) -> Array:
    """Of all effects and lines, shape of `tau_s`."""
    total = sum(variance_parts(found, tau_s).values(), np.zeros(len(tau_s)))
    return np.asarray(np.sqrt(np.maximum(total, np.finfo(float).tiny)))


def variance_parts(found: ChannelFit, tau_s: Array) -> dict[str, Array]:
    """The variance that each effect makes at averaging times (k,), which are taken to whole samples."""
    rate_hz, steps = found.channel.rate_hz, steps_of(tau_s, found.channel.rate_hz)
    asked = [quadrature(m, rate_hz, found.channel.corner_hz) for m in steps]
    each = {
        effect.name: np.array([w @ effect_spectrum(effect, (at,), found.values[effect.name]) for at, w in asked])
        for effect in found.effects
    }
    for line in found.lines:
        each[f"{line.frequency_hz:.4g} Hz"] = line.amplitude**2 * line_variance(line.frequency_hz / rate_hz, steps)
    return each
