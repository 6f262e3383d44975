"""The budget's uncertainties once more, by the propagation of distributions: GUM Supplement 1.

In each trial the means get noise of the kind that the fit found (white, scatter, slow, made larger by the Birge ratio),
and errors of the inputs that are not fitted, normal with their standard uncertainties, each shared by its rows. The
parameters are then estimated anew, by the fit's own weights and the whole nonlinear model. So it sees what first-order
propagation does not: that the model bends over its uncertainty, and the shape of what comes out. Inputs enter the
residual by first order.

The budget is confirmed where both ends of its interval come within half a unit of the first digit of the standard
uncertainty of the simulated ones. It is conservative where it reaches further, as it may: it also counts how badly slow
noise is known. Where the simulated interval reaches further, the budget's is widened to it.

Source  JCGM 101:2008, 7 (trials), 7.7 (interval), 8.1 (comparison, one significant digit).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibrations.budget import gains
from calibrations.fit import Fit, cautiously
from calibrations.inputs import Contribution
from calibrations.noise import Noise
from calibrations.numerals import exponent
from calibrations.table import Array

TRIALS = 2000
STEPS = 2  # of the estimate: the model is nearly straight over its uncertainty
SEED = 101
LEVEL = 0.95
CONFIRMED, CONSERVATIVE, WIDENED = "confirmed", "conservative", "widened"


def simulate(found: Fit, inputs: Sequence[Contribution], trials: int = TRIALS, seed: int = SEED) -> Array:
    """Parameters of each trial, shape (trials, p). The same fit gives the same trials."""
    rng = np.random.default_rng(seed)
    cautious = cautiously(found)
    G = gains(cautious)
    disturbed = cautious.birge * _noise(cautious.noise, trials, rng)
    for c in inputs:
        if c.std:
            number = c.shared(found.table)
            errors = c.std * rng.standard_normal((trials, int(number.max()) + 1))
            disturbed += c.derivative(found.problem, found.theta) * errors[:, None, number]
    return np.stack([_estimate(found, G, each) for each in disturbed])


def interval(values: Array) -> tuple[Array, Array]:
    """The probabilistically symmetric 95 % interval of each column."""
    low, high = np.quantile(values, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
    return low, high


def tolerance(std: float) -> float:
    """Half a unit of the first digit of a standard uncertainty."""
    return 0.5 * 10.0 ** exponent(std) if std > 0 else 0.0


def verdict(value: float, expanded: float, std: float, low: float, high: float) -> str:
    """What the simulated interval (low, high) says of value +- expanded: one of the three."""
    beyond = expanded - (value - low), expanded - (high - value)
    if min(beyond) < -tolerance(std):
        return WIDENED
    return CONSERVATIVE if max(beyond) > tolerance(std) else CONFIRMED


def _estimate(found: Fit, G: Array, disturbed: Array) -> Array:
    """The parameters that the disturbed residual leads to: Newton's way with the fit's own gain."""
    theta = found.theta
    for _ in range(STEPS):
        left = found.problem.residual(theta) - found.residual + disturbed
        theta = theta - np.einsum("pcn,cn->p", G, left)
    return theta


def _noise(noise: Noise, trials: int, rng: np.random.Generator) -> Array:
    """Noise of the means, shape (trials, channels, n)."""
    channels, n = noise.white.shape
    out = noise.fast * rng.standard_normal((trials, channels, n))
    for c, (taus_s, slow) in enumerate(zip(noise.taus_s, noise.slow, strict=True)):
        for tau_s in taus_s if slow > 0 else ():
            out[:, c] += slow / np.sqrt(len(taus_s)) * _wandering(np.exp(-noise.gap_s / tau_s), trials, rng)
    return out


def _wandering(phi: Array, trials: int, rng: np.random.Generator) -> Array:
    """Gauss-Markov processes of unit variance, shape (trials, n), `phi` from each row to the next."""
    x = np.empty((trials, len(phi)))
    x[:, 0] = rng.standard_normal(trials)
    for i in range(1, len(phi)):
        x[:, i] = phi[i] * x[:, i - 1] + np.sqrt(1 - phi[i] ** 2) * rng.standard_normal(trials)
    return x
