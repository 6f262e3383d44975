"""Soaks of a bias by laws of their own: none of them is that of the filters, nor that of the simulated world.

Two time constants, flicker noise by its spectrum, a room that warms and cools the sensor in a day and in the cycles of
an air conditioner. And soaks of the simulated world, whose final values are read off a world without noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibrations.analyses.forecast import STRETCH_S
from calibrations.table import Array, Table
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.soak import HOLD, schedule
from procedures.tumbles import tumble

STEP_S, TUMBLE_S, MOVE_S, FIRST_S = 10.0, 72.0, 6.0, 45.0
WHITE_V, BLOCK_V = 18e-6, 36e-6  # of the bias of a reversal, and of 10 s held still
LOAD_V = 3.1e-3  # what the load along z adds while it lies flat


@dataclass(frozen=True)
class Value:
    """One value as the filters take it: s, V, V; whether it is of the still record."""

    t_s: float
    volts: float
    std_v: float
    held: bool


@dataclass(frozen=True)
class Drifting:
    """A soak's values in order, and what the bias comes to, V."""

    values: tuple[Value, ...]
    final_v: float


def holds() -> Iterator[tuple[float, float]]:
    """Start and length of each hold of twelve hours, as the schedule has them."""
    now = FIRST_S + TUMBLE_S / 2 + MOVE_S
    for number in range(52):
        length = 900.0 / 2 ** max(0, 4 - number)
        yield now, length
        now += length + TUMBLE_S + 2 * MOVE_S


def drifting(seed: int) -> Drifting:
    """Twelve hours of a bias that comes to 0 V."""
    random = np.random.default_rng([seed, 77])
    t_s = np.arange(0.0, 13.8 * 3600, STEP_S)
    approach = two_exponentials(random, t_s)
    slow = flicker(random, len(t_s)) * random.choice([5e-6, 15e-6, 40e-6]) + 0.3e-3 * random.normal() * room(
        random, t_s
    )
    return Drifting(soak_values(random, t_s, approach + slow), 0.0)


def soak_values(random: np.random.Generator, t_s: Array, volts: Array) -> tuple[Value, ...]:
    """The values of a soak from the course of a bias: one of each tumble, and of the stretches of each hold."""
    values = []
    for start, length in holds():
        values.append(seen(random, t_s, volts, start - MOVE_S - TUMBLE_S, TUMBLE_S, WHITE_V))
        count = max(3, int(np.ceil(length / STRETCH_S)))
        part = length / count
        std = BLOCK_V * np.sqrt(STEP_S / part)
        values += [seen(random, t_s, volts, start + k * part, part, std, held=True) for k in range(count)]
    return tuple(values)


def two_exponentials(random: np.random.Generator, t_s: Array) -> Array:
    """A board's hours and a package's minutes."""
    hours, minutes = 1.3 * 3600 * np.exp(0.5 * random.normal()), np.exp(random.uniform(np.log(90), np.log(900)))
    slow, fast = 2e-3 * random.normal(), 0.8e-3 * random.normal()
    return np.asarray(slow * np.exp(-t_s / hours) + fast * np.exp(-t_s / minutes))


def flicker(random: np.random.Generator, n: int) -> Array:
    """Noise of unit rms whose spectrum falls with frequency, by Fourier transform."""
    f = np.arange(1, n + 1)
    spectrum = (random.standard_normal(n) + 1j * random.standard_normal(n)) / np.sqrt(f)
    noise = np.fft.irfft(np.concatenate([[0], spectrum]), 2 * n)[:n]
    return np.asarray(noise / noise.std())


def room(random: np.random.Generator, t_s: Array) -> Array:
    """Its temperature, K, about the mean."""
    day = 0.1 * random.normal() * np.sin(2 * np.pi * t_s / 86400 + random.uniform(0, 7))
    return np.asarray(day + 0.03 * np.sin(2 * np.pi * t_s / random.uniform(1200, 3000) + random.uniform(0, 7)))


def seen(
    random: np.random.Generator, t_s: Array, volts: Array, start_s: float, length_s: float, std_v: float, *,
    held: bool = False,
) -> Value:  # fmt: skip
    """The mean of a stretch, with white noise."""
    inside = volts[(t_s >= start_s) & (t_s < max(start_s + length_s, start_s + STEP_S))]
    mean = float(inside.mean()) + std_v * float(random.standard_normal())
    return Value(start_s + length_s / 2, mean + LOAD_V * held, std_v, held)


COLD = WorldConfig.adxl203().changed({"heat": {"powered_for_s": 0.0}})
SETTLED = WorldConfig.adxl203().changed({
    "heat": {"powered_for_s": 1e6, "ambient_wander_k": 0.0}, "supply": {"wander_v": 0.0}, "noise": {"flicker_v": 0.0}
})  # fmt: skip


def soak_of_world(seed: int, duration_s: float = 43200.0) -> tuple[Table, Table]:
    """A soak's table out of the simulated world, and a tumble of the same sensor after days and without any noise."""
    poses = list(schedule(duration_s, 900.0, STRETCH_S / 2))
    world, rows = World(COLD, seed), []
    for pose in poses:
        dwell_s = STRETCH_S / 2 if pose.path.startswith(HOLD) else 5.0
        rows.append(world.dwell_mean([pose.alpha_deg], pose.beta_deg, direction=pose.direction, dwell_s=dwell_s))
    final = list(tumble("reversal 0"))
    beta_deg, direction = [p.beta_deg for p in final], [p.direction for p in final]
    settled = World(SETTLED, seed)
    for _ in range(2):  # the contacts have no history before the first
        end = settled.dwell_mean(np.full(8, 90.0), beta_deg, direction=direction, noise_free=True)
        settled.dwell_mean([0.0], 0.0, noise_free=True)
    columns = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    return table(columns, [p.path for p in poses]), table(end, [p.path for p in final])


def table(columns: dict[str, Array], paths: list[str]) -> Table:
    """As a run has it."""
    constants = {"sample_rate_hz": 1000.0, "filter_corner_hz": 15.07}
    return Table.from_columns("poses", columns, constants, "a soak", {"path": tuple(paths)})
