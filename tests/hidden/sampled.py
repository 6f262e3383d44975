"""Sweeps made sample by sample by plain laws of their own: another generator beside the simulated world.

Each dwell is 500 samples at 100 Hz of a sensor behind a 15 Hz filter. The causes are none of the catalogue's formulas:
an amplifier that bends softly before its rail, a converter that rounds each sample, plays of several widths, heat that
settles in two steps, a sum of many small kicks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from calibrations.table import Array, Table

RATE_HZ, SAMPLES, CORNER_HZ = 100.0, 500, 15.07
INCLINATIONS_DEG = (90.0, 30.0, 150.0, 60.0, 120.0, 45.0, 135.0)
NOISE_V = 0.8e-3  # of a sample
PERIOD_S = 7.0  # from pose to pose


@dataclass(frozen=True)
class Sweep:
    """Where the stages stand, when, and what the sensor feels: g, shape (n, 2)."""

    alpha_deg: Array
    beta_deg: Array
    direction: Array
    t_s: Array
    a: Array
    temperature_c: Array


def sweep() -> Sweep:
    """Seven inclinations, every 10 deg, both ways: 518 poses; the room warms and cools by 2 K."""
    up = np.arange(0.0, 361.0, 10.0)
    beta = np.tile(np.concatenate([up, up[::-1]]), len(INCLINATIONS_DEG))
    direction = np.tile(np.repeat([1.0, -1.0], len(up)), len(INCLINATIONS_DEG))
    alpha = np.repeat(INCLINATIONS_DEG, 2 * len(up))
    t = PERIOD_S * np.arange(len(beta))
    s = np.sin(np.radians(alpha))
    a = np.column_stack([s * np.cos(np.radians(beta)), s * np.sin(np.radians(beta))])
    return Sweep(alpha, beta, direction, t, a, 24 + 2 * np.sin(2 * np.pi * t / 1900) - t / 3000)


Cause = Callable[[Array, Sweep, np.random.Generator], Array]
Converter = Callable[[Array], Array]


def measured(
    seed: int, cause: Cause | None = None, converter: Converter | None = None, noise_v: float = NOISE_V
) -> Table:
    """A table of poses: `cause` turns volts (n, 2) into others, `converter` single samples (samples, 2)."""
    random, poses = np.random.default_rng(seed), sweep()
    volts = random.normal(2.5, 0.02, 2) + random.normal(1.0, 0.01, 2) * poses.a
    volts = volts if cause is None else cause(volts, poses, random)
    kept = np.exp(-2 * np.pi * CORNER_HZ / RATE_HZ)
    means, stds = np.empty_like(volts), np.empty_like(volts)
    for k, level in enumerate(volts):
        white = random.normal(0.0, noise_v * np.sqrt(1 - kept**2), (SAMPLES + 50, 2))
        samples = level + lfilter([1.0], [1.0, -kept], white, axis=0)[50:]
        samples = samples if converter is None else converter(samples)
        means[k], stds[k] = samples.mean(axis=0), samples.std(axis=0, ddof=1)
    columns = {
        "alpha_deg": poses.alpha_deg,
        "beta_deg": poses.beta_deg,
        "direction": poses.direction,
        "t_s": poses.t_s,
        "temperature_c": poses.temperature_c,
        "vx_v": means[:, 0],
        "vy_v": means[:, 1],
        "vx_std_v": stds[:, 0],
        "vy_std_v": stds[:, 1],
        "n": np.full(len(means), float(SAMPLES)),
    }
    return Table.from_columns("poses", columns, {"sample_rate_hz": RATE_HZ, "filter_corner_hz": CORNER_HZ}, "sampled")


def rounded(step_v: float) -> Converter:
    """Codes at whole steps, a third of a step off zero."""
    return lambda samples: step_v * (np.round(samples / step_v - 1 / 3) + 1 / 3)


def clipped(rail_v: float, soft_v: float) -> Cause:
    """An output stage that bends into its upper rail over `soft_v`."""
    return lambda v, poses, random: rail_v - soft_v * np.logaddexp(0.0, (rail_v - v) / soft_v)


def ramp(volts_per_h: float) -> Cause:
    """A reference that ages evenly."""
    return lambda v, poses, random: v + np.outer(poses.t_s / 3600, volts_per_h * np.array([1.0, -0.7]))


def kicks(volts: float) -> Cause:
    """Many small kicks of either sign that stay."""
    return lambda v, poses, random: v + volts * np.cumsum(random.standard_normal(v.shape), axis=0) / np.sqrt(len(v))


def settling_gain(fraction: float) -> Cause:
    """A gain that settles as a package and then a board warm: two exponentials."""

    def cause(v: Array, poses: Sweep, random: np.random.Generator) -> Array:
        left = 0.8 * np.exp(-poses.t_s / 500) + 0.2 * np.exp(-poses.t_s / 1500)
        return v + fraction * left[:, None] * poses.a * np.array([1.0, 1.3])

    return cause


def lagging_stress(volts_per_k: float) -> Cause:
    """Stress that follows the temperature through three plays of different widths."""

    def cause(v: Array, poses: Sweep, random: np.random.Generator) -> Array:
        total = np.zeros(len(v))
        for width_k in (0.6, 1.0, 1.4):
            held = poses.temperature_c[0]
            for k, c in enumerate(poses.temperature_c):
                held = min(max(held, c - width_k / 2), c + width_k / 2)
                total[k] += held / 3
        return v + np.outer(total - total[0], volts_per_k * np.array([1.0, -0.6]))

    return cause


def threshold(width_g: float) -> Cause:
    """Stiction: below a threshold the mass does not move; it differs a little from pose to pose."""

    def cause(v: Array, poses: Sweep, random: np.random.Generator) -> Array:
        width = width_g * (1 + 0.1 * random.standard_normal(v.shape))
        return v - np.sign(poses.a) * np.minimum(np.abs(poses.a), width)

    return cause
