"""Causes in two physical forms each, and mechanisms that no catalogue holds.

A cause changes one stage of the chain. `s` is its size; the same `s` acts on both axes, weighted by `both`.

    angles     (alpha, beta) -> (alpha, beta), rad
    frame      force (n, 3) -> force (n, 3), g
    response   response (n, 2), g; also sees the force
    volts      output (n, 2), V
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import norm

from tests.benchmark.foreign.bench import Array, Bench

QUANTILES = norm.ppf((np.arange(200) + 0.5) / 200)  # equally likely values of normal noise

OTHER = [1, 0]


@dataclass(frozen=True)
class Cause:
    """A mechanism: its catalogue name ("" if it has none), its stage and its law."""

    name: str
    stage: str
    law: Callable[..., Any]


@dataclass(frozen=True)
class Scene:
    """What a law may look at: the bench, the force (n, 3), constants of this sensor, weights of the axes (2,)."""

    bench: Bench
    force: Array
    constants: Array  # (8,), uniform in 0..1
    both: Array
    way: Array  # force along x and y at the stops on the way to each pose, (n, stops, 2)


def _rotation(x: float, y: float, z: float) -> Array:
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = float(np.linalg.norm([x, y, z])) or 1e-12
    return np.asarray(np.eye(3) + np.sin(angle) / angle * skew + (1 - np.cos(angle)) / angle**2 * skew @ skew)


def _own(law: Callable[[Array, Array, Scene], Array]) -> Callable[[Array, float, Scene], Array]:
    """A law of the own axis: law(u, s of each axis, scene)."""
    return lambda u, s, scene: u + law(u, s * scene.both, scene)


def _across(law: Callable[[Array, Scene], Array]) -> Callable[[Array, float, Scene], Array]:
    """A bias over the other axis."""
    return lambda u, s, scene: u + s * scene.both * law(scene.force[:, OTHER], scene)


def _over_z(law: Callable[[Array, Scene], Array]) -> Callable[[Array, float, Scene], Array]:
    return lambda u, s, scene: u + s * scene.both * law(scene.force[:, 2:], scene)


def _gain(law: Callable[[Scene], Array]) -> Callable[[Array, float, Scene], Array]:
    """A change of the scale factor."""
    return lambda u, s, scene: u * (1 + s * scene.both * law(scene))


def _bias(law: Callable[[Scene], Array]) -> Callable[[Array, float, Scene], Array]:
    return lambda u, s, scene: u + s * scene.both * law(scene)


def _column(x: Array) -> Array:
    return x[:, None]


def _heated(scene: Scene) -> Array:
    T = scene.bench.die_c - scene.bench.die_c.mean()
    return _column(T + 0.015 * T**2)


def _arrhenius(scene: Scene) -> Array:
    return _column(np.expm1((scene.bench.die_c - 22.0) / 12.0))


def _one_exponential(scene: Scene) -> Array:
    return _column(np.exp(-scene.bench.age / (0.05 + 0.4 * scene.constants[0])))


def _two_exponentials(scene: Scene) -> Array:
    fast, slow = 0.03 + 0.05 * scene.constants[0], 0.3 + 0.3 * scene.constants[1]
    return _column(0.6 * np.exp(-scene.bench.age / fast) + 0.4 * np.exp(-scene.bench.age / slow))


def _relays(u: Array, s: Array, scene: Scene) -> Array:
    """A few hundred relays of many thresholds and widths (Preisach)."""
    x, seed = scene.way, int(1e6 * scene.constants[2])
    random = np.random.default_rng(seed)
    centre, half = random.normal(0, 0.5, 200), np.abs(random.normal(0.05, 0.2, 200))
    out = np.empty((len(u), 2))
    for k in range(2):
        state = np.where(x[0, 0, k] > centre, 1.0, -1.0)
        for i, stops in enumerate(x[:, :, k]):
            for g in stops:
                state = np.where(g > centre + half, 1.0, np.where(g < centre - half, -1.0, state))
            out[i, k] = state.mean()
    return s * out


def _dahl(u: Array, s: Array, scene: Scene) -> Array:
    """Friction that approaches its limit after some way (Dahl)."""
    width = 0.05 + 0.3 * scene.constants[3]
    out, z = np.empty((len(u), 2)), np.zeros(2)
    before = scene.way[0, 0]
    for i, stops in enumerate(scene.way):
        for g in stops:
            d, before = g - before, g
            side = np.sign(d)
            z = side + (z - side) * np.exp(-np.abs(d) / width)
        out[i] = z
    return s * out


def _play(angles: tuple[Array, Array], s: float, scene: Scene) -> tuple[Array, Array]:
    """A gear whose teeth have play: the table follows the last move, on the hysteresis of the gear alone."""
    alpha, beta = angles
    table = np.empty_like(beta)
    at = beta[0]
    for i, b in enumerate(beta):
        at = min(max(at, b - s), b + s)
        table[i] = at
    return alpha, table


def _springy(angles: tuple[Array, Array], s: float, scene: Scene) -> tuple[Array, Array]:
    """A drive that winds up by its friction, a little more where the load is high."""
    alpha, beta = angles
    return alpha, beta - s * scene.bench.direction * (1 + 0.1 * np.cos(beta))


def _stopped(u: Array, s: Array, scene: Scene) -> Array:
    """A stop that takes up half of what goes beyond."""
    return np.asarray(-np.maximum(np.abs(u) - (0.97 - np.abs(s)), 0) * np.sign(u) / 2)


def _supply(scene: Scene) -> Array:
    return _column(scene.bench.supply_v / 5.0 - 1)


def rounded(v: Array, s: float, scene: Scene) -> tuple[Array, Array]:
    """Mean and standard deviation of samples with noise and vibration, each rounded to a multiple of `s`, (n, 2)."""
    step, noise = max(abs(s), 1e-9), scene.bench.sample_noise_v[:, None, None]
    samples = step * np.round((v[:, :, None] + noise * QUANTILES) / step)
    return samples.mean(axis=2), samples.std(axis=2)


CATALOGUE = (
    Cause("cross-axis-bias", "response", _across(lambda c, _: 1 - np.sqrt(1 - 0.5 * c**2))),
    Cause("cross-axis-bias", "response", _across(lambda c, _: np.abs(c) ** 2.4)),
    Cause("z-axis-bias", "response", _over_z(lambda z, _: np.sqrt(1 + 1.5 * z**2))),
    Cause("z-axis-bias", "response", _over_z(lambda z, _: z**2 + 0.25 * z**4)),
    Cause("z-axis-scale", "response", _gain(lambda s: s.force[:, 2:] ** 2 + 0.3 * s.force[:, 2:])),
    Cause("z-axis-scale", "response", _gain(lambda s: np.expm1(0.8 * s.force[:, 2:]))),
    Cause("axis-misalignment", "frame", lambda a, s, sc: a @ _rotation(*(s * (sc.constants[:3] - 0.5))).T),
    Cause("axis-misalignment", "frame", lambda a, s, sc: a @ _rotation(0.3 * s, -s, 0.5 * s).T),
    Cause(
        "axis-nonorthogonality",
        "frame",
        lambda a, s, _: np.column_stack([a[:, 0], a[:, 1] * np.cos(s) + a[:, 0] * np.sin(s), a[:, 2]]),
    ),
    Cause("quadratic-nonlinearity", "response", _own(lambda u, s, _: s * u**2 / (1 - 0.12 * u))),
    Cause("quadratic-nonlinearity", "response", _own(lambda u, s, _: s * (np.cosh(1.1 * u) - 1))),
    Cause("cubic-nonlinearity", "response", _own(lambda u, s, _: s * (u - np.sin(1.4 * u) / 1.4))),
    Cause("cubic-nonlinearity", "response", _own(lambda u, s, _: s * (np.sinh(1.2 * u) - 1.2 * u))),
    Cause("scale-factor-asymmetry", "response", _own(lambda u, s, _: s * np.hypot(u, 0.04))),
    Cause("scale-factor-asymmetry", "response", _own(lambda u, s, c: s * np.maximum(u - 0.02 * c.constants[4], 0))),
    Cause("dead-zone", "response", _own(lambda u, s, _: -np.abs(s) * np.tanh(u / np.maximum(np.abs(s), 1e-6)))),
    Cause(
        "dead-zone",
        "response",
        _own(lambda u, s, _: -np.mean([np.clip(u, -w * np.abs(s), w * np.abs(s)) for w in (0.4, 0.8, 1.2, 1.6)], 0)),
    ),
    Cause("saturation", "response", _own(_stopped)),
    Cause("saturation", "response", _own(lambda u, s, _: -0.08 * np.abs(s) * np.logaddexp(0, (u - 0.8) / 0.08))),
    Cause("hysteresis", "response", _own(_relays)),
    Cause("hysteresis", "response", _own(_dahl)),
    Cause("temperature-bias", "response", _bias(_heated)),
    Cause("temperature-bias", "response", _bias(_arrhenius)),
    Cause("temperature-scale", "response", _gain(_heated)),
    Cause("temperature-scale", "response", _gain(_arrhenius)),
    Cause("warm-up-bias", "response", _bias(_one_exponential)),
    Cause("warm-up-bias", "response", _bias(_two_exponentials)),
    Cause("warm-up-scale", "response", _gain(_one_exponential)),
    Cause("warm-up-scale", "response", _gain(_two_exponentials)),
    Cause("bias-drift", "response", _bias(lambda s: _column(s.bench.age**1.15))),
    Cause("bias-drift", "response", _bias(lambda s: _column(s.bench.age + 0.1 * s.bench.age**2))),
    Cause("supply-sensitivity", "volts", lambda v, s, scene: v * (1 + s * scene.both * _supply(scene))),
    Cause("supply-sensitivity", "volts", lambda v, s, scene: v + s * (0.8 * v + 0.4) * _supply(scene)),
    Cause("vibration-rectification", "response", _bias(lambda s: _column(s.bench.vibration**2))),
    Cause("vibration-rectification", "response", _bias(lambda s: _column(s.bench.vibration**1.8))),
    Cause("stage-zero-offset", "angles", lambda x, s, c: (x[0] + s * (0.5 + c.constants[0] / 2), x[1] - 0.7 * s)),
    Cause("base-tilt", "tilt", lambda a, s, c: a @ _rotation(s * c.constants[0], s * (1 - c.constants[1] / 2), 0.0).T),
    Cause("stage-eccentricity", "angles", lambda x, s, c: (x[0], x[1] + np.arctan(s * np.sin(x[1] - c.constants[5])))),
    Cause(
        "stage-eccentricity",
        "angles",
        lambda x, s, c: (x[0], x[1] + s * np.sin(x[1] - 6 * c.constants[5]) + 0.1 * s * np.sin(2 * x[1] + 1)),
    ),
    Cause("stage-backlash", "angles", _play),
    Cause("stage-backlash", "angles", _springy),
    Cause("adc-nonlinearity", "volts", lambda v, s, _: v + s * np.sin(np.pi * (v - 1.2) / 2.8)),
    Cause("adc-nonlinearity", "volts", lambda v, s, _: v + s * ((v - 2.5) ** 2 + 0.6 * (v - 2.5) ** 3)),
    Cause("quantisation", "volts", lambda v, s, scene: rounded(v, s, scene)[0]),
)  # fmt: skip


def _jump(scene: Scene) -> Array:
    return _column(np.where(scene.bench.age > 0.3 + 0.4 * scene.constants[0], 1.0, 0.0))


UNKNOWN = (
    Cause("", "response", _own(lambda u, s, _: s * np.sin(8 * u))),
    Cause("", "response", _bias(lambda s: s.force[:, :1] * s.force[:, 1:2] * s.force[:, 2:])),
    Cause("", "response", _bias(_jump)),
    Cause("", "response", _bias(lambda s: _column(np.sin(2 * np.pi * s.bench.t / 1700.0)))),
    Cause("", "angles", lambda x, s, _: (x[0], x[1] + s * np.cos(3 * x[1] + 0.4))),
    Cause("", "response", _gain(lambda s: _column(np.sin(2 * np.pi * 2.3 * s.bench.age)))),
    Cause("", "response", _bias(lambda s: _column(np.gradient(s.bench.die_c, s.bench.t) * 500))),
    Cause("", "response", _own(lambda u, s, _: s * np.exp(-(((u - 0.4) / 0.12) ** 2)))),
)
