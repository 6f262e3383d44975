"""The spectrum of one channel as bands, and its spectral lines: sinusoids that exceed the noise around them.

A line counts if noise alone, over all frequencies of the record, has one as high in one record of a thousand.

A sinusoid is not chi-squared distributed, so it is removed before the fit: from the means by least squares, with its
phase in this record; from the fast spectrum as the shape of the window at its frequency. The folded image of a fast
line is removed from the means with it.

Source  Rife and Boorstyn, IEEE Trans. Inf. Theory 20 (1974): frequency and amplitude of a tone, and their variances.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc

from calibrations.criteria import FALSE_LINE, FEWEST_FAST_STRETCHES, FEWEST_PERIODS, MOST_FAST_LINES
from calibrations.noise.record import Channel
from calibrations.spectrum import LENGTH, WINDOW, Bands, Sampling, fast_bands, slow_bands
from calibrations.table import Array

LOBE = 3  # ordinates on each side that a line reaches under the window
AROUND = 65  # ordinates that give the noise around a line
CENTROID = 0.02  # ordinates by which the middle of a line may be off
WINDOW_LOSS = 1.5  # of variance, by the window


@dataclass(frozen=True)
class SpectralLine:
    """A sinusoid: Hz, and the values' unit; `std` and `std_hz` are standard uncertainties."""

    frequency_hz: float
    amplitude: float
    std: float
    std_hz: float = 0.0


@lru_cache(maxsize=2)
def _window(n: int) -> Array:
    """Hann's, shape (n,)."""
    return np.asarray(np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2)


def windowed_density(means: Array, sampling: Sampling) -> Array:
    """Two-sided density of means (n,) under Hann's window, at whole numbers of periods in the record."""
    window = _window(len(means))
    spectrum = np.fft.rfft(means * window)
    return np.asarray((spectrum.real**2 + spectrum.imag**2) * (sampling.interval_s / np.sum(window**2)))


def without_line(
    means: Array, power: Array, sampling: Sampling, expected: Callable[[Array], Array], highest_hz: float
) -> tuple[Array, SpectralLine] | float:
    """Remove the strongest sinusoid from means (n,): (the rest, the sinusoid). `power`: their windowed density.

    If no sinusoid exceeds the noise, returns only the amplitude that one might have.
    """
    n, dt, window = len(means), sampling.interval_s, _window(len(means))
    last = min(len(power) - 1, int(min(highest_hz, 1 / dt) * n * dt))
    if last <= FEWEST_PERIODS:
        return float(np.sqrt(2 * np.mean(means**2)))
    f = np.arange(FEWEST_PERIODS, last) / (n * dt)
    noise = expected(f)
    height = power[FEWEST_PERIODS:last] / noise
    best = int(np.argmax(height))
    if len(f) * np.exp(-height[best]) > FALSE_LINE:
        return float(np.sqrt(power[FEWEST_PERIODS:last].max() * 4 / (n * dt)) * 1.5)
    turns = _peak(means * window, best + FEWEST_PERIODS)
    wave = np.exp(-2j * np.pi * turns / n * np.arange(n))
    tone = 2 * np.sum(means * window * wave) / window.sum()
    response = abs(np.sin(np.pi * turns / n) / (sampling.size * np.sin(np.pi * turns / n / sampling.size)))
    std = np.sqrt(2 * WINDOW_LOSS * noise[best] / (n * dt)) / response
    std_hz = np.sqrt(12) / (2 * np.pi * n * dt) * std * response / abs(tone)
    line = SpectralLine(turns / (n * dt), float(abs(tone)) / response, float(std), float(std_hz))
    return means - (tone * wave.conj()).real, line


def _peak(windowed: Array, start: int) -> float:
    """Periods of the tone in the record, to a small part of one."""
    times = np.arange(len(windowed)) / len(windowed)

    def negative(turns: float) -> float:
        return -abs(float(np.abs(np.dot(windowed, np.exp(-2j * np.pi * turns * times)))))

    return float(minimize_scalar(negative, bounds=(start - 1, start + 1), method="bounded", options={"xatol": 1e-4}).x)


