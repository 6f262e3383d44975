"""Clock, temperature, supply voltage and slow noise of one record."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tests.benchmark.examiner.layouts import Array, Poses

STAGE_S_PER_DEG = 0.05
NIGHT_S = 20 * 3600.0


@dataclass(frozen=True)
class Clock:
    """Times of the poses, s, (n,). `on_s` is the time since power-on at the first pose.

    `elapsed` counts from the first pose; `t` is the logged time, which starts again on the second day if `restarted`.
    `span_s` is the length of the record, of the first day if it has two.
    """

    elapsed: Array
    t: Array
    on_s: float
    restarted: bool
    second_day: Array
    span_s: float

    @property
    def since_start(self) -> Array:
        """Logged time since the first pose after power-on."""
        return self.t - self.on_s


def draw_clock(random: np.random.Generator, poses: Poses, is_young: bool, restarted: bool | None) -> Clock:
    """Dwells and moves. `is_young`: the sensor was switched on shortly before. `restarted`: None draws it."""
    n, half, two_days = poses.n, poses.n // 2, poses.layout == "two_days"
    dwell = random.choice([6.0, 8.0, 12.0, 20.0, 31.0]) if n > 150 else random.choice([30.0, 60.0, 90.0])
    moves = np.r_[0, np.abs(np.diff(poses.alpha))] + np.r_[0, np.abs(np.diff(poses.beta))]
    elapsed = np.cumsum(dwell + STAGE_S_PER_DEG * moves + random.uniform(0, 0.2, n))
    elapsed = elapsed - elapsed[0]
    on = float(random.choice([4.0, 20.0, 300.0, 2000.0, 9000.0]))
    if is_young:
        on = float(random.choice([4.0, 20.0, 60.0]))
    again = False
    if two_days:
        elapsed[half:] += NIGHT_S
        again = bool(random.random() < 0.3) if restarted is None else restarted
    t = elapsed + on
    if again:
        t[half:] = elapsed[half:] - elapsed[half] + on
    second_day = (np.arange(n) >= half) & two_days
    return Clock(elapsed, t, on, again, second_day, float(elapsed[half - 1] if two_days else elapsed[-1]))


@dataclass(frozen=True)
class Temperature:
    """Temperature of the sensor, degC, (n,). `q` is its deviation from the mean in 1.5 standard deviations.

    `lagged_q` is the same behind a first-order lag of `lag_s`.
    """

    kind: str
    celsius: Array
    q: Array
    lagged_q: Array
    lag_s: float


def draw_temperature(random: np.random.Generator, clock: Clock, kind: str | None) -> Temperature:
    """A temperature over the record. `kind`: None draws it."""
    kind = kind or str(random.choice(["ac", "ramp", "door", "cycle", "selfheat"]))
    change = _change(random, clock, kind)
    if clock.second_day.any():
        day = clock.second_day
        change = change - (change[day].mean() - change[~day].mean()) * day + random.uniform(-2, 2) * day
    celsius = random.uniform(20.5, 27) + change
    lag = float(random.uniform(0.03, 0.08) * clock.span_s)
    late = lagged(clock.elapsed, celsius, lag, celsius[0])
    q, lagged_q = ((x - celsius.mean()) / (celsius.std() + 1e-9) / 1.5 for x in (celsius, late))
    return Temperature(kind, celsius, q, lagged_q, lag)


def _change(random: np.random.Generator, clock: Clock, kind: str) -> Array:
    """Change of temperature, K: air conditioning, a ramp, an opened door, a cycle of a chamber, or self-heating."""
    u, share = clock.elapsed, clock.elapsed / max(clock.span_s, 1)
    if kind == "ac":
        height = random.uniform(0.5, 1.5)
        wave = np.sin(2 * np.pi * u / random.uniform(900, 3000) + random.uniform(0, 6))
        return height * wave + 0.4 * wander(random, u, 4000.0)
    if kind == "ramp":
        return random.uniform(3, 8) * random.choice([-1, 1]) * share + 0.15 * wander(random, u, 2000.0)
    if kind == "door":
        change = 0.3 * wander(random, u, 5000.0)
        for opened in random.uniform(0.1, 0.9, int(random.integers(1, 4))):
            after = np.clip(u - opened * clock.span_s, 0, None)
            drop = random.uniform(1.5, 4)
            change = change - drop * (1 - np.exp(-after / 60)) * np.exp(-after / (0.12 * clock.span_s))
        return change
    if kind == "cycle":
        height = random.uniform(3, 6)
        wave = np.sin(2 * np.pi * share / random.uniform(0.55, 0.9) + random.uniform(0, 6))
        return height * wave + 0.1 * wander(random, u, 2000.0)
    height = random.uniform(3, 6)
    rise = 1 - np.exp(-(u + 30) / (random.uniform(0.15, 0.5) * clock.span_s))
    return height * rise + 0.15 * wander(random, u, 3000.0)


@dataclass(frozen=True)
class Supply:
    """Supply voltage, V, (n,). `q` is its deviation from the mean in 1.5 standard deviations."""

    kind: str
    nominal_v: float
    volts: Array
    q: Array


def draw_supply(random: np.random.Generator, clock: Clock, temperature: Temperature) -> Supply:
    """A supply that wanders, that a load pulls up and down, or that follows the temperature."""
    u = clock.elapsed
    kind = str(random.choice(["wander", "load", "heat"], p=[0.5, 0.35, 0.15]))
    if kind == "wander":
        change = random.uniform(0.004, 0.02) * wander(random, u, random.uniform(200, 1500))
    elif kind == "load":
        height = random.uniform(0.008, 0.03)
        is_on = np.sin(2 * np.pi * u / random.uniform(500, 1700)) > random.uniform(-0.3, 0.5)
        change = height * is_on + 0.002 * wander(random, u, 900.0)
    else:
        change = 0.012 * temperature.q + 0.002 * wander(random, u, 600.0)
    nominal = float(random.choice([5.0, 3.3]))
    volts = nominal + change
    return Supply(kind, nominal, volts, (volts - volts.mean()) / (volts.std() + 1e-12) / 1.5)


def wander(random: np.random.Generator, t: Array, tau_s: float) -> Array:
    """An Ornstein-Uhlenbeck process (first-order Gauss-Markov) of standard deviation 1 at the times `t`."""
    values = np.empty(len(t))
    values[0] = random.normal()
    for i in range(1, len(t)):
        k = math.exp(-max(t[i] - t[i - 1], 1e-3) / tau_s)
        values[i] = k * values[i - 1] + math.sqrt(1 - k * k) * random.normal()
    return values


def lagged(t: Array, values: Array, tau_s: float, start: float) -> Array:
    """First-order lag tau dy/dt = x - y, exact for an input that is linear between the times; settled at `start`."""
    out = np.empty(len(t))
    state, before, x_before = start, t[0] - 60.0, start
    for i in range(len(t)):
        step = t[i] - before
        k = math.exp(-step / tau_s)
        slope = (values[i] - x_before) / step
        state = values[i] - slope * tau_s + (state - x_before + slope * tau_s) * k
        out[i], before, x_before = state, t[i], values[i]
    return out


def slow_noise(random: np.random.Generator, t: Array, kind: str) -> Array:
    """Flicker noise (Gauss-Markov processes of several time constants) or a random walk, standard deviation 1."""
    if kind == "flicker":
        noise = np.zeros(len(t))
        for tau in (30.0, 120.0, 500.0, 2000.0, 8000.0):
            noise = noise + wander(random, t, tau)
    else:
        steps = np.sqrt(np.r_[1.0, np.minimum(np.diff(t), 3600)])
        noise = np.cumsum(random.normal(size=len(t)) * steps)
    noise = noise - noise.mean()
    return noise / noise.std()
