"""The level of a logged column without the scatter of its reader.

A sensor does not feel the scatter of a thermometer, and a regression on the readings underestimates the slope
(attenuation). The true level is modelled as a power-law process, read with white scatter; its best estimate (Wiener
filter) is diagonal in the cosine transform, and a regression on it is not attenuated.

Source  Carroll et al., Measurement Error in Nonlinear Models, chapter 4: regression calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.fft import dct, idct
from scipy.optimize import minimize_scalar

from calibrations.criteria import FEWEST_ORDINATES
from calibrations.table import Array

LOG_RATIOS = (-12.0, 16.0)  # of the variances of scatter and of a level's steps, that are looked through
SLOPES = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)  # of a level's spectrum in powers of the frequency: 2 walks, 4 walks and lags
NODES = ((-(3**0.5), 1 / 6), (0.0, 2 / 3), (3**0.5, 1 / 6))  # of a normal distribution, and weights (Gauss, Hermite)
CURVATURE_STEP = 0.1  # of the logarithm of a ratio: a step in which the likelihood is a parabola
FLAT = 2.0  # least curvature: a ratio is known to a factor of e, or its likelihood is no parabola


class LevelEstimate(NamedTuple):
    """A level (m,), the relative doubt of a slope on it, and the rms errors of it and of its change from row to row."""

    values: Array
    doubt: float
    error: float
    change_error: float


def without_scatter(means: Array, readings: int) -> LevelEstimate:
    """The level below the scatter of a column's means (m,), in which each of `readings` readings holds until the next.

    Frequencies above those of the readings do not show their scatter, and are left out.
    """
    m = len(means)
    k = np.arange(1, min(m, readings))
    if len(k) < FEWEST_ORDINATES:
        return LevelEstimate(means, 0.0, 0.0, 0.0)
    coefficients = dct(means, type=2, norm="ortho")[k]
    repeats, turn = max(1.0, m / readings), np.pi * k / (2 * m)
    power = (coefficients * repeats * np.sin(turn) / np.sin(repeats * turn)) ** 2  # as if none had been held
    share, doubt = _level_share(power, 2 * np.sin(turn), coefficients**2)
    smoothed = np.zeros(m)
    smoothed[k] = coefficients * share
    least = np.finfo(float).tiny
    scatter_variance = np.sum((coefficients * (1 - share)) ** 2) / max(float(np.sum(1 - share)), least)  # per ordinate
    errors = scatter_variance * share / m
    return LevelEstimate(
        values=np.asarray(idct(smoothed, type=2, norm="ortho")),
        doubt=doubt,
        error=float(np.sqrt(np.sum(errors))),
        change_error=float(np.sqrt(np.sum(errors * (np.pi * k / m) ** 2))),
    )


def _level_share(power: Array, frequency: Array, weight: Array) -> tuple[Array, float]:
    """The level's share of each ordinate (k,), the mean over spectra by how likely they are.

    Also by how much the slope of what follows the level would be off where another spectrum is true, relative and rms.
    """
    spectra = [_Spectrum.of(power, frequency**-slope) for slope in SLOPES]
    likeliest = min(spectrum.unlikely for spectrum in spectra)
    odds = [spectrum.std * float(np.exp((likeliest - spectrum.unlikely) / 2)) for spectrum in spectra]  # by Laplace
    chances = np.outer(odds, [chance for _, chance in NODES]).ravel()
    shares = np.array([spectrum.share(stds) for spectrum in spectra for stds, _ in NODES])
    share = np.average(shares, axis=0, weights=chances)
    off = shares @ (share * weight) / (share**2 @ weight) - 1
    return np.asarray(share), float(np.sqrt(np.average(off**2, weights=chances)))


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """The spectrum of a level (k,) and of scatter, at their likeliest ratio."""

    level: Array
    log_ratio: float  # of the variance of the scatter to that of the level's steps
    std: float  # of the logarithm
    unlikely: float  # twice the negative log-likelihood

    @classmethod
    def of(cls, power: Array, level: Array) -> _Spectrum:
        """The spectrum that fits the observed power (k,). Without scatter the likelihood is flat, so `std` is large."""
        optimum = minimize_scalar(_deviance_of_ratio, bounds=LOG_RATIOS, args=(power, level), method="bounded")
        neighbours = sum(
            _deviance_of_ratio(optimum.x + step, power, level) for step in (-CURVATURE_STEP, CURVATURE_STEP)
        )
        curvature = (neighbours - 2 * optimum.fun) / CURVATURE_STEP**2
        return cls(level, float(optimum.x), float(np.sqrt(2 / max(curvature, FLAT))), float(optimum.fun))

    def share(self, stds: float) -> Array:
        """The level's share of each ordinate (k,), with the ratio increased by this number of standard deviations."""
        return np.asarray(self.level / (self.level + np.exp(self.log_ratio + stds * self.std)))


def _deviance_of_ratio(log_ratio: float, power: Array, level: Array) -> float:
    """Twice the negative log-likelihood of a level with scatter, at its best scale."""
    expected = level + np.exp(log_ratio)
    return float(len(power) * np.log(np.mean(power / expected)) + np.sum(np.log(expected)))
