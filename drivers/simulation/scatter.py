"""No two rigs are alike: an individual drawn around its settings."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from drivers.simulation.config import SensingAxis, WorldConfig
from drivers.simulation.spread import Spread

# What a factory or a designer fixes: no imperfection, so no scatter.
EXACT = {"resonance_hz", "sag_resonance_hz", "charging_s", "gap_um", "zero_g_v", "sensitivity_v_per_g", "worm_cycles"}


def individual(config: WorldConfig, seed: int, place: int = 0) -> WorldConfig:
    """One rig drawn from `config.spread`, and the sensor at `place` of its table; the same seed draws the same."""
    random = np.random.default_rng([seed, 0])
    trims = random.standard_normal((2, 2))
    fraction = config.spread.imperfection_fraction
    stages, base = (_scattered(part, fraction, random) for part in (config.stages, config.base))
    if place:
        random = np.random.default_rng([seed, 0, place])
        trims = random.standard_normal((2, 2))
    sensor = _scattered(config.sensor, fraction, random)
    x, y = (_trimmed(axis, config.spread, *trim) for axis, trim in zip((sensor.x, sensor.y), trims, strict=True))
    return replace(config, stages=stages, base=base, sensor=replace(sensor, x=x, y=y))


def _trimmed(axis: SensingAxis, spread: Spread, zero: float, gain: float) -> SensingAxis:
    plates = replace(
        axis.plates,
        zero_g_v=axis.plates.zero_g_v + spread.zero_g_v * zero,
        sensitivity_v_per_g=axis.plates.sensitivity_v_per_g * (1 + spread.sensitivity_fraction * gain),
    )
    return replace(axis, plates=plates)


def _scattered(settings: Any, fraction: float, random: np.random.Generator) -> Any:
    """Every imperfection times a log-normal number; a number is drawn for absent ones too."""
    new = {}
    for f in fields(settings):
        value = getattr(settings, f.name)
        if is_dataclass(value):
            new[f.name] = _scattered(value, fraction, random)
        elif f.name not in EXACT:
            new[f.name] = value * math.exp(fraction * random.standard_normal())
    return replace(settings, **new)
