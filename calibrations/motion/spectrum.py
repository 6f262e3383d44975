"""Linear filters on evenly sampled records, and the density of noise.

A filter is given by its frequency response, analog or digital, and applied in the frequency domain: what is
band-limited below half the sampling rate goes through it exactly, an inverse or a delay by part of a sample as well.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy  # its signal room, large and seldom needed, is loaded where it is first entered
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from calibrations.table import Array

Complex = NDArray[np.complex128]
Response = Callable[[Array], Complex]

PAPER_CORNER_HZ = 20.0  # of the second-order Butterworth low-pass, Ang V
MARGIN_S = 1.0  # the record is continued by this on both sides, so that its ends do not meet


def through(x: Array, rate_hz: float, response: Response) -> Array:
    """`x`, shape (n, ...), through a filter. Ends are continued by odd reflection that fades to the mean."""
    n, mean = len(x), x.mean(axis=0).reshape(-1)
    flat = x.reshape(n, -1) - mean
    margin = min(n - 1, int(np.ceil(MARGIN_S * rate_hz)))
    more = next_fast_len(n + 2 * margin, real=True) - n - 2 * margin
    fade = ((1 + np.cos(np.pi * np.arange(1, margin + 1) / (margin + 1))) / 2)[:, None]
    before = (2 * flat[0] - flat[1 : margin + 1]) * fade
    behind = (2 * flat[-1] - flat[-2 : -margin - 2 : -1]) * fade
    whole = np.concatenate([before[::-1], flat, behind, np.zeros((more, flat.shape[1]))])
    f = rfftfreq(len(whole), 1 / rate_hz)
    H = response(np.maximum(f, f[1] / 2))[:, None]  # the mean, which a response may treat apart, is not in here
    out = irfft(rfft(whole, axis=0) * H, len(whole), axis=0)[margin : margin + n]
    return np.asarray((out + mean * response(np.zeros(1)).real).reshape(x.shape))


def first_order(corner_hz: float) -> Response:
    """The R-C low-pass at the sensor's output: 1 / (1 + j f / corner)."""
    return lambda f: np.asarray(1 / (1 + 1j * f / corner_hz))


def delayed(by_s: float) -> Response:
    """A delay."""
    return lambda f: np.asarray(np.exp(-2j * np.pi * f * by_s))


def butterworth(rate_hz: float, corner_hz: float = PAPER_CORNER_HZ, order: int = 2) -> Response:
    """A digital Butterworth low-pass, Ang V."""
    b, a = scipy.signal.butter(order, corner_hz, fs=rate_hz)
    return lambda f: np.asarray(scipy.signal.freqz(b, a, f, fs=rate_hz)[1])


def corrected(response: Response, at_hz: float) -> Response:
    """A low-pass freed of its attenuation and delay at one frequency, as Ang V corrects its filter.

    The mean passes as it is: corrected like the motion, an offset would grow.
    """
    there = response(np.array([at_hz]))[0]
    late_s = -np.angle(there) / (2 * np.pi * at_hz)
    return lambda f: np.where(f > 0, response(f) / np.abs(there) * np.exp(2j * np.pi * f * late_s), 1.0)


def periodogram(x: Array, rate_hz: float) -> tuple[Array, Array]:
    """(frequency, one-sided density) with a Hann window, the mean taken off; shape (n // 2 + 1,)."""
    window = np.hanning(len(x) + 2)[1:-1]
    power = np.abs(rfft((x - x.mean()) * window)) ** 2
    return rfftfreq(len(x), 1 / rate_hz), 2 * power / (rate_hz * np.sum(window**2))


def band_rms(density: Array, f: Array, response: Response) -> float:
    """Rms of noise of this one-sided density behind a filter."""
    return float(np.sqrt(np.trapezoid(density * np.abs(response(f)) ** 2, f)))