def _median_around(density: Array) -> Array:
    """The noise around each ordinate: the median of as many on its left as on its right.

    Where a spectrum only falls, or only rises, that is the ordinate's own level: behind a filter, or beside flicker,
    a window that reached further to one side would take the slope for a line. Too near an end nothing can be said.
    """
    medians = np.full(len(density), np.inf)
    most = AROUND // 2
    if len(density) >= AROUND:
        medians[most:-most] = median_filter(density, AROUND)[most:-most]
    for k in range(LOBE + 1, min(most, len(density) // 2)):
        medians[k] = np.median(density[: 2 * k + 1])
        medians[-1 - k] = np.median(density[-1 - 2 * k :])
    return medians


def fast_lines(
    f: Array, density: Array, freedom: float, above_hz: float, length_s: float
) -> tuple[Array, list[SpectralLine]]:
    """(densities (f,) with the lines taken off, the lines above a frequency, strongest first)."""
    background = _median_around(density)
    lines, remaining = [], density.copy()
    for _ in range(MOST_FAST_LINES):
        height = np.where(f > above_hz, remaining / background, 0.0)
        best = int(np.argmax(height))
        if not len(f) * chdtrc(freedom, freedom * height[best]) < FALSE_LINE:
            break
        lobe = slice(max(0, best - LOBE), best + LOBE + 1)
        excess = np.maximum(remaining[lobe] - background[lobe], 0.0)
        amplitude = float(np.sqrt(4 * (f[1] - f[0]) * excess.sum()))
        std = float(np.sqrt(2 * WINDOW_LOSS * background[best] / length_s))
        lines.append(
            SpectralLine(float(np.sum(f[lobe] * excess) / excess.sum()), amplitude, std, CENTROID * float(f[1] - f[0]))
        )
        remaining[lobe] = background[lobe]
    return remaining, sorted(lines, key=lambda line: -line.amplitude)


Lines = tuple[SpectralLine, ...]
REACH = 16  # ordinates to each side that a line has a share in
LEAST_DENSITY = 0.05  # of the density around it, where a line was removed


def bands(channel: Channel, lines: Iterable[SpectralLine] = ()) -> tuple[Bands, ...]:
    """Slow bands of the means, and fast ones where the record has stretches for them, less `lines`."""
    lines = tuple(lines)
    slow = slow_bands(means_without(channel, lines), channel.sampling, channel.corner_hz)
    f, density = fast_without(channel, lines)
    in_band = f > 0.5 / channel.sampling.interval_s
    if not in_band.any():
        return (slow,)
    f, density = f[in_band], density[in_band]
    fast = fast_bands(f, density, channel.segments.freedom, channel.rate_hz, channel.corner_hz)
    return (slow, fast) if len(fast.density) else (slow,)


def means_without(channel: Channel, lines: Iterable[SpectralLine]) -> Array:
    """The means (m,) less the lines, each of its amplitude and of the phase that fits best."""
    values = channel.means
    for line in lines:
        wave = _cosine_and_sine(len(values), line.frequency_hz * channel.sampling.interval_s)
        parts, *_ = np.linalg.lstsq(wave, values, rcond=1e-9)
        size = float(np.hypot(*parts))
        values = values - wave @ parts * (line.amplitude * mean_response(channel.sampling, line.frequency_hz) / size)
    return np.asarray(values - values.mean())


def _cosine_and_sine(n: int, turns: float) -> Array:
    """Cosine and sine at n means, `turns` to each; shape (n, 2)."""
    phase = 2 * np.pi * turns * np.arange(n)
    return np.column_stack([np.cos(phase), np.sin(phase)])


def mean_response(sampling: Sampling, frequency_hz: float) -> float:
    """The share of a sinusoid's amplitude that a mean over its samples keeps."""
    half = np.pi * frequency_hz / sampling.rate_hz
    return float(abs(np.sin(half * sampling.size) / (sampling.size * np.sin(half))))


def fast_without(channel: Channel, lines: Iterable[SpectralLine]) -> tuple[Array, Array]:
    """(frequencies, densities) of the ordinates that the means' bands do not reach, less the lines."""
    f, density = channel.segments.frequency_hz, channel.segments.density
    above_hz = min(0.5 / channel.sampling.interval_s, channel.corner_hz / 2)
    in_band = f > (above_hz if int(channel.segments.stretches.sum()) >= FEWEST_FAST_STRETCHES else np.inf)
    f, density = f[in_band], density[in_band].copy()
    for line in lines:
        chosen_lobe = np.flatnonzero(np.abs(f - line.frequency_hz) < REACH * channel.rate_hz / LENGTH)
        if len(chosen_lobe):
            neighbourhood = density[max(0, chosen_lobe[0] - AROUND) : chosen_lobe[-1] + AROUND]
            remaining = density[chosen_lobe] - line.amplitude**2 * _window_density(
                f[chosen_lobe] - line.frequency_hz, channel.rate_hz
            )
            density[chosen_lobe] = np.maximum(remaining, LEAST_DENSITY * np.median(neighbourhood))
    return f, density


def _window_density(off_hz: Array, rate_hz: float) -> Array:
    """Two-sided density under the window, so far from a sinusoid of unit amplitude, 1/Hz."""
    turns = np.outer(off_hz / rate_hz, np.arange(LENGTH))
    return np.asarray(np.abs(np.exp(-2j * np.pi * turns) @ WINDOW) ** 2 / (4 * rate_hz * np.sum(WINDOW**2)))


def strongest_line(channel: Channel, known_lines: Lines, level: Callable[[Array], Array]) -> SpectralLine | float:
    """The strongest line beside those that are known, above the `level` of the means' continuous spectrum at f (k,).

    Where none stands out, the amplitude that one might have.
    """
    means, sampling = means_without(channel, known_lines), channel.sampling
    power = windowed_density(means, sampling)
    background = _level_around(power, len(means) * sampling.interval_s)
    slow = without_line(means, power, sampling, lambda f: np.maximum(level(f), background(f)), channel.corner_hz / 2)
    f, density = fast_without(channel, known_lines)
    fast = fast_lines(f, density, channel.segments.freedom, 0.0, channel.length_s)[1] if len(f) else []
    if isinstance(slow, float):
        return fast[0] if fast else slow
    for line in fast:  # what the means show may be the folded image of a fast line, and tells its frequency best
        if (true_hz := _unfold(slow[1].frequency_hz, line, channel)) is not None:
            return replace(line, frequency_hz=true_hz, std_hz=slow[1].std_hz)
    return max([slow[1], *fast[:1]], key=lambda line: line.amplitude)


def _level_around(power: Array, length_s: float) -> Callable[[Array], Array]:
    """The density around a frequency, as the geometric mean of many ordinates: a hump is no line."""
    logs = uniform_filter1d(np.log(np.maximum(power, np.finfo(float).tiny)), AROUND, mode="nearest")
    return lambda f: np.asarray(np.exp(logs[np.round(f * length_s).astype(int)] + np.euler_gamma))


def _unfold(seen_hz: float, line: SpectralLine, channel: Channel) -> float | None:
    """The frequency that a line of the means really has, where it may be the folded image of this fast one."""
    rate_hz = 1 / channel.sampling.interval_s
    turns = np.round(line.frequency_hz / rate_hz)
    images = np.array([turns * rate_hz + side * seen_hz + k * rate_hz for side in (-1, 1) for k in (-1, 0, 1)])
    best = float(images[np.argmin(np.abs(images - line.frequency_hz))])
    return best if abs(best - line.frequency_hz) < channel.rate_hz / LENGTH else None
