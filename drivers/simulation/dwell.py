"""The mean of a dwell as a table holds it, with the noise that a mean of samples has.

The slow processes were run tick by tick; the fast noise of the samples is replaced by one number with
the distribution that the mean of the filtered, converted and rounded samples has.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.simulation import floor, pickup
from drivers.simulation.config import WorldConfig
from drivers.simulation.converter import Converter, bowed_mean_v
from drivers.simulation.floor import Floor
from drivers.simulation.kernel import Floats
from drivers.simulation.noise import Noise, filter_s
from drivers.simulation.relaxation import mean_variance
from drivers.simulation.visit import SUPPLY, THERMOCOUPLE, Timing


def columns(
    means: Floats, middle_s: Floats, config: WorldConfig, timing: Timing, random: Any
) -> dict[str, NDArray[Any]]:
    """The measured columns of a table of poses; `random` is a generator, or None for no noise."""
    converter, supply = config.converter, means[:, SUPPLY]
    vx, vx_std = volts(means[:, 0:THERMOCOUPLE:2], middle_s, config.noise.x, config.floor, converter, timing, random)
    vy, vy_std = volts(means[:, 1:THERMOCOUPLE:2], middle_s, config.noise.y, config.floor, converter, timing, random)
    if random is not None:
        std = math.sqrt(_converter_variance(converter) / timing.samples)
        supply = supply + std * random.standard_normal(len(means))
    return {
        "vx_v": vx,
        "vy_v": vy,
        "vx_std_v": vx_std,
        "vy_std_v": vy_std,
        "temperature_c": means[:, THERMOCOUPLE],
        "supply_v": supply,
        "n": np.full(len(means), timing.samples),
    }


def volts(
    means: Floats, middle_s: Floats, own: Noise, shaking: Floor, converter: Converter, timing: Timing, random: Any
) -> tuple[Floats, Floats]:
    """Mean and sample standard deviation of one output over each dwell; without noise if `random` is None.

    `means` are those of `visit` that belong to the output, shape (n, 4).
    """
    still, slow, square, shaken = means.T
    if random is None:
        return bowed_mean_v(converter, still, 0.0), np.zeros(len(means))
    sinusoids_v, sinusoids_variance = sinusoids(shaken, middle_s, own, shaking, timing)
    variance = sample_variance(own, converter, timing) + np.maximum(square - slow**2, 0.0) + sinusoids_variance
    mean_std, relative = spreads(own, converter, timing)
    mean = still + slow + sinusoids_v + mean_std * random.standard_normal(len(means))
    std = np.sqrt(np.maximum(variance - mean_std**2, 0.0)) * (1 + relative * random.standard_normal(len(means)))
    return bowed_mean_v(converter, mean, variance), np.abs(std)


def sinusoids(shaken_v: Floats, middle_s: Floats, own: Noise, shaking: Floor, timing: Timing) -> tuple[Floats, Floats]:
    """Mean and variance of the hum, and of the floor's shaking of amplitude `shaken_v`, over each dwell."""
    samples = middle_s, timing.interval_s, timing.samples
    floors = shaking.shaking_hz, floor.passed(shaking, filter_s(own))[1], *samples
    hums = own.hum_hz, 0.0, *samples
    mean = own.hum_v * pickup.sinusoid_mean(*hums) + shaken_v * pickup.sinusoid_mean(*floors)
    square = own.hum_v**2 * pickup.sinusoid_variance(*hums) + shaken_v**2 * pickup.sinusoid_variance(*floors)
    return np.asarray(mean), np.asarray(square)


def sample_variance(own: Noise, converter: Converter, timing: Timing) -> float:
    """Variance of single samples in V^2: filtered noise, converter, rounding to codes, what is picked up at random."""
    return own.white_v**2 + _converter_variance(converter) + pickup.random_variance(own, timing.interval_s)


def _converter_variance(converter: Converter) -> float:
    return converter.noise_v**2 + converter.step_v**2 / 12


def spreads(own: Noise, converter: Converter, timing: Timing) -> tuple[float, float]:
    """Standard deviation of a dwell's mean in V; relative one of a dwell's sample standard deviation.

    Neighbouring samples behind the filter correlate by rho: n (1 - rho^2) / (1 + rho^2) of n are independent for the
    spread.
    """
    n, interval_s = timing.samples, timing.interval_s
    rho = math.exp(-interval_s / filter_s(own))
    white = mean_variance(own.white_v, filter_s(own), interval_s, n)
    picked_up = pickup.random_mean_variance(own, interval_s, n)
    mean_std = math.sqrt(white + _converter_variance(converter) / n + picked_up)
    return mean_std, math.sqrt((1 + rho**2) / (1 - rho**2) / (2 * n))
