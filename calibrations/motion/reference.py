"""Reference acceleration from displacement: by the paper's method, and by a better one.

The paper's method: a second-order Butterworth low-pass at 20 Hz, corrected for its delay and attenuation at the
frequency of the motion, then two differentiations (Ang V). Its noise grows with the square of frequency up to the
corner, and its correction is exact at one frequency only.

The better method has two parts. Sines are fitted to the strong lines and differentiated exactly. A Kalman smoother with
a fitted noise follows the rest: starts, stops and motion of any form.

Sine approximation: the sine that fits a record best, with standard uncertainties.

    x(t) = offset + amplitude cos(2 pi f t + phase)

The fit has three parameters if the frequency is known, otherwise four. The uncertainties follow from the density of the
residual near the line, so they are also valid for correlated noise; for white noise they are the Cramer-Rao bound.

Smoothing: the Kalman smoother of an integrated random walk.

    x_k = s_k + e_k        D^3 s = w        e of variance r, w of variance q white

The smoothed s solves (I + (r / q) D^3' D^3) s = x, a banded system. This equals the forward and backward passes of
Rauch, Tung and Striebel with a diffuse start, and is a discrete smoothing spline of fifth degree (Wahba, 1990). r / q
has the greatest restricted likelihood.

Source  Ang V; ISO 16063-11 and IEEE Std 1057 (sine approximation).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # scipy.optimize loads slowly: it is imported at its first use
from scipy.linalg import cho_solve_banded, cholesky_banded

from calibrations.criteria import FEWEST_MOTION_PERIODS, HIGHEST_MOTION, HIGHEST_MOTION_HZ, MOST_SINES, PROMINENT
from calibrations.errors import DataError
from calibrations.motion.spectrum import (
    PAPER_CORNER_HZ,
    Complex,
    Response,
    butterworth,
    correct_at,
    periodogram,
)
from calibrations.table import Array

NEIGHBOURS = 100  # lines on each side that the density is taken from
OWN_LINES = 3  # besides the frequency, which the fitted sine takes
ROUNDS = 12


@dataclass(frozen=True)
class Sine:
    """A sine with standard uncertainties. `density` is the one-sided density of the residual near it."""

    frequency_hz: float
    amplitude: float
    phase_rad: float
    offset: float
    frequency_std_hz: float
    amplitude_std: float
    density: float

    def at(self, t_s: Array) -> Array:
        """The sine without its offset."""
        return np.asarray(self.amplitude * np.cos(2 * np.pi * self.frequency_hz * t_s + self.phase_rad))


def fit_four_parameter(t_s: Array, x: Array, frequency_hz: float | None = None) -> Sine:
    """The best sine. Its frequency is fitted too, from `frequency_hz` or the strongest line. Raises DataError."""
    if len(x) < 8:
        raise DataError(f"{len(x)} samples are too few for a sine fit; at least 8 are needed")
    start_hz = strongest_line(t_s, x)[0] if frequency_hz is None else frequency_hz
    middle, rate_hz = float(t_s.mean()), (len(t_s) - 1) / float(np.ptp(t_s))
    t, turn = t_s - middle, 2 * np.pi * start_hz
    for _ in range(ROUNDS):
        columns = np.column_stack([np.cos(turn * t), np.sin(turn * t), np.ones(len(t))])
        a, b, offset = np.linalg.lstsq(columns, x, rcond=None)[0]
        slope = t * (b * columns[:, 0] - a * columns[:, 1])  # d x / d turn
        residual = x - columns @ (a, b, offset)
        columns = np.column_stack([columns, slope])
        step = float(np.linalg.lstsq(columns, residual, rcond=None)[0][3])
        turn += float(np.clip(step, -1 / np.ptp(t), 1 / np.ptp(t)))
        if abs(step) * np.ptp(t) < 1e-10:
            break
    density = _density_near(residual, rate_hz, turn / (2 * np.pi))
    cov = np.linalg.inv(columns.T @ columns) * density * rate_hz / 2
    return _sine(a, b, offset, turn, cov, middle, density)


def find_sines(t_s: Array, x: Array) -> tuple[Sine, ...]:
    """The significant lines of a record, the most prominent first, fitted jointly."""
    sines: list[Sine] = []
    residual = x
    while len(sines) < MOST_SINES:
        frequency, prominence = strongest_line(t_s, residual)
        duplicate = any(abs(s.frequency_hz - frequency) < 1 / np.ptp(t_s) for s in sines)
        if duplicate or prominence < PROMINENT * np.log(len(x)):
            break
        sines.append(fit_four_parameter(t_s, residual, frequency))
        sines = _refit_sines(t_s, x, sines)
        residual = x - sum((s.at(t_s) for s in sines), np.zeros(len(x)))
    return tuple(sines)


def strongest_line(t_s: Array, x: Array) -> tuple[float, float]:
    """Frequency of the strongest line above drift, and its power over the median of its neighbours."""
    if len(x) < 8:
        raise DataError(f"{len(x)} samples are too few for a sine fit; at least 8 are needed")
    f, power = periodogram(x, (len(t_s) - 1) / float(np.ptp(t_s)))
    first = min(FEWEST_MOTION_PERIODS, len(f) - 2)
    k = first + int(np.argmax(power[first:-1]))
    background = np.median(power[max(first, k - NEIGHBOURS) : k + NEIGHBOURS]) or np.finfo(float).tiny
    low, peak, high = np.log(np.maximum(power[k - 1 : k + 2], np.finfo(float).tiny))
    curvature = low - 2 * peak + high
    shift = (low - high) / (2 * curvature) if curvature < 0 else 0.0
    return float(f[k] + shift * f[1]), float(power[k] / background)


def _refit_sines(t_s: Array, x: Array, sines: list[Sine]) -> list[Sine]:
    """Fit each line to the residual of the others. Two rounds are enough for lines that a record resolves."""
    for _ in range(2 if len(sines) > 1 else 0):
        for k, sine in enumerate(sines):
            other_sines = sum((s.at(t_s) for j, s in enumerate(sines) if j != k), np.zeros(len(x)))
            sines[k] = fit_four_parameter(t_s, x - other_sines, sine.frequency_hz)
    return sines


def _sine(a: float, b: float, offset: float, turn: float, cov: Array, middle: float, density: float) -> Sine:
    """From x = offset + a cos(turn (t - middle)) + b sin(turn (t - middle)) to amplitude and phase at t = 0."""
    amplitude = float(np.hypot(a, b))
    by_amplitude = np.array([a, b]) / amplitude
    return Sine(
        frequency_hz=turn / (2 * np.pi),
        amplitude=amplitude,
        phase_rad=float((np.arctan2(-b, a) - turn * middle + np.pi) % (2 * np.pi) - np.pi),
        offset=float(offset),
        frequency_std_hz=float(np.sqrt(cov[3, 3])) / (2 * np.pi),
        amplitude_std=float(np.sqrt(by_amplitude @ cov[:2, :2] @ by_amplitude)),
        density=density,
    )


def _density_near(residual: Array, rate_hz: float, frequency_hz: float) -> float:
    """One-sided density of the residual near a frequency, without the lines of the sine."""
    f, power = periodogram(residual, rate_hz)
    k = round(frequency_hz / f[1])
    lines = np.arange(max(1, k - NEIGHBOURS), min(len(f) - 1, k + NEIGHBOURS + 1))
    lines = lines[np.abs(lines - k) >= OWN_LINES]
    return float(np.mean(power[lines])) if len(lines) else float(np.mean(residual**2) * 2 / rate_hz)


ORDER = 3  # so that acceleration still has a derivative of finite variance
LOG_RANGE = (float(np.log(1e-3)), float(np.log(1e12)))  # of r / q: noise far below the motion; rounding beyond


@dataclass(frozen=True)
class SmoothRecord:
    """A smoothed record, r / q, and the standard deviation of the part taken as noise."""

    values: Array
    ratio: float
    noise_std: float

    def response(self, f: Array, rate_hz: float) -> Complex:
        """Response of the smoother to a sine away from the ends: no phase, 1 / (1 + r / q (2 sin(pi f / rate))^6)."""
        return np.asarray(1 / (1 + self.ratio * (2 * np.sin(np.pi * f / rate_hz)) ** (2 * ORDER)), dtype=complex)

    def corner_hz(self, rate_hz: float) -> float:
        """Frequency with half of the amplitude."""
        return float(rate_hz / np.pi * np.arcsin(min(1.0, self.ratio ** (-1 / (2 * ORDER)) / 2)))

    def edge_s(self, rate_hz: float) -> float:
        """The distance from the ends with fewer averaged samples, s: one period at the corner."""
        return 1 / self.corner_hz(rate_hz)


def smooth(x: Array) -> SmoothRecord:
    """`x`, shape (n,), smoothed."""
    penalty = _penalty(len(x))

    def deviance(log_ratio: float) -> float:
        return _smooth_with(x, penalty, float(np.exp(log_ratio)))[2]

    optimum = scipy.optimize.minimize_scalar(deviance, bounds=LOG_RANGE, method="bounded", options={"xatol": 0.05})
    ratio = float(np.exp(optimum.x))
    values, noise_std, _ = _smooth_with(x, penalty, ratio)
    return SmoothRecord(values, ratio, noise_std)


def _smooth_with(x: Array, penalty: Array, ratio: float) -> tuple[Array, float, float]:
    """(smoothed, noise, -2 log restricted likelihood up to a constant)."""
    bands = ratio * penalty
    bands[-1] += 1.0
    factor = cholesky_banded(bands)
    values = cho_solve_banded((factor, False), x)
    free = len(x) - ORDER
    variance = max(float(x @ (x - values)) / free, np.finfo(float).tiny)
    deviance = free * (np.log(variance) - np.log(ratio)) + 2 * float(np.sum(np.log(factor[-1])))
    return values, float(np.sqrt(variance)), deviance


def _penalty(n: int) -> Array:
    """D^3' D^3 as upper bands, shape (ORDER + 1, n)."""
    weights = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((ORDER + 1, n))
    for i in range(ORDER + 1):
        for j in range(i, ORDER + 1):
            bands[ORDER - (j - i), j : n - ORDER + j] += weights[i] * weights[j]
    return bands


