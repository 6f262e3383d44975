"""Whittle's likelihood of a noise model on the spectrum of one channel, and its maximum.

    log L = -1/2 sum nu (log S + I/S)        S = G theta: expected, I: measured with nu degrees of freedom

The coefficients theta of the known shapes G are not negative. A few multiplicative steps, each of which raises the
likelihood, come near the maximum from any start. Fisher scoring follows: a least-squares fit with the weights
nu / (2 S^2), repeated. A step that does not raise the likelihood is halved.

Source  Whittle, Ark. Mat. 2 (1953); Fevotte, Bertin and Durrieu, Neural Comput. 21 (2009): multiplicative steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numba import njit
from scipy.special import chdtri, digamma

from calibrations.effects import Effect
from calibrations.effects import Values as EffectValues
from calibrations.noise.lines import Lines, SpectralLine
from calibrations.noise.record import Channel
from calibrations.spectrum import Bands
from calibrations.table import Array

MULTIPLICATIVE_STEPS, SCORING_STEPS, SWEEPS = 20, 100, 200
CONVERGED = 1e-9  # log-likelihood that a step gains
NEARLY = 1e-3  # the same on a grid, of which the best point is refined


@njit(cache=True, nogil=True)
def log_likelihood(expected: Array, measured: Array, freedom: Array) -> float:
    """But for a constant."""
    return -0.5 * float(np.sum(freedom * (np.log(expected) + measured / expected)))


@njit(cache=True, nogil=True)
def maximise(G: Array, measured: Array, freedom: Array, base: Array) -> tuple[Array, float]:
    """(theta, log L) of S = base + G theta; G (b, p) with p of 1 or more, all others (b,)."""
    p = G.shape[1]
    theta = np.zeros(p)
    for j in range(p):
        theta[j] = np.exp(np.sum(freedom * np.log(measured / G[:, j])) / np.sum(freedom)) / p
    for _ in range(MULTIPLICATIVE_STEPS):
        share = freedom / (base + G @ theta)
        theta *= np.sqrt((G.T @ (share * share * measured / freedom)) / (G.T @ share))
    return maximise_from(theta, G, measured, freedom, base)


@njit(cache=True, nogil=True)
def maximise_from(
    theta: Array, G: Array, measured: Array, freedom: Array, base: Array, converged: float = CONVERGED
) -> tuple[Array, float]:
    """Maximise the likelihood from coefficients (p,) near the maximum, such as those for a similar shape."""
    value = log_likelihood(base + G @ theta, measured, freedom)
    for _ in range(SCORING_STEPS):
        step = _scoring_step(G, measured, freedom, base, theta) - theta
        length = 1.0
        while length > 1e-4:
            trial = theta + length * step
            S = base + G @ trial
            if S.min() > 0.0:
                next_value = log_likelihood(S, measured, freedom)
                if next_value >= value:
                    break
            length /= 2
        if length <= 1e-4:
            break
        gained = next_value - value
        theta, value = trial, next_value
        if gained < converged:
            break
    return theta, value


@njit(cache=True, nogil=True)
def profile(G: Array, shapes: Array, measured: Array, freedom: Array) -> tuple[Array, Array]:
    """Coefficients (g, p) and log L (g,) with the last column of G (b, p) replaced by each of `shapes` (g, b)."""
    base = np.zeros(len(measured))
    thetas, values = np.zeros((len(shapes), G.shape[1])), np.zeros(len(shapes))
    for k in range(len(shapes)):
        G[:, -1] = shapes[k]
        if k == 0:
            thetas[k], values[k] = maximise(G, measured, freedom, base)
        else:
            thetas[k], values[k] = maximise_from(thetas[k - 1].copy(), G, measured, freedom, base, NEARLY)
    return thetas, values


@njit(cache=True, nogil=True)
def _scoring_step(G: Array, measured: Array, freedom: Array, base: Array, theta: Array) -> Array:
    """One scoring step: weighted least squares without negative coefficients, coordinate by coordinate."""
    p = len(theta)
    S = base + G @ theta
    weighted = G / (S**2 / freedom).reshape(-1, 1)
    A, r = G.T @ weighted, weighted.T @ (measured - base)
    solution = theta.copy()
    for _ in range(SWEEPS):
        change = 0.0
        for j in range(p):
            best = max(0.0, solution[j] + (r[j] - np.dot(A[j], solution)) / A[j, j])
            change = max(change, abs(best - solution[j]) * np.sqrt(A[j, j]))
            solution[j] = best
        if change < 1e-8:
            break
    return solution


def information(columns: Array, expected: Array, freedom: Array) -> Array:
    """Fisher's information on the coefficients of columns (b, p) of the spectrum's derivative, shape (p, p)."""
    scaled = columns * np.sqrt(freedom / 2)[:, None] / expected[:, None]
    return scaled.T @ scaled


Values = dict[str, float]
LEAST_DENSITY = 1e-18  # of the greatest density: rounding


@dataclass(frozen=True)
class ChannelFit:
    """One channel and a model: the lines taken off, and the values of every effect. Arrays over all bands (b,)."""

    channel: Channel
    parts: tuple[Bands, ...]
    lines: Lines
    effects: tuple[Effect, ...]  # those with a spectrum
    values: Mapping[str, Values]
    line_bound: float = 0.0  # amplitude that one more line might have
    fits: dict[frozenset[str], ChannelFit] = field(default_factory=dict, repr=False)  # to this spectrum, by effects

    @cached_property
    def density(self) -> Array:
        """Measured density; no band is without power."""
        density = np.concatenate([part.density for part in self.parts])
        return np.asarray(np.maximum(density, LEAST_DENSITY * density.max()))

    @cached_property
    def freedom(self) -> Array:
        """Degrees of freedom of each band."""
        return np.concatenate([part.freedom for part in self.parts])

    @cached_property
    def frequency_hz(self) -> Array:
        """Frequency of each band."""
        return np.concatenate([part.frequency_hz for part in self.parts])

    def part_of(self, effect: Effect, values: Values | None = None) -> Array:
        """The expected density of one effect."""
        return effect_spectrum(effect, self.parts, self.values[effect.name] if values is None else values)

    @cached_property
    def expected(self) -> Array:
        """The model's density."""
        total = sum((self.part_of(effect) for effect in self.effects), np.zeros(len(self.density)))
        return np.asarray(np.maximum(total, LEAST_DENSITY * self.density.max()))

    def interval(self, coverage: float) -> tuple[Array, Array]:
        """(lowest, highest) density: between them the model expects this share of the measured densities."""
        low, high = (chdtri(self.freedom, (1 + side * coverage) / 2) for side in (1, -1))
        return self.expected * low / self.freedom, self.expected * high / self.freedom

    def level(self, frequency_hz: Array) -> Array:
        """The model's density of the means, read off between the bands."""
        band_hz, level = self.parts[0].frequency_hz, self.expected[: len(self.parts[0].density)]
        return np.asarray(np.exp(np.interp(np.log(frequency_hz), np.log(band_hz), np.log(level))))

    @cached_property
    def log_likelihood(self) -> float:
        """Log-likelihood, except for a constant that depends only on the bands."""
        return float(log_likelihood(self.expected, self.density, self.freedom))

    @cached_property
    def deviance(self) -> float:
        """Twice the gain in log-likelihood if each band had a free level."""
        ratio = self.density / self.expected
        return float(np.sum(self.freedom * (ratio - 1 - np.log(ratio))))

    @cached_property
    def by_chance(self) -> float:
        """The deviance that a complete model is expected to leave."""
        return float(np.sum(self.freedom * (np.log(self.freedom / 2) - digamma(self.freedom / 2))))

    @property
    def excess(self) -> float:
        """Rms mismatch over that which chance alone leaves: 1 for a complete model."""
        return float(np.sqrt(self.deviance / self.by_chance))

    @property
    def mismatch(self) -> float:
        """Rms difference of the spectrum from the model's, as a share of it, bands weighted by their information."""
        return float(np.sqrt(2 * self.deviance / np.sum(self.freedom)))

    @property
    def floor(self) -> float:
        """The mismatch that chance alone leaves."""
        return float(np.sqrt(2 * self.by_chance / np.sum(self.freedom)))


def effect_spectrum(effect: Effect, parts: Sequence[Bands], values: Values) -> Array:
    """Two-sided density that an effect makes in all bands."""
    p = EffectValues.of(values)
    spectra = [np.asarray(effect.spectrum(part, p), dtype=float) for part in parts]
    return spectra[0] if len(spectra) == 1 else np.concatenate(spectra)


def unit_spectrum(effect: Effect, parts: Sequence[Bands], shape: Values) -> Array:
    """Spectrum of an effect with a strength of 1."""
    return effect_spectrum(effect, parts, {effect.parameters[0].name: 1.0, **shape})


def effect_lines(effect: Effect, values: Values) -> tuple[SpectralLine, ...]:
    """The sinusoids of an effect, of phase 0."""
    return tuple(SpectralLine(f_hz, amplitude, 0.0) for f_hz, amplitude in effect.lines(EffectValues.of(values)))
