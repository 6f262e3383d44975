"""The two generators that the tests use, at given strengths: the simulated world, and sweeps made sample by sample."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from calibrations.means.noise import white_std
from calibrations.table import Table
from tests.benchmark.discovery.cases import Truth
from tests.benchmark.discovery.layouts import Array
from tests.hidden import rigs, sampled
from tests.hidden.defects import DEFECTS, UNEXPLAINED
from tests.hidden.test_hidden_defects import NAMES, STRUCTURES, table

WORLD = tuple(NAMES)
WORLD_OUTSIDE = tuple(UNEXPLAINED)
WORDS = {
    **STRUCTURES,
    "rocking mount": "beta",
    "popping lid": "two levels|jump|telegraph|step at",
    "grain of dust": ".",
}

# effect, and the cause of a size in V or its like
SAMPLED: dict[str, tuple[str, Callable[[float], dict[str, Any]]]] = {
    "clipped": ("saturation", lambda size: {"cause": sampled.clipped(3.5 - size, 0.1 * size)}),
    "ramp": ("bias-drift", lambda size: {"cause": sampled.ramp(size)}),
    "kicks": ("bias-drift", lambda size: {"cause": sampled.kicks(size)}),
    "settling gain": ("warm-up-scale", lambda size: {"cause": sampled.settling_gain(size)}),
    "lagging stress": ("temperature-hysteresis", lambda size: {"cause": sampled.lagging_stress(size)}),
    "threshold": ("dead-zone", lambda size: {"cause": sampled.threshold(size)}),
}


def case(kind: str, name: str, strength: float, seed: int) -> tuple[Table, Truth]:
    """The table and truth of one set."""
    return _world(name, strength, seed) if kind == "world" else _sampled(name, strength, seed)


def _world(name: str, strength: float, seed: int) -> tuple[Table, Truth]:
    floor = rigs.noise_floor_v()
    if name == "clean":
        config = rigs.IDEAL
    else:
        config = rigs.scaled((DEFECTS | UNEXPLAINED)[name], rigs.IDEAL, seed, strength * floor)
    clean, ideal = (rigs.swept(c, seed, noise_free=True) for c in (config, rigs.IDEAL))
    outside = name in UNEXPLAINED
    causes = () if outside or name == "clean" else (frozenset(NAMES[name]),)
    v = np.column_stack([clean["vx_v"], clean["vy_v"]])
    part = v - np.column_stack([ideal["vx_v"], ideal["vy_v"]])
    structure = WORDS.get(name, "") if outside else ""
    truth = Truth(causes, floor, clean_v=v, parts=(part,), outside=outside, structure=structure, layout="seven")
    return table(rigs.swept(config, seed)), truth


def _sampled(name: str, strength: float, seed: int) -> tuple[Table, Truth]:
    noisy = sampled.measured(seed)
    white = white_std(noisy)
    assert white is not None
    floor = float(np.sqrt(np.mean(white**2)))
    if name == "clean":
        return noisy, Truth((), floor, clean_v=_clean(seed, {}), layout="seven")
    effect, settings = SAMPLED[name]
    clean, ideal = _sized(settings, seed, strength * floor)
    found = settings(clean[0])
    truth = Truth((frozenset({effect}),), floor, clean_v=clean[1], parts=(clean[1] - ideal,), layout="seven")
    return sampled.measured(seed, **found), truth


def _sized(settings: Callable[[float], dict[str, Any]], seed: int, target: float) -> tuple[tuple[float, Array], Array]:
    """(size, output without noise) where the base model's error is `target`, and the output without the cause."""
    ideal, low, high = _clean(seed, {}), np.log(1e-7), np.log(0.5)
    a = sampled.sweep().a
    while True:
        size = float(np.exp((low + high) / 2))
        clean = _clean(seed, settings(size))
        rest = [_off_line(a[:, c], clean[:, c] - ideal[:, c]) for c in range(2)]
        ratio = float(np.sqrt(np.mean(np.square(rest)))) / target
        if abs(ratio - 1) < 0.02 or high - low < 1e-3:
            return (size, clean), ideal
        low, high = (np.log(size), high) if ratio < 1 else (low, np.log(size))


def _clean(seed: int, settings: dict[str, Any]) -> Array:
    """The same set without noise."""
    return sampled.measured(seed, **settings, noise_v=0.0).outputs


def _off_line(load: Array, change: Array) -> Array:
    line = np.column_stack([np.ones_like(load), load])
    return np.asarray(change - line @ np.linalg.lstsq(line, change, rcond=None)[0])
