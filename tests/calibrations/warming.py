"""Soaks out of physics, with no law of the filters in them: no exponential, no Gauss-Markov noise, no sine.

Heat flows from a warming chip through a board of many pieces into a house whose thermostat switches between on and off
under a sky that warms by day, cools by night, and has weather. Flicker noise is that of traps in the transistors, each
of which jumps between two states.

Source  McWhorter, 1/f noise and germanium surface properties (1957): traps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.table import Array
from tests.calibrations.drifting import (
    STEP_S,
    Drifting,
    soak_values,
)

DAY_S, HOUR_S = 86400.0, 3600.0
RECORD_S = 13.8 * HOUR_S
PIECES = 8  # of the board
TRAPS = 60


@dataclass(frozen=True)
class Sensor:
    """Random of its kind: V/K, K, s, s, V of flicker rms."""

    per_k: float
    rise_k: float
    board_s: float
    chip_s: float
    flicker_v: float

    @classmethod
    def of(cls, random: np.random.Generator) -> Sensor:
        return cls(
            0.3e-3 * random.normal(), random.uniform(4, 9), HOUR_S * np.exp(random.normal(0.2, 0.5)),
            np.exp(random.uniform(np.log(60), np.log(600))), float(random.choice([4e-6, 12e-6, 35e-6])),
        )  # fmt: skip


def warming(seed: int) -> Drifting:
    """Twelve hours of a bias; it comes to what it has at the mean temperature of the house."""
    random = np.random.default_rng([seed, 1957])
    sensor = Sensor.of(random)
    t_s = np.arange(0.0, RECORD_S, STEP_S)
    house_k, mean_k = house(random)
    chip_k = chip(sensor, house_k)
    final = sensor.per_k * (sensor.rise_k + mean_k)
    volts = sensor.per_k * chip_k + sensor.flicker_v * traps(random, len(t_s))
    return Drifting(soak_values(random, t_s, volts), final)


def house(random: np.random.Generator) -> tuple[Array, float]:
    """Temperature at the rig during the record, and its mean over five days about it; K, from the thermostat's."""
    t_s = np.arange(0.0, 5 * DAY_S, STEP_S)
    hour = (t_s / HOUR_S + random.uniform(0, 24)) % 24
    sun = np.where((hour > 7) & (hour < 19), np.sin(np.pi * (hour - 7) / 12) ** 2, 0.0)
    weather = np.repeat(np.cumsum(random.normal(0, 0.4, 121)), int(HOUR_S / STEP_S))[: len(t_s)]
    outside = random.uniform(-14, -6) + random.uniform(2, 8) * sun + weather - weather.mean()
    leak_s, power_k_s = 30 * HOUR_S, 25.0 / (30 * HOUR_S)
    band, lag_s = random.uniform(0.1, 0.4), random.uniform(600, 2400)
    inside = wall = rig = 0.0
    heating, found = False, np.empty(len(t_s))
    for k, out in enumerate(outside):
        heating = inside < (band if heating else -band)
        inside += STEP_S * (5 * power_k_s * heating + (out - inside) / leak_s + (wall - inside) / (2 * HOUR_S))
        wall += STEP_S * ((inside - wall) / (8 * HOUR_S) + (out - wall) / (200 * HOUR_S))
        rig += STEP_S * (0.7 * inside + 0.3 * wall - rig) / lag_s
        found[k] = rig
    begin = int(2 * DAY_S / STEP_S)
    return found[begin : begin + int(RECORD_S / STEP_S)], float(found[int(DAY_S / STEP_S) :].mean())


def chip(sensor: Sensor, house_k: Array) -> Array:
    """Temperature of the chip, K: a chain from the chip through the pieces of the board, each open to the room."""
    n = PIECES + 1
    heat_s = np.full(n, sensor.board_s)  # what a piece alone takes to come to the room's
    chain = np.zeros((n, n))
    for k in range(n - 1):
        speed = 1 / sensor.chip_s if k == 0 else 25.0 / sensor.board_s
        chain[k, k] -= speed
        chain[k, k + 1] += speed
        chain[k + 1, k + 1] -= speed / (20 if k == 0 else 1)
        chain[k + 1, k] += speed / (20 if k == 0 else 1)
    loss = np.diag(np.r_[0.0, 1 / heat_s[1:]])
    power = np.zeros(n)
    power[0] = 1.0
    power *= sensor.rise_k / np.linalg.solve(loss - chain, power)[0]
    step = np.linalg.inv(np.eye(n) - STEP_S * (chain - loss))
    now, found = np.full(n, house_k[0]), np.empty(len(house_k))
    for k, room in enumerate(house_k):
        found[k] = now[0]
        now = step @ (now + STEP_S * (power + loss @ np.full(n, room)))
    return found


def traps(random: np.random.Generator, n: int) -> Array:
    """Flicker noise of unit rms: traps that jump at rates of every order from a second to days."""
    total = np.zeros(n)
    for rate in np.exp(random.uniform(np.log(1e-6), np.log(0.1), TRAPS)):
        jumps = random.random(n) < -np.expm1(-2 * rate * STEP_S) / 2
        total += random.choice([-1.0, 1.0]) * (-1.0) ** np.cumsum(jumps)
    return total / np.sqrt(TRAPS)
