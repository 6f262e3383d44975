"""Sinusoids in noise: lines of a spectrum that stand out from what is expected around them.

A line counts where noise alone, over all frequencies looked at, would have one as high once in a thousand records.

Source  Rife and Boorstyn, IEEE Trans. Inf. Theory 20 (1974): frequency and amplitude of a tone, and their variances.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from calibrations.noise_analysis.processes import Sampling
from calibrations.table import Array

FALSE = 1e-3  # chance of a line in a record that has none
LOWEST = 6  # periods in the record: slower ones cannot be told from drift
MOST = 8
LOBE = 3  # ordinates on each side that a line reaches under the window
AROUND = 65  # ordinates that tell the noise around a line
CENTROID = 0.02  # ordinates by which the middle of a line may be off
WINDOW_LOSS = 1.5  # of variance, by the window


@dataclass(frozen=True)
class Line:
    """A sinusoid: Hz, and the values' unit; `std` and `std_hz` are standard uncertainties."""

    frequency_hz: float
    amplitude: float
    std: float
    std_hz: float = 0.0


def without_line(
    means: Array, sampling: Sampling, expected: Callable[[Array], Array], highest_hz: float
) -> tuple[Array, Line] | float:
    """(means (n,) less their strongest sinusoid, the sinusoid); where none stands out, the amplitude it might have."""
    n, dt = len(means), sampling.interval_s
    window = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    power = np.abs(np.fft.rfft(means * window)) ** 2 * dt / np.sum(window**2)
    last = min(len(power) - 1, int(min(highest_hz, 1 / dt) * n * dt))
    if last <= LOWEST:
        return float(np.sqrt(2 * np.mean(means**2)))
    f = np.arange(LOWEST, last) / (n * dt)
    noise = expected(f)
    height = power[LOWEST:last] / noise
    best = int(np.argmax(height))
    if len(f) * np.exp(-height[best]) > FALSE:
        return float(np.sqrt(power[LOWEST:last].max() * 4 / (n * dt)) * 1.5)
    turns = _turns(means * window, best + LOWEST)
    wave = np.exp(-2j * np.pi * turns / n * np.arange(n))
    tone = 2 * np.sum(means * window * wave) / window.sum()
    kept = abs(np.sin(np.pi * turns / n) / (sampling.size * np.sin(np.pi * turns / n / sampling.size)))
    std = np.sqrt(2 * WINDOW_LOSS * noise[best] / (n * dt)) / kept
    std_hz = np.sqrt(12) / (2 * np.pi * n * dt) * std * kept / abs(tone)
    line = Line(turns / (n * dt), float(abs(tone)) / kept, float(std), float(std_hz))
    return means - (tone * wave.conj()).real, line


def _turns(windowed: Array, near: int) -> float:
    """Periods of the tone in the record, to a small part of one."""
    times = np.arange(len(windowed)) / len(windowed)

    def negative(turns: float) -> float:
        return -abs(float(np.abs(np.dot(windowed, np.exp(-2j * np.pi * turns * times)))))

    return float(minimize_scalar(negative, bounds=(near - 1, near + 1), method="bounded", options={"xatol": 1e-4}).x)


def _around(density: Array) -> Array:
    """The noise around each ordinate: the median of as many on its left as on its right.

    Where a spectrum only falls, or only rises, that is the ordinate's own level: behind a filter, or beside flicker,
    a window that reached further to one side would take the slope for a line. Too near an end nothing can be said.
    """
    around = np.full(len(density), np.inf)
    most = AROUND // 2
    if len(density) >= AROUND:
        around[most:-most] = median_filter(density, AROUND)[most:-most]
    for k in range(LOBE + 1, min(most, len(density) // 2)):
        around[k] = np.median(density[: 2 * k + 1])
        around[-1 - k] = np.median(density[-1 - 2 * k :])
    return around


def fast_lines(f: Array, density: Array, freedom: float, above_hz: float, length_s: float) -> tuple[Array, list[Line]]:
    """(densities (f,) with the lines taken off, the lines above a frequency, strongest first)."""
    around = _around(density)
    found, left = [], density.copy()
    for _ in range(MOST):
        height = np.where(f > above_hz, left / around, 0.0)
        best = int(np.argmax(height))
        if not len(f) * chi2.sf(freedom * height[best], freedom) < FALSE:
            break
        lobe = slice(max(0, best - LOBE), best + LOBE + 1)
        excess = np.maximum(left[lobe] - around[lobe], 0.0)
        amplitude = float(np.sqrt(4 * (f[1] - f[0]) * excess.sum()))
        std = float(np.sqrt(2 * WINDOW_LOSS * around[best] / length_s))
        found.append(
            Line(float(np.sum(f[lobe] * excess) / excess.sum()), amplitude, std, CENTROID * float(f[1] - f[0]))
        )
        left[lobe] = around[lobe]
    return left, sorted(found, key=lambda line: -line.amplitude)