STENCIL = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12  # second derivative, of fourth order


@dataclass(frozen=True)
class Reference:
    """Acceleration in m/s^2, shape (n,), and how it was made. `lines` are those of the greatest acceleration first."""

    acceleration_m_s2: Array
    lines: tuple[Sine, ...]
    remainder: SmoothRecord
    rate_hz: float

    @property
    def duration_s(self) -> float:
        """Length of the record."""
        return len(self.acceleration_m_s2) / self.rate_hz

    @property
    def at_hz(self) -> float:
        """The motion's frequency: of the strongest line, else the middle of the spectrum of its acceleration."""
        if self.lines:
            return self.lines[0].frequency_hz
        f, power = periodogram(self.acceleration_m_s2, self.rate_hz)
        return float(np.sum(f * power) / np.sum(power))

    @property
    def amplitude(self) -> tuple[float, float]:
        """Peak acceleration and its standard uncertainty, m/s^2: of the strongest line, else the greatest of all."""
        if not self.lines:
            corner_hz = self.remainder.corner_hz(self.rate_hz)
            noise = self.remainder.noise_std * np.sqrt(
                2 * corner_hz / self.rate_hz
            )  # noise that the smoother lets through
            return float(np.max(np.abs(self.acceleration_m_s2))), float(noise * (2 * np.pi * corner_hz) ** 2)
        line = self.lines[0]
        turn, turn_std = 2 * np.pi * line.frequency_hz, 2 * np.pi * line.frequency_std_hz
        std = np.hypot(turn**2 * line.amplitude_std, 2 * turn * line.amplitude * turn_std)
        return turn**2 * line.amplitude, float(std)

    @property
    def moves(self) -> bool:
        """Whether there is motion above the displacement's noise."""
        return bool(self.lines) or float(np.std(self.remainder.values)) > self.remainder.noise_std


