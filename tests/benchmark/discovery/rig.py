"""A rig of its own: where the stages stand and when, heat, supply, and a sensor in whose way mechanisms stand.

    stage -> body -> transducer -> volts

A mechanism changes what passes at one of these places. Written anew out of the geometry of Ang's paper; nothing is
imported from the catalogue of effects, nor from the simulated world.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from zlib import crc32

import numpy as np

from tests.benchmark.discovery.layouts import USUAL, Array, visits

STOPS = 24  # on the way of one stage from pose to pose
ARRIVAL_S, DEG_S = 1.0, 20.0  # settling, and speed of the stages


@dataclass(frozen=True)
class Stand:
    """True stage angles, rad, and the true vertical."""

    alpha: Array
    beta: Array
    up: Array


def gravity(s: Stand) -> Array:
    """Specific force in the sensor, g, shape (n, 3)."""
    x = np.cos(s.alpha) * s.up[0] + np.sin(s.alpha) * s.up[2]
    y = np.full_like(s.alpha, s.up[1])
    z = np.cos(s.alpha) * s.up[2] - np.sin(s.alpha) * s.up[0]
    c, n = np.cos(s.beta), np.sin(s.beta)
    return np.column_stack([c * x - n * y, n * x + c * y, z])


@dataclass(frozen=True)
class Run:
    """One record on one rig; everything follows from layout and seed."""

    layout: str
    seed: int
    cold: bool = False  # the sensor was powered at the beginning
    room: str = "breathing"  # or "rising", or "settling"

    def draw(self, what: str) -> np.random.Generator:
        """Random numbers of one purpose, always the same."""
        return np.random.default_rng([self.seed, crc32(what.encode())])

    @cached_property
    def visits(self) -> Any:
        return visits(self.layout, self.draw("layout"))

    @cached_property
    def stand(self) -> Stand:
        v = self.visits
        return Stand(np.radians(v.alpha_deg), np.radians(v.beta_deg), np.array([0.0, 0.0, 1.0]))

    @cached_property
    def dwell_s(self) -> float:
        return float(self.draw("dwell").choice([2.0, 5.0, 8.0]))

    @cached_property
    def t_s(self) -> Array:
        v = self.visits
        moved = np.abs(np.diff(v.alpha_deg, prepend=0.0)) + np.abs(np.diff(v.beta_deg, prepend=0.0))
        begin = 20.0 if self.cold else self.draw("begin").uniform(5e3, 5e4)
        return begin + np.cumsum(moved / DEG_S + ARRIVAL_S + self.dwell_s)

    @property
    def since_s(self) -> Array:
        """Time since the record's beginning."""
        return self.t_s - self.t_s[0]

    @cached_property
    def u(self) -> Array:
        """Time from 0 to 1 along the record."""
        return self.since_s / self.since_s[-1]

    @cached_property
    def temperature_c(self) -> Array:
        """Of the die: the room breathes one to three times in a record, and drifts a little; or it only rises."""
        r = self.draw("room")
        if self.room == "rising":
            return r.uniform(20, 27) + r.uniform(1, 3) * self.u
        if self.room == "settling":
            return r.uniform(25, 30) - r.uniform(2, 5) * np.exp(-self.u / r.uniform(0.15, 0.4))
        waves = r.uniform(1, 2.5) * np.sin(2 * np.pi * (r.uniform(1.2, 3.2) * self.u + r.random()))
        return r.uniform(20, 27) + waves + r.uniform(-0.8, 0.8) * self.u + 0.3 * np.sin(2 * np.pi * 5.3 * self.u)

    @cached_property
    def supply_v(self) -> Array:
        """A laboratory supply whose load changes, with steps of its regulator."""
        r = self.draw("supply")
        wave = np.sin(2 * np.pi * (r.uniform(1.5, 6) * self.u + r.random()))
        return 5.0 + 8e-3 * wave + 4e-3 * np.sign(np.sin(2 * np.pi * (r.uniform(3, 9) * self.u + r.random())))

    @cached_property
    def way(self) -> Array:
        """Specific force on the way to each pose, shape (n, 2 STOPS, 3): alpha moves first, then beta."""
        s, part = self.stand, np.linspace(0, 1, STOPS + 1)[1:]
        alpha0, beta0 = np.append(0.0, s.alpha[:-1])[:, None], np.append(0.0, s.beta[:-1])[:, None]
        first = alpha0 + part * (s.alpha[:, None] - alpha0), np.repeat(beta0, STOPS, axis=1)
        then = np.repeat(s.alpha[:, None], STOPS, axis=1), beta0 + part * (s.beta[:, None] - beta0)
        alpha, beta = (np.hstack(both) for both in zip(first, then, strict=True))
        return gravity(Stand(alpha.ravel(), beta.ravel(), s.up)).reshape(*alpha.shape, 3)

    @cached_property
    def noise_of_sample_v(self) -> float:
        return float(10 ** self.draw("noise").uniform(-3.7, -2.9))

    @cached_property
    def sampling(self) -> tuple[float, float, int]:
        """Rate and filter corner, Hz, and samples of a dwell."""
        rate_hz = float(self.draw("rate").choice([200.0, 500.0, 1000.0]))
        return rate_hz, float(self.draw("corner").choice([10.0, 15.07, 25.0])), int(rate_hz * self.dwell_s)

    @cached_property
    def floor_v(self) -> float:
        """Standard deviation of a dwell's mean: samples behind a first-order filter are correlated."""
        rate_hz, corner_hz, n = self.sampling
        kept = np.exp(-2 * np.pi * corner_hz / rate_hz)
        return self.noise_of_sample_v * float(np.sqrt((1 + kept) / (1 - kept) / n))


