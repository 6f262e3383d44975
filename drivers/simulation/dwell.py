"""The mean of a dwell as a table holds it, with the noise that a mean of samples has.

The slow processes were run tick by tick; the white noise of the samples is replaced by one number with
the distribution that the mean of the filtered, converted and rounded samples has.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.simulation.converter import Converter, bowed_mean_v
from drivers.simulation.kernel import Floats
from drivers.simulation.noise import Noise, hum_mean_v
from drivers.simulation.visit import Timing


def volts(
    axis: int, means: Floats, middle_s: Floats, noise: Noise, converter: Converter, timing: Timing, random: Any
) -> tuple[Floats, Floats]:
    """Mean and sample standard deviation of one output over each dwell; without noise if `random` is None."""
    if random is None:
        return bowed_mean_v(converter, means[:, axis], 0.0), np.zeros(len(means))
    variance = sample_variance(noise, converter)
    mean_std, relative = spreads(noise, converter, timing)
    hum = hum_mean_v(noise, middle_s, timing.interval_s, timing.samples)
    mean = means[:, axis] + means[:, 2 + axis] + hum + mean_std * random.standard_normal(len(means))
    std = math.sqrt(max(0.0, variance - mean_std**2)) * (1 + relative * random.standard_normal(len(means)))
    return bowed_mean_v(converter, mean, variance), np.abs(std)


def sample_variance(noise: Noise, converter: Converter) -> float:
    """Variance of single samples in V^2: filtered noise, hum, converter, rounding to codes."""
    return noise.white_v**2 + noise.hum_v**2 / 2 + _converter_variance(converter)


def _converter_variance(converter: Converter) -> float:
    return converter.noise_v**2 + converter.step_v**2 / 12


def spreads(noise: Noise, converter: Converter, timing: Timing) -> tuple[float, float]:
    """Standard deviation of a dwell's mean in V; relative one of a dwell's sample standard deviation.

    Neighbouring samples behind the filter correlate by rho: exact sum for the mean of n of them, and
    n (1 - rho^2) / (1 + rho^2) independent ones for the spread.
    """
    n, rho = timing.samples, math.exp(-timing.interval_s / (noise.filter_ohm * noise.filter_farad))
    pairs = n * (1 + rho) / (1 - rho) - 2 * rho * (1 - rho**n) / (1 - rho) ** 2
    mean_variance = noise.white_v**2 * pairs / n**2 + _converter_variance(converter) / n
    return math.sqrt(mean_variance), math.sqrt((1 + rho**2) / (1 - rho**2) / (2 * n))


def columns(
    means: Floats, middle_s: Floats, noise: Noise, converter: Converter, timing: Timing, random: Any
) -> dict[str, NDArray[Any]]:
    """The measured columns of a table of poses; `random` is a generator, or None for no noise."""
    vx, vx_std = volts(0, means, middle_s, noise, converter, timing, random)
    vy, vy_std = volts(1, means, middle_s, noise, converter, timing, random)
    supply = means[:, 5]
    if random is not None:
        supply = supply + math.sqrt(_converter_variance(converter) / timing.samples) * random.standard_normal(
            len(means)
        )
    return {
        "vx_v": vx,
        "vy_v": vy,
        "vx_std_v": vx_std,
        "vy_std_v": vy_std,
        "temperature_c": means[:, 4],
        "supply_v": supply,
        "n": np.full(len(means), timing.samples),
    }