@dataclass(frozen=True)
class Bias:
    """The bias of a filter for a sine of one frequency, and the band in which it may be used.

    `amplitude` relative, `phase_rad` of the acceleration that it gives; `band_hz`: up to here its amplitude is within
    1 %, or between these where it was corrected at one frequency; `edge_s`: not to be used so near the ends.
    """

    name: str
    at_hz: float
    amplitude: float
    phase_rad: float
    band_hz: tuple[float, float]
    edge_s: float

    @property
    def text(self) -> str:
        """The bias in words."""
        low, high = self.band_hz
        return (
            f"{self.name}: at {self.at_hz:.4g} Hz amplitude {100 * self.amplitude:+.2g} %, phase "
            f"{np.degrees(self.phase_rad):+.2g} deg; good from {low:.4g} to {high:.4g} Hz; "
            f"less certain within {self.edge_s:.2g} s of the ends"
        )


def reference_acceleration(t_s: Array, displacement_m: Array, rate_hz: float) -> Reference:
    """The acceleration by sines and smoother. Shapes (n,)."""
    sines = find_sines(t_s, displacement_m)
    residual = displacement_m - sum((line.at(t_s) for line in sines), np.zeros(len(t_s)))
    smoothed = smooth(residual - residual.mean())
    most = (
        max(HIGHEST_MOTION_HZ, HIGHEST_MOTION * max(sines, key=lambda line: line.amplitude).frequency_hz)
        if sines
        else 0.0
    )
    lines = sorted((line for line in sines if line.frequency_hz <= most), key=line_prominence, reverse=True)
    sine_part = sum((-((2 * np.pi * s.frequency_hz) ** 2) * s.at(t_s) for s in lines), np.zeros(len(t_s)))
    return Reference(sine_part + second_derivative(smoothed.values, rate_hz, STENCIL), tuple(lines), smoothed, rate_hz)


