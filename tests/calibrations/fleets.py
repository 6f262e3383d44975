"""Sensors of a batch on a rig, by formulas written out here: two axes, 60 poses, a full turn each way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.table import Array, Table

ALPHA = np.repeat([90.0, 30.0, 150.0, 60.0, 120.0], 12)
BETA = np.tile(np.concatenate([np.arange(0.0, 360.0, 60.0), np.arange(300.0, -60.0, -60.0)]), 5)
SIDE = np.tile(np.repeat([1.0, -1.0], 6), 5)
NOISE_V = 50e-6
SAMPLES = 5000.0


@dataclass(frozen=True)
class Rig:
    """How far the table truly is from what it says, deg: one wave in a turn, a zero, half a play."""

    wave: float = 0.0
    zero: float = 0.0
    play: float = 0.0


@dataclass(frozen=True)
class Flaw:
    """What the sensor itself does: bent (V/g^2), slow with temperature (V/K), askew (standard deviation, deg)."""

    bend: float = 0.0
    warmth: float = 0.0
    askew: float = 0.0


def sensor(seed: int, flaw: Flaw = Flaw(), rig: Rig = Rig(), chosen: slice = slice(None)) -> Table:
    """One sensor's poses, its bias and scale factor drawn; `chosen` of the 60."""
    rng = np.random.default_rng([71, seed])
    t = 100.0 + 7.0 * np.arange(len(ALPHA))
    warm = 25.0 + 2.0 * np.sin(t / 300.0 + rng.uniform(0, 6))
    turned = np.radians(flaw.askew * rng.standard_normal())
    x, y = _gravity(rig)
    outputs = [_output(rng, a, flaw, warm) for a in (x + turned * y, y - turned * x)]
    std = NOISE_V * np.sqrt(SAMPLES) * np.ones(len(t))
    columns = {"alpha_deg": ALPHA, "beta_deg": BETA, "direction": SIDE, "t_s": t, "temperature_c": warm}
    columns |= {"vx_v": outputs[0], "vy_v": outputs[1], "vx_std_v": std, "vy_std_v": std, "n": std * 0 + SAMPLES}
    return Table.from_columns("poses", {name: values[chosen] for name, values in columns.items()}, source=f"S{seed}")


def _gravity(rig: Rig) -> tuple[Array, Array]:
    """Along x and y of a sensor that stands straight, where the table truly is."""
    alpha, beta = np.radians(ALPHA), np.radians(BETA)
    beta = beta + np.radians(rig.wave * np.sin(beta) + rig.zero - rig.play * SIDE)
    return np.sin(alpha) * np.cos(beta), np.sin(alpha) * np.sin(beta)


def _output(rng: np.random.Generator, a: Array, flaw: Flaw, warm: Array) -> Array:
    zero, gain = 2.5 + 0.02 * rng.standard_normal(), 1 + 0.02 * rng.standard_normal()
    noise = NOISE_V * rng.standard_normal(len(a))
    return zero + gain * a + flaw.bend * a * a + flaw.warmth * (warm - 25.0) + noise
