"""The saw that a fine converter leaves in the means: periodic in the output, found by the residual's spectrum over it.

A coarser converter has stairs (`stairs`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri  # scipy.stats takes 0.4 s to load

from calibrations.free_forms.chain import State
from calibrations.free_forms.components import Component, Starts, per_axis
from calibrations.free_forms.poses import PoseData
from calibrations.table import Array

SAW = "output/quantisation"  # the component that a search without stairs leaves out
SAW_POINTS = 3.0  # frequencies in a resolved interval
SAW_REJECTIONS = 1  # of one saw: its phase may belong to an output that is not right yet
LEAST_OF_SAW = 0.3  # of the first harmonic that a step of this height has
MOST_OF_SAW = 1.5  # of it: a regular grid of poses has waves over the output that are larger
SAW_VISIBLE = 2.0  # steps' frequency times the noise of a sample: beyond, nothing is left of a saw in a mean


def find_saw(
    data: PoseData, state: State, white: Array, residual: Array, rejected: Sequence[float], enter: float
) -> Component | None:
    """The significant saw of a quantiser that the residual `residual` (channels, n) shows best.

    rejected  frequencies of rejected saws; one with more than SAW_REJECTIONS is not proposed again
    """
    if {"output", SAW} & set(data.table.left_out):
        return None
    span = float(np.ptp(data.outputs)) or 1.0
    noise = float(np.median(data.spread)) if data.spread is not None else 0.0
    highest = min(SAW_VISIBLE / noise if noise > 0 else np.inf, 20_000 / SAW_POINTS / span)
    step = 1 / (SAW_POINTS * span)
    frequencies = step * np.arange(int(np.ceil(3 / span / step)), int(highest / step))
    if not len(frequencies):
        return None
    count = int(highest / step)
    weights = 1 / white**2
    channels = list(zip(state.response, residual * weights, weights, strict=True))
    powers = np.stack([_spectrum(v, r, step, count)[-len(frequencies) :] * 2 / w.sum() for v, r, w in channels])
    amplitude = np.sqrt(np.mean(2 * powers / weights.sum(axis=1, keepdims=True), axis=0))
    power = powers.sum(axis=0)
    quiet = np.sqrt(np.maximum(noise**2 - 1 / (3 * frequencies**2), 0.0))  # without the rounding's own
    is_saw = amplitude > LEAST_OF_SAW * _fundamental(frequencies, noise)  # a step has a height
    is_saw &= amplitude < MOST_OF_SAW * _fundamental(frequencies, quiet)  # and noise smooths it
    power[~is_saw] = 0.0
    for f in rejected:
        close = np.abs(frequencies - f) * span < 1.0
        if sum(abs(earlier - f) * span < 1.0 for earlier in rejected) > SAW_REJECTIONS:
            power[close] = 0.0
    best = int(np.argmax(power))
    price = _threshold(2 * np.log(len(frequencies) / SAW_POINTS) + enter, len(channels)) - enter
    if power[best] < price + enter:
        return None
    fine = frequencies[best] + np.linspace(-1, 1, 41) / (SAW_POINTS * span)
    power = np.sum([np.abs(np.exp(-2j * np.pi * np.outer(fine, v)) @ r) ** 2 / w.sum() for v, r, w in channels], axis=0)
    return sawtooth(float(fine[int(np.argmax(power))]), 3, price, 0.05 / span, data.table.axes)


def _threshold(gain: float, channels: int) -> float:
    """Of a wave's gain summed over channels, each with a phase of its own: as rare as `gain` of one wave is."""
    return float(chdtri(2 * channels, np.exp(-gain / 2)))


def _fundamental(frequencies: NDArray[np.floating], noise: Array | float) -> Array:
    """Amplitude of the first harmonic that a saw of 1 / frequency has in a mean of samples with such noise."""
    step = 1 / frequencies
    return np.asarray(step / np.pi * np.exp(-2 * (np.pi * noise / step) ** 2))


def _spectrum(positions: Array, values: Array, step: float, count: int) -> Array:
    """|sum of values exp(-2 pi i f at)|^2 at f = 0, step, .. (count,), by a fine histogram and a fast transform."""
    bins = 1 << int(np.ceil(np.log2(8 * count)))
    place = (positions - positions.min()) * step * bins
    lower = np.floor(place).astype(int)
    share = place - lower
    grid = np.bincount(lower % bins, values * (1 - share), bins) + np.bincount((lower + 1) % bins, values * share, bins)
    return np.asarray(np.abs(np.fft.rfft(grid)[:count]) ** 2)


def sawtooth(frequency: float, harmonics: int, price: float, step: float, axes: Sequence[str]) -> Component:
    """Quantisation: harmonics of a saw over each output, codes per unit of output; `step` of the frequency to try.

    Behind a converter each output has an offset of its own, and so has each saw its phase.
    """
    name = f"output/quantisation@{frequency:.6g}"

    def at(shape: tuple[float, ...]) -> Component:
        def waves(s: State, k: int) -> Array:
            turned = 2 * np.pi * shape[0] * s.response[k, :, None] * np.arange(1, harmonics + 1)
            scale = 1.0 / np.arange(1, harmonics + 1)
            return np.concatenate([np.sin(turned) * scale, np.cos(turned) * scale], axis=1)

        def starts(x: Array) -> Starts:
            first = x.reshape(len(axes), 2, harmonics)[:, :, 0]
            return tuple(
                (parameter, axis, value)
                for axis, (sine, cosine) in zip(axes, first, strict=True)
                for parameter, value in _steps(shape[0], float(sine), float(cosine))
            )

        return Component(
            name, "output", "output", "quantisation", "output/quantisation", price, per_axis(waves),
            shape=shape, step=(step,), reshaped=at, starts=starts,
        )  # fmt: skip

    return at((frequency,))


def _steps(frequency: float, sine: float, cosine: float) -> tuple[tuple[str, float], ...]:
    """Step, offset and noise of the quantiser whose saw has this first harmonic.

    The saw of rounding is -(q / pi) exp(-2 (pi s / q)^2) sin(2 pi (V - o) / q) and harmonics (Widrow and Kollar, 2008).
    """
    step = 1 / frequency
    fraction = np.clip(np.pi * np.hypot(sine, cosine) / step, 1e-6, 1.0)
    noise = step / np.pi * np.sqrt(-np.log(fraction) / 2)
    offset = step / (2 * np.pi) * np.arctan2(cosine, -sine)
    return ("step", step), ("offset", float(offset)), ("noise", float(noise))