class NotShown(Exception):
    """A mechanism that a record does not show at the size asked for."""


Change = Callable[[Any, "Run", Array], Any]  # what passes, the run, the mechanism's size per axis (stages: the first)


@dataclass(frozen=True)
class Mechanism:
    """Something that stands in the signal's way at one `place`, and the names that describe it, any of them."""

    place: str
    change: Change
    names: frozenset[str]
    cold: bool = False
    supply: bool = False
    structure: str = ""  # a regular expression: how a residual of this kind should be described


@dataclass(frozen=True)
class Built:
    """A mechanism of one size."""

    mechanism: Mechanism
    size: Array


def shares(run: Run, name: str) -> Array:
    """No two axes are alike."""
    r = run.draw("share of " + name)
    return np.array([1.0, r.uniform(0.6, 1.4) * r.choice([-1, 1])])


def volts(run: Run, built: Sequence[Built]) -> Array:
    """Noise-free output of both axes at every visit, V, shape (n, 2)."""

    def passed(place: str, what: Any) -> Any:
        for b in built:
            if b.mechanism.place == place:
                what = b.mechanism.change(what, run, b.size)
        return what

    a = passed("body", gravity(passed("stage", run.stand)))
    _, g = passed("transducer", (a, a[:, :2]))
    r = run.draw("sensor")
    return np.asarray(passed("volts", r.normal(2.5, 0.03, 2) + r.normal(1.0, 0.02, 2) * g))


def unabsorbed(run: Run, change: Array, others: Sequence[Array] = ()) -> Array:
    """What neither bias nor scale factor takes up of a change of the output, shape (n, 2)."""
    a = gravity(run.stand)
    rest = np.empty_like(change)
    for c in range(2):
        base = np.column_stack([np.ones(len(a)), a[:, c], *(o[:, c] for o in others)])
        rest[:, c] = change[:, c] - base @ np.linalg.lstsq(base, change[:, c], rcond=1e-12)[0]
    return rest


def sized(run: Run, name: str, mechanism: Mechanism, target_v: float) -> Built:
    """The mechanism at the size at which base model's error is `target_v` rms. Raises NotShown where none is."""
    clean, share = volts(run, ()), shares(run, name)

    def log_ratio(log_size: float) -> float:
        change = volts(run, (Built(mechanism, np.exp(log_size) * share),)) - clean
        rest = unabsorbed(run, change)[run.visits.given]
        return float(np.log(np.sqrt(np.mean(rest**2)) / target_v + 1e-30))

    low, high = np.log(1e-9), np.log(3.0)
    for _ in range(60):
        middle = (low + high) / 2
        ratio = log_ratio(middle)
        if abs(ratio) < 0.01:
            return Built(mechanism, np.exp(middle) * share)
        low, high = (middle, high) if ratio < 0 else (low, middle)
    raise NotShown(f"{name}: no size gives {target_v:g} V on layout {run.layout}, seed {run.seed}")


def layout_of(seed: int) -> str:
    """Layouts in turn."""
    return USUAL[seed % len(USUAL)]
