"""Still records with a hidden noise process, each made by a mechanism that shares nothing with the fit.

Flicker comes from traps that catch and release charge (McWhorter) and, beside that, from fractional differences
(Kasdin); Gauss-Markov noise from one trap of two levels and from a recursion; a random walk from rare steps; hum as
mains with a harmonic; quantisation from a counter that is read; white noise from a uniform distribution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from tests.calibrations.noises import flicker

Array = NDArray[np.float64]
Random = np.random.Generator
SAMPLES, RATE_HZ = 20_000, 10.0


def white(random: Random, n: int = SAMPLES) -> Array:
    """Of unit variance, and not normal."""
    return random.uniform(-np.sqrt(3), np.sqrt(3), n)


def traps(random: Random, n: int = SAMPLES) -> Array:
    """Two traps to each decade of holding times, from half a sample to ten records: S(f) = 1 / (2 pi f)."""
    times = np.geomspace(0.5, 10 * n, 2 * int(np.log10(20 * n)) + 1)
    size = np.sqrt(np.log(times[1] / times[0]) / np.pi)
    return size * np.sum([relaxing(random, n, each) for each in times], axis=0)


def relaxing(random: Random, n: int, time: float) -> Array:
    """Many traps of one holding time, as one: what they hold together forgets exponentially."""
    kept = np.exp(-1 / time)
    driven = random.standard_normal(n) * np.sqrt(1 - kept**2)
    driven[0] = random.standard_normal()
    out = np.empty(n)
    last = 0.0
    for i, step in enumerate(driven.tolist()):
        last = kept * last + step
        out[i] = last
    return out


def fractional(random: Random, n: int = SAMPLES) -> Array:
    """White noise integrated by half, with a past of three lengths."""
    return flicker(random, n, 4)


def telegraph(random: Random, n: int = SAMPLES, stay: float = 1000.0) -> Array:
    """One trap of two levels, +1 and -1, that stays `stay` samples on average: exponentially correlated."""
    return np.where(np.cumsum(random.random(n) < 1 / stay) % 2, 1.0, -1.0)


def levels(random: Random, n: int, stay: float, count: int) -> Array:
    """One trap of several levels 0, 1, 2, ..., that stays `stay` samples on average, and goes to any other level."""
    steps = np.where(random.random(n) < 1 / stay, random.integers(1, count, n), 0)
    return np.cumsum(steps) % count * 1.0


def walk(random: Random, n: int = SAMPLES) -> Array:
    """A step of +10 or -10 with every hundredth sample: of unit variance to a sample."""
    return np.cumsum(10.0 * random.choice([-1.0, 1.0], n) * (random.random(n) < 0.01))


def counted(random: Random, n: int = SAMPLES) -> Array:
    """What a counter of whole numbers grows by, of a sum that grows by 7.3 and by noise."""
    total = np.cumsum(7.3 + 0.5 * random.standard_normal(n + 1))
    return np.diff(np.floor(total)) - 7.3


def hum(random: Random, n: int = SAMPLES) -> Array:
    """A sinusoid at 0.37 Hz and its third harmonic."""
    phase = 2 * np.pi * 0.037 * np.arange(n) + random.uniform(0, 2 * np.pi)
    return np.sin(phase) + 0.4 * np.sin(3 * phase)


RECORDS: Mapping[str, tuple[Callable[[Random], Array], frozenset[str]]] = {
    "white": (white, frozenset()),
    "traps": (lambda r: white(r) + 0.5 * traps(r), frozenset({"flicker-noise"})),
    "fractional": (lambda r: white(r) + 0.5 * fractional(r), frozenset({"flicker-noise"})),
    "walk": (lambda r: white(r) + 0.005 * walk(r), frozenset({"rate-random-walk"})),
    "telegraph": (lambda r: white(r) + 0.7 * telegraph(r), frozenset({"gauss-markov-noise"})),
    "relaxation": (lambda r: white(r) + 0.5 * relaxing(r, SAMPLES, 200.0), frozenset({"gauss-markov-noise"})),
    "counter": (lambda r: 2 * counted(r), frozenset({"quantisation-noise"})),
    "hum": (lambda r: white(r) + 0.2 * hum(r), frozenset({"sinusoidal-noise"})),
    "traps and walk": (
        lambda r: white(r) + 0.3 * traps(r) + 0.03 * walk(r), frozenset({"flicker-noise", "rate-random-walk"})
    ),
    "traps and hum": (
        lambda r: white(r) + 0.5 * traps(r) + 0.3 * hum(r), frozenset({"flicker-noise", "sinusoidal-noise"})
    ),
    "telegraph and walk": (
        lambda r: white(r) + 0.7 * telegraph(r, stay=200.0) + 0.02 * walk(r),
        frozenset({"gauss-markov-noise", "rate-random-walk"}),
    ),
    "telegraph and hum": (
        lambda r: white(r) + 0.7 * telegraph(r) + 0.3 * hum(r), frozenset({"gauss-markov-noise", "sinusoidal-noise"})
    ),
    "counter and traps": (
        lambda r: counted(r) + 0.2 * traps(r), frozenset({"quantisation-noise", "flicker-noise"})
    ),
}  # fmt: skip
OTHERS: Mapping[str, tuple[Callable[[Random], Array], str]] = {  # what no mixture of noise is, and how it is told
    "step": (lambda r: white(r) + 0.3 * (np.arange(SAMPLES) > 7000), "a step of +"),
    "drift": (lambda r: white(r) + 0.4 * np.arange(SAMPLES) / SAMPLES, "a drift of x"),
    "settling": (lambda r: white(r) + np.exp(-np.arange(SAMPLES) / 2000), "x settles by -"),
    "louder": (lambda r: white(r) * np.where(np.arange(SAMPLES) > 15_000, 1.5, 1.0), "the level of x changes"),
    "resonance": (
        lambda r: white(r) + 0.15 * np.convolve(r.standard_normal(SAMPLES), _ringing(), "same"), "x has "
    ),
}  # fmt: skip


def _ringing() -> Array:
    """The answer to a blow: a resonance near 0.32 Hz."""
    k = np.arange(300)
    return np.sin(0.2 * k) * np.exp(-k / 60)


def room(random: Random, n: int = SAMPLES) -> Array:
    """Temperature of a room in C, read to a hundredth: a heater that goes on and off, and a door."""
    air, on, wall = np.empty(n), False, 21.0
    now = 21.5
    doors = random.random(n) < 3e-4
    for k in range(n):
        on = now < 21.2 or (on and now < 22.0)
        now += (wall - now) / 2000 + 0.0012 * on - 0.6 * doors[k] + 0.003 * random.standard_normal()
        air[k] = now
    return np.round(air, 2)


def lagged(values: Array, steps: float) -> Array:
    """What warms up behind something else."""
    out, now = np.empty(len(values)), float(values[0])
    for k, value in enumerate(values.tolist()):
        now += (value - now) / steps
        out[k] = now
    return out


Logged = Callable[[Random], tuple[Array, Array]]
FOLLOWING: Mapping[str, tuple[Logged, float | None]] = {  # (samples, a logged temperature), and the slope over it
    "follows": (lambda r: _beside(r, lambda c, n: n + 0.5 * c), 0.5),
    "follows behind": (lambda r: _beside(r, lambda c, n: n - 0.8 * lagged(c, 600)), -0.8),
    "follows beside flicker": (
        lambda r: _beside(r, lambda c, n: n + 0.3 * traps(r) + 1.0 * c), 1.0
    ),
    "wanders by itself": (lambda r: _beside(r, lambda c, n: n + 0.005 * walk(r)), None),
    "flickers by itself": (lambda r: _beside(r, lambda c, n: n + 0.4 * traps(r)), None),
    "white by itself": (lambda r: _beside(r, lambda c, n: n), None),
    "both walk": (lambda r: (white(r) + 0.01 * walk(r), 22 + 0.002 * walk(r)), None),
}  # fmt: skip


def _beside(random: Random, made: Callable[[Array, Array], Array]) -> tuple[Array, Array]:
    """(what is made of a room's temperature and of white noise, that temperature)."""
    warm = room(random)
    return made(warm, white(random)), warm
