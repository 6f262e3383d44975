"""Sine approximation: the sine that fits a record best, with standard uncertainties.

    x(t) = offset + amplitude cos(2 pi f t + phase)

Three parameters with the frequency given, four with the frequency fitted too: ISO 16063-11, IEEE Std 1057.
Uncertainties follow from the density of the residual beside the line, so that they hold for correlated noise as well;
for white noise they are the Cramer-Rao bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.errors import DataError
from calibrations.motion.spectrum import periodogram
from calibrations.table import Array

NEIGHBOURS = 100  # lines on each side that the density is taken from
OWN_LINES = 3  # beside the frequency, that the fitted sine has taken up
ROUNDS = 12
MOST_SINES = 8
PROMINENT = 8.0  # times log(lines) the density around it: noise alone shows no such line
LOWEST_LINE = 4  # periods in the record below which a line is drift


@dataclass(frozen=True)
class Sine:
    """A sine with standard uncertainties. `density` is the one-sided density of the residual beside it."""

    frequency_hz: float
    amplitude: float
    phase_rad: float
    offset: float
    frequency_std_hz: float
    amplitude_std: float
    phase_std_rad: float
    offset_std: float
    density: float

    def at(self, t_s: Array) -> Array:
        """The sine without its offset."""
        return np.asarray(self.amplitude * np.cos(2 * np.pi * self.frequency_hz * t_s + self.phase_rad))


def three_parameter(t_s: Array, x: Array, frequency_hz: float) -> Sine:
    """The best sine of a given frequency. Raises DataError for fewer than 8 samples."""
    return _fitted(t_s, x, frequency_hz, free=False)


def four_parameter(t_s: Array, x: Array, frequency_hz: float | None = None) -> Sine:
    """The best sine, its frequency fitted from `frequency_hz` or the strongest line on. Raises DataError."""
    return _fitted(t_s, x, strongest(t_s, x)[0] if frequency_hz is None else frequency_hz, free=True)


def sines(t_s: Array, x: Array) -> tuple[Sine, ...]:
    """The lines that stand out of a record, the most prominent first, each fitted beside the others."""
    found: list[Sine] = []
    left = x
    while len(found) < MOST_SINES:
        frequency, prominence = strongest(t_s, left)
        again = any(abs(s.frequency_hz - frequency) < 1 / np.ptp(t_s) for s in found)
        if again or prominence < PROMINENT * np.log(len(x)):
            break
        found.append(four_parameter(t_s, left, frequency))
        found = _beside_the_others(t_s, x, found)
        left = x - sum((s.at(t_s) for s in found), np.zeros(len(x)))
    return tuple(found)


def strongest(t_s: Array, x: Array) -> tuple[float, float]:
    """Frequency of the strongest line above drift, and its power over the median of its neighbours."""
    if len(x) < 8:
        raise DataError(f"{len(x)} samples are too few for a sine; it takes 8")
    f, power = periodogram(x, (len(t_s) - 1) / float(np.ptp(t_s)))
    first = min(LOWEST_LINE, len(f) - 2)
    k = first + int(np.argmax(power[first:-1]))
    around = np.median(power[max(first, k - NEIGHBOURS) : k + NEIGHBOURS]) or np.finfo(float).tiny
    low, here, high = np.log(np.maximum(power[k - 1 : k + 2], np.finfo(float).tiny))
    curvature = low - 2 * here + high
    shift = (low - high) / (2 * curvature) if curvature < 0 else 0.0
    return float(f[k] + shift * f[1]), float(power[k] / around)


def _beside_the_others(t_s: Array, x: Array, found: list[Sine]) -> list[Sine]:
    """Each line fitted anew to what the others leave; twice is enough for lines that a record resolves."""
    for _ in range(2 if len(found) > 1 else 0):
        for k, sine in enumerate(found):
            others = sum((s.at(t_s) for j, s in enumerate(found) if j != k), np.zeros(len(x)))
            found[k] = four_parameter(t_s, x - others, sine.frequency_hz)
    return found


def _fitted(t_s: Array, x: Array, frequency_hz: float, free: bool) -> Sine:
    if len(x) < 8:
        raise DataError(f"{len(x)} samples are too few for a sine; it takes 8")
    middle, rate_hz = float(t_s.mean()), (len(t_s) - 1) / float(np.ptp(t_s))
    t, turn = t_s - middle, 2 * np.pi * frequency_hz
    for _ in range(ROUNDS):
        columns = np.column_stack([np.cos(turn * t), np.sin(turn * t), np.ones(len(t))])
        a, b, offset = np.linalg.lstsq(columns, x, rcond=None)[0]
        slope = t * (b * columns[:, 0] - a * columns[:, 1])  # d x / d turn
        residual = x - columns @ (a, b, offset)
        if not free:
            break
        columns = np.column_stack([columns, slope])
        step = float(np.linalg.lstsq(columns, residual, rcond=None)[0][3])
        turn += float(np.clip(step, -1 / np.ptp(t), 1 / np.ptp(t)))
        if abs(step) * np.ptp(t) < 1e-10:
            break
    density = _density_beside(residual, rate_hz, turn / (2 * np.pi))
    cov = np.linalg.inv(columns.T @ columns) * density * rate_hz / 2
    return _as_sine(a, b, offset, turn, cov, middle, density)


def _as_sine(a: float, b: float, offset: float, turn: float, cov: Array, middle: float, density: float) -> Sine:
    """From x = offset + a cos(turn (t - middle)) + b sin(turn (t - middle)) to amplitude and phase at t = 0."""
    amplitude = float(np.hypot(a, b))
    along, across = np.array([a, b]) / amplitude, np.array([b, -a]) / amplitude**2
    late = np.zeros(len(cov))
    late[:2] = across
    if len(cov) == 4:
        late[3] = -middle
    return Sine(
        frequency_hz=turn / (2 * np.pi),
        amplitude=amplitude,
        phase_rad=float((np.arctan2(-b, a) - turn * middle + np.pi) % (2 * np.pi) - np.pi),
        offset=float(offset),
        frequency_std_hz=float(np.sqrt(cov[3, 3])) / (2 * np.pi) if len(cov) == 4 else 0.0,
        amplitude_std=float(np.sqrt(along @ cov[:2, :2] @ along)),
        phase_std_rad=float(np.sqrt(late @ cov @ late)),
        offset_std=float(np.sqrt(cov[2, 2])),
        density=density,
    )


def _density_beside(residual: Array, rate_hz: float, frequency_hz: float) -> float:
    """One-sided density of the residual around a frequency, the lines that the sine took up left out."""
    f, power = periodogram(residual, rate_hz)
    k = round(frequency_hz / f[1])
    lines = np.arange(max(1, k - NEIGHBOURS), min(len(f) - 1, k + NEIGHBOURS + 1))
    lines = lines[np.abs(lines - k) >= OWN_LINES]
    return float(np.mean(power[lines])) if len(lines) else float(np.mean(residual**2) * 2 / rate_hz)
