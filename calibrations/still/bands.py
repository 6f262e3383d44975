"""The spectrum of a channel as bands, without the lines that a model takes off the record.

A sinusoid is no chi-square variable: it is taken off the means by least squares, with the phase that it has there, and
off the fast spectrum as the window's shape at its frequency. Of what is faster than the means, their folded image goes
with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from calibrations.noise_analysis.bands import Bands, fast_bands, slow_bands
from calibrations.noise_analysis.lines import AROUND, Line, fast_lines, without_line
from calibrations.noise_analysis.processes import Sampling
from calibrations.noise_analysis.welch import LENGTH, WINDOW
from calibrations.still.record import Channel
from calibrations.table import Array

Lines = tuple[Line, ...]
REACH = 16  # ordinates to each side that a line has a share in
FEWEST = 3  # stretches without which there is no fast spectrum
LEAST = 0.05  # of the density around: what is left where a line was taken off


def bands(channel: Channel, lines: Iterable[Line] = ()) -> tuple[Bands, ...]:
    """Slow bands of the means, and fast ones where the record has stretches for them, less `lines`."""
    lines = tuple(lines)
    slow = slow_bands(means_without(channel, lines), channel.sampling, channel.corner_hz)
    f, density = fast_without(channel, lines)
    chosen = f > 0.5 / channel.sampling.interval_s
    if not chosen.any():
        return (slow,)
    f, density = f[chosen], density[chosen]
    fast = fast_bands(f, density, channel.segments.freedom, channel.rate_hz, channel.corner_hz)
    return (slow, fast) if len(fast.density) else (slow,)


def means_without(channel: Channel, lines: Iterable[Line]) -> Array:
    """The means (m,) less the lines, each of its amplitude and of the phase that fits best."""
    values = channel.means
    for line in lines:
        wave = _waves(len(values), line.frequency_hz * channel.sampling.interval_s)
        parts, *_ = np.linalg.lstsq(wave, values, rcond=1e-9)
        size = float(np.hypot(*parts))
        values = values - wave @ parts * (line.amplitude * kept(channel.sampling, line.frequency_hz) / size)
    return np.asarray(values - values.mean())


def _waves(n: int, turns: float) -> Array:
    """Cosine and sine at n means, `turns` to each; shape (n, 2)."""
    phase = 2 * np.pi * turns * np.arange(n)
    return np.column_stack([np.cos(phase), np.sin(phase)])


def kept(sampling: Sampling, frequency_hz: float) -> float:
    """The share of a sinusoid's amplitude that a mean over its samples keeps."""
    half = np.pi * frequency_hz / sampling.rate_hz
    return float(abs(np.sin(half * sampling.size) / (sampling.size * np.sin(half))))


def fast_without(channel: Channel, lines: Iterable[Line]) -> tuple[Array, Array]:
    """(frequencies, densities) of the ordinates that the means' bands do not reach, less the lines."""
    f, density = channel.segments.frequency_hz, channel.segments.density
    above_hz = min(0.5 / channel.sampling.interval_s, channel.corner_hz / 2)
    chosen = f > (above_hz if int(channel.segments.stretches.sum()) >= FEWEST else np.inf)
    f, density = f[chosen], density[chosen].copy()
    for line in lines:
        near = np.flatnonzero(np.abs(f - line.frequency_hz) < REACH * channel.rate_hz / LENGTH)
        if len(near):
            around = density[max(0, near[0] - AROUND) : near[-1] + AROUND]
            left = density[near] - line.amplitude**2 * _shape(f[near] - line.frequency_hz, channel.rate_hz)
            density[near] = np.maximum(left, LEAST * np.median(around))
    return f, density


def _shape(off_hz: Array, rate_hz: float) -> Array:
    """Two-sided density under the window, so far from a sinusoid of unit amplitude, 1/Hz."""
    turns = np.outer(off_hz / rate_hz, np.arange(LENGTH))
    return np.asarray(np.abs(np.exp(-2j * np.pi * turns) @ WINDOW) ** 2 / (4 * rate_hz * np.sum(WINDOW**2)))


def strongest(channel: Channel, beside: Lines, level: Callable[[Array], Array]) -> Line | float:
    """The strongest line beside those that are known, above the `level` of the means' continuous spectrum at f (k,).

    Where none stands out, the amplitude that one might have.
    """
    means = means_without(channel, beside)
    around = _around(means, channel.sampling)
    slow = without_line(means, channel.sampling, lambda f: np.maximum(level(f), around(f)), channel.corner_hz / 2)
    f, density = fast_without(channel, beside)
    fast = fast_lines(f, density, channel.segments.freedom, 0.0, channel.length_s)[1] if len(f) else []
    if isinstance(slow, float):
        return fast[0] if fast else slow
    for line in fast:  # what the means show may be the folded image of a fast line, and tells its frequency best
        if (true_hz := _unfolded(slow[1].frequency_hz, line, channel)) is not None:
            return replace(line, frequency_hz=true_hz, std_hz=slow[1].std_hz)
    return max([slow[1], *fast[:1]], key=lambda line: line.amplitude)


def _around(means: Array, sampling: Sampling) -> Callable[[Array], Array]:
    """The means' own density around a frequency, as the geometric mean of many ordinates: a hump is no line."""
    n, dt = len(means), sampling.interval_s
    window = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    power = np.abs(np.fft.rfft(means * window)) ** 2 * dt / np.sum(window**2)
    logs = uniform_filter1d(np.log(np.maximum(power, np.finfo(float).tiny)), AROUND, mode="nearest")
    return lambda f: np.asarray(np.exp(logs[np.round(f * n * dt).astype(int)] + np.euler_gamma))


def _unfolded(seen_hz: float, line: Line, channel: Channel) -> float | None:
    """The frequency that a line of the means really has, where it may be the folded image of this fast one."""
    rate_hz = 1 / channel.sampling.interval_s
    turns = np.round(line.frequency_hz / rate_hz)
    images = np.array([turns * rate_hz + side * seen_hz + k * rate_hz for side in (-1, 1) for k in (-1, 0, 1)])
    best = float(images[np.argmin(np.abs(images - line.frequency_hz))])
    return best if abs(best - line.frequency_hz) < channel.rate_hz / LENGTH else None
