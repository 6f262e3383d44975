"""Poses, time, temperature, supply and vibration of one record, all from one random generator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LAYOUTS = ("turns", "uneven", "shuffled", "sparse", "plus-minus")
DWELL_S = 5.0


SAMPLE_V = 0.78e-3  # noise of a sample without shaking


@dataclass(frozen=True)
class Bench:
    """One record: columns (n,), angles in rad. `die_c` is the temperature of the sensor."""

    alpha: Array
    beta: Array
    direction: Array
    path: Array
    t: Array
    die_c: Array
    thermometer_c: Array
    supply_v: Array
    vibration: Array  # rms of the shaking at each pose, in units of the sample noise

    @property
    def sample_noise_v(self) -> Array:
        """Standard deviation of a sample at each pose, noise and shaking, (n,)."""
        return np.asarray(SAMPLE_V * np.sqrt(1 + self.vibration**2))

    @property
    def n(self) -> int:
        """Poses."""
        return len(self.t)

    @property
    def age(self) -> Array:
        """Time since the first pose, as a share of the record."""
        return (self.t - self.t[0]) / (self.t[-1] - self.t[0])


def bench(random: np.random.Generator, layout: str) -> Bench:
    """A record of one layout."""
    alpha, beta, direction, path = _poses(random, layout)
    moved = np.hypot(np.diff(alpha, prepend=alpha[0]), np.diff(beta, prepend=beta[0]))
    t = np.cumsum(DWELL_S + 1.0 + moved / random.uniform(8.0, 25.0)) + random.uniform(1.0, 30.0)
    die = _room(random, t)
    lag = random.uniform(10.0, 250.0)
    shown = _lagging(die, t, lag) + random.normal(0, random.choice([0.003, 0.01]), len(t))
    supply = 5.0 + 4e-4 * _wander(random, t, 900.0) + 2e-4 * (die - die.mean()) / max(float(np.std(die)), 1e-9)
    vibration = np.exp(0.6 * _wander(random, t, 300.0)) * random.uniform(0.4, 1.5)
    return Bench(np.radians(alpha), np.radians(beta), direction, path, t, die, shown, supply, vibration)


def _poses(random: np.random.Generator, layout: str) -> tuple[Array, Array, Array, Array]:
    step = 15.0 if layout == "sparse" else 10.0
    up = np.arange(0.0, 360.5, step)
    inclinations = {
        "turns": [90, 30, 150, 60, 120, 45, 75],
        "uneven": [90, 20, 47, 71, 133, 155],
        "shuffled": [90, 30, 150, 60, 120, 45],
        "sparse": [90, 35, 65, 115, 145],
        "plus-minus": [90, -90, 40, -40, 140, -140, 65],
    }[layout]
    back = up[::-1] - (5.0 if layout == "uneven" else 0.0)
    alpha = np.repeat(np.array(inclinations, float), 2 * len(up))
    beta = np.tile(np.concatenate([up, back]), len(inclinations))
    direction = np.tile(np.repeat([1.0, -1.0], len(up)), len(inclinations))
    path = np.repeat(np.arange(2.0 * len(inclinations)), len(up))
    if layout == "shuffled":
        order = random.permutation(len(alpha))
        alpha, beta, path = alpha[order], beta[order], path[order]
        direction = np.where(np.diff(beta, prepend=beta[0] - 1) >= 0, 1.0, -1.0)
    return alpha, beta, direction, path


def _room(random: np.random.Generator, t: Array) -> Array:
    """Heating by the air conditioning, the day, and people who come and go."""
    u = (t - t[0]) / (t[-1] - t[0])
    day = random.uniform(0.3, 2.0) * np.sin(2 * np.pi * (random.uniform(0.3, 1.2) * u + random.uniform()))
    settling = random.uniform(-2.0, 2.0) * np.exp(-u / random.uniform(0.1, 0.8))
    cycling = random.choice([0.0, 0.15, 0.5]) * np.sin(2 * np.pi * t / random.uniform(600.0, 1800.0))
    return 22.0 + random.uniform(-2, 2) + day + settling + cycling + 0.2 * _wander(random, t, 1200.0)


def _wander(random: np.random.Generator, t: Array, tau: float) -> Array:
    """A Gauss-Markov process of standard deviation 1."""
    x = np.empty(len(t))
    x[0] = random.normal()
    kept = np.exp(-np.diff(t) / tau)
    for i, (k, e) in enumerate(zip(kept, random.normal(size=len(kept)), strict=True)):
        x[i + 1] = k * x[i] + np.sqrt(1 - k * k) * e
    return x


def _lagging(x: Array, t: Array, tau: float) -> Array:
    """What a first-order lag shows, settled at the beginning."""
    y = np.empty_like(x)
    y[0] = x[0]
    for i, dt in enumerate(np.diff(t)):
        y[i + 1] = x[i + 1] + (y[i] - x[i + 1]) * np.exp(-dt / tau)
    return y


def flicker(random: np.random.Generator, t: Array) -> Array:
    """Gauss-Markov processes a decade apart, standard deviation 1."""
    taus = np.geomspace(20.0, float(t[-1] - t[0]), 5)
    return np.sum([_wander(random, t, tau) for tau in taus], axis=0) / np.sqrt(len(taus))
