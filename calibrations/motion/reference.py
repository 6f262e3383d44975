"""Reference acceleration from displacement: the paper's way, and a better one.

The paper's: a second-order Butterworth low-pass at 20 Hz, freed of its delay and attenuation at the motion's frequency,
then two differentiations (Ang V). It lets noise through that grows with the square of frequency up to the corner, and
its correction holds at one frequency.

The better one: lines that stand out are fitted as sines and differentiated exactly; what they leave goes through a
Kalman smoother whose noise is fitted, so that starts, stops and motion of any form are followed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.motion.sine import Sine, sines
from calibrations.motion.smoother import Smoothed, smooth
from calibrations.motion.spectrum import (
    PAPER_CORNER_HZ,
    Complex,
    Response,
    butterworth,
    corrected,
    periodogram,
    through,
)
from calibrations.table import Array

HIGHEST_HZ = 30.0  # of a line that is motion, or so many times the strongest's: above it is the probe's hum
HIGHEST = 1.5
STENCIL = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12  # second derivative, of fourth order


@dataclass(frozen=True)
class Reference:
    """Acceleration in m/s^2, shape (n,), and how it was made. `lines` are those of the greatest acceleration first."""

    acceleration_m_s2: Array
    lines: tuple[Sine, ...]
    rest: Smoothed
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
            corner_hz = self.rest.corner_hz(self.rate_hz)
            left = self.rest.noise_std * np.sqrt(2 * corner_hz / self.rate_hz)  # noise that the smoother lets through
            return float(np.max(np.abs(self.acceleration_m_s2))), float(left * (2 * np.pi * corner_hz) ** 2)
        line = self.lines[0]
        turn, turn_std = 2 * np.pi * line.frequency_hz, 2 * np.pi * line.frequency_std_hz
        std = np.hypot(turn**2 * line.amplitude_std, 2 * turn * line.amplitude * turn_std)
        return turn**2 * line.amplitude, float(std)

    @property
    def moves(self) -> bool:
        """Whether there is motion that stands out of the displacement's noise."""
        return bool(self.lines) or float(np.std(self.rest.values)) > self.rest.noise_std


@dataclass(frozen=True)
class Bias:
    """What a filter does by itself to a sine of one frequency, and where it may be used.

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


def reference(t_s: Array, displacement_m: Array, rate_hz: float) -> Reference:
    """The acceleration by sines and smoother. Shapes (n,)."""
    found = sines(t_s, displacement_m)
    left = displacement_m - sum((line.at(t_s) for line in found), np.zeros(len(t_s)))
    rest = smooth(left - left.mean())
    most = max(HIGHEST_HZ, HIGHEST * max(found, key=lambda line: line.amplitude).frequency_hz) if found else 0.0
    lines = sorted((line for line in found if line.frequency_hz <= most), key=strength, reverse=True)
    moving = sum((-((2 * np.pi * s.frequency_hz) ** 2) * s.at(t_s) for s in lines), np.zeros(len(t_s)))
    return Reference(moving + second_derivative(rest.values, rate_hz, STENCIL), tuple(lines), rest, rate_hz)


def strength(line: Sine) -> float:
    """What a line's acceleration grows with."""
    return line.frequency_hz**2 * line.amplitude


def paper_reference(displacement_m: Array, rate_hz: float, frequency_hz: float) -> Array:
    """The acceleration as in Ang V, m/s^2, shape (n,)."""
    low_passed = through(displacement_m, rate_hz, corrected(butterworth(rate_hz), frequency_hz))
    return second_derivative(low_passed, rate_hz, np.array([1.0, -2.0, 1.0]))


def second_derivative(x: Array, rate_hz: float, stencil: Array) -> Array:
    """By a symmetric stencil; the few values at each end are those of their neighbours."""
    reach = len(stencil) // 2
    inner = np.convolve(x, stencil, mode="valid") * rate_hz**2
    return np.pad(inner, reach, mode="edge")


def biases(found: Reference) -> tuple[Bias, ...]:
    """What each step to a reference does by itself: the paper's filter and the sines at the motion's frequency, the
    smoother at a quarter of its corner. An amplitude is never negative: noise makes it longer, by half its variance.
    """
    at_hz, rate_hz, periods = found.at_hz, found.rate_hz, 1 / found.duration_s

    def paper(f: Array) -> Complex:
        return np.asarray(corrected(butterworth(rate_hz), at_hz)(f) * _differences(f, rate_hz, (-2.0, 2.0)))

    def smoother(f: Array) -> Complex:
        return np.asarray(found.rest.response(f, rate_hz) * _differences(f, rate_hz, (-2.5, 16 / 6, -1 / 6)))

    quarter, edge_s = found.rest.corner_hz(rate_hz) / 4, found.rest.edge_s(rate_hz)
    longer = [(line.amplitude_std / line.amplitude) ** 2 / 2 for line in found.lines[:1]]
    return (
        bias_of("Butterworth low-pass, two differences", paper, at_hz, rate_hz, 4 / PAPER_CORNER_HZ),
        *(Bias("sine approximation", at_hz, share, 0.0, (at_hz - periods, at_hz + periods), 0.0) for share in longer),
        bias_of("Kalman smoother of the rest", smoother, quarter, rate_hz, edge_s),
    )


def bias_of(name: str, response: Response, at_hz: float, rate_hz: float, edge_s: float) -> Bias:
    """The bias of a filter given by its response relative to the true one."""
    there = complex(response(np.array([at_hz]))[0])
    f = np.linspace(at_hz / 100, rate_hz / 2, 20001)
    right = np.abs(np.abs(response(f)) - 1) < 0.01
    k = int(np.argmin(np.abs(f - at_hz)))
    wrong = np.flatnonzero(~right)
    below, above = wrong[wrong < k], wrong[wrong > k]
    band = (float(f[below[-1]]) if len(below) else 0.0, float(f[above[0]]) if len(above) else rate_hz / 2)
    return Bias(name, at_hz, abs(there) - 1, float(np.angle(there)), band, edge_s)


def _differences(f: Array, rate_hz: float, cosines: tuple[float, ...]) -> Array:
    """Second differences by a symmetric stencil over the true second derivative; its terms as factors of cosines."""
    w = 2 * np.pi * np.maximum(f, 1e-9) / rate_hz
    total: Array = sum((c * np.cos(k * w) for k, c in enumerate(cosines)), np.zeros(len(f)))
    return np.asarray(-total / w**2)
