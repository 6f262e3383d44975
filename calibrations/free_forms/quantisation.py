"""The saw of a quantiser: periodic in the output, found by a spectrum of the residual over the output."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calibrations.free_forms.chain import State
from calibrations.free_forms.components import Component
from calibrations.free_forms.places_of_columns import saw
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.stairs import SAW
from calibrations.table import Array

SAW_POINTS = 3.0  # frequencies in a resolved interval
SAW_REJECTIONS = 1  # of one saw: its phase may belong to an output that is not right yet
LEAST_OF_SAW = 0.3  # of the first harmonic that a step of this height has
SAW_VISIBLE = 2.0  # steps' frequency times the noise of a sample: beyond, nothing is left of a saw in a mean


def find_saw(
    data: PoseData, state: State, white: Array, left: Array, rejected: Sequence[float], enter: float
) -> Component | None:
    """The significant saw of a quantiser that the residual `left` (channels, n) shows best.

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
    at = state.response.ravel()
    values = (left / white**2).ravel()
    weights = (1 / white**2).ravel()
    power = _spectrum(at, values, step, int(highest / step))[-len(frequencies) :] * 2 / np.sum(weights)
    amplitude = np.sqrt(2 * power / np.sum(weights))
    power[amplitude < LEAST_OF_SAW * _fundamental(frequencies, noise)] = 0.0  # no saw: a step has a height
    for f in rejected:
        close = np.abs(frequencies - f) * span < 1.0
        if sum(abs(other - f) * span < 1.0 for other in rejected) > SAW_REJECTIONS:
            power[close] = 0.0
    best = int(np.argmax(power))
    price = 2 * np.log(len(frequencies) / SAW_POINTS)
    if power[best] < price + enter:
        return None
    fine = frequencies[best] + np.linspace(-1, 1, 41) / (SAW_POINTS * span)
    power = np.abs(np.exp(-2j * np.pi * np.outer(fine, at)) @ values) ** 2
    return saw(float(fine[int(np.argmax(power))]), 3, price, 0.05 / span)


def _fundamental(frequencies: NDArray[np.floating], noise: float) -> Array:
    """Amplitude of the first harmonic that a saw of 1 / frequency has in a mean of samples with such noise."""
    step = 1 / frequencies
    return np.asarray(step / np.pi * np.exp(-2 * (np.pi * noise / step) ** 2))


def _spectrum(at: Array, values: Array, step: float, count: int) -> Array:
    """|sum of values exp(-2 pi i f at)|^2 at f = 0, step, .. (count,), by a fine histogram and a fast transform."""
    bins = 1 << int(np.ceil(np.log2(8 * count)))
    place = (at - at.min()) * step * bins
    lower = np.floor(place).astype(int)
    share = place - lower
    grid = np.bincount(lower % bins, values * (1 - share), bins) + np.bincount((lower + 1) % bins, values * share, bins)
    return np.asarray(np.abs(np.fft.rfft(grid)[:count]) ** 2)