def line_prominence(line: Sine) -> float:
    """The factor of a line's acceleration."""
    return line.frequency_hz**2 * line.amplitude


def second_derivative(x: Array, rate_hz: float, stencil: Array) -> Array:
    """Second derivative by a symmetric stencil; the few values at each end are those of their neighbours."""
    reach = len(stencil) // 2
    inner = np.convolve(x, stencil, mode="valid") * rate_hz**2
    return np.pad(inner, reach, mode="edge")


def reference_biases(reference: Reference) -> tuple[Bias, ...]:
    """The error of each step to a reference alone: the paper's filter and the sines at the motion's frequency, the
    smoother at a quarter of its corner. An amplitude is never negative: noise makes it longer, by half its variance.
    """
    at_hz, rate_hz, periods = reference.at_hz, reference.rate_hz, 1 / reference.duration_s

    def paper(f: Array) -> Complex:
        return np.asarray(correct_at(butterworth(rate_hz), at_hz)(f) * _differences(f, rate_hz, (-2.0, 2.0)))

    def smoother(f: Array) -> Complex:
        return np.asarray(reference.remainder.response(f, rate_hz) * _differences(f, rate_hz, (-2.5, 16 / 6, -1 / 6)))

    quarter, edge_s = reference.remainder.corner_hz(rate_hz) / 4, reference.remainder.edge_s(rate_hz)
    longer = [(line.amplitude_std / line.amplitude) ** 2 / 2 for line in reference.lines[:1]]
    return (
        filter_bias("Butterworth low-pass, two differences", paper, at_hz, rate_hz, 4 / PAPER_CORNER_HZ),
        *(Bias("sine approximation", at_hz, share, 0.0, (at_hz - periods, at_hz + periods), 0.0) for share in longer),
        filter_bias("Kalman smoother of the rest", smoother, quarter, rate_hz, edge_s),
    )


def filter_bias(name: str, response: Response, at_hz: float, rate_hz: float, edge_s: float) -> Bias:
    """The bias of a filter given by its response relative to the true one."""
    response_at_line = complex(response(np.array([at_hz]))[0])
    f = np.linspace(at_hz / 100, rate_hz / 2, 20001)
    unbiased = np.abs(np.abs(response(f)) - 1) < 0.01
    k = int(np.argmin(np.abs(f - at_hz)))
    biased = np.flatnonzero(~unbiased)
    lower, upper = biased[biased < k], biased[biased > k]
    band = (float(f[lower[-1]]) if len(lower) else 0.0, float(f[upper[0]]) if len(upper) else rate_hz / 2)
    return Bias(name, at_hz, abs(response_at_line) - 1, float(np.angle(response_at_line)), band, edge_s)


def _differences(f: Array, rate_hz: float, cosines: tuple[float, ...]) -> Array:
    """Second differences by a symmetric stencil over the true second derivative; its terms as factors of cosines."""
    w = 2 * np.pi * np.maximum(f, 1e-9) / rate_hz
    total: Array = sum((c * np.cos(k * w) for k, c in enumerate(cosines)), np.zeros(len(f)))
    return np.asarray(-total / w**2)
