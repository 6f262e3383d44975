"""Forms of causes: supply voltage, rectified vibration, and the converter."""

from __future__ import annotations

import numpy as np

from tests.benchmark.examiner.cause import Cause, Constants, response
from tests.benchmark.examiner.layouts import Array
from tests.benchmark.examiner.record import Record

RANGE_G = 1.25  # half of the converter's range
MARGIN = 1.3  # of `share_of_range`


def share_of_range(record: Record, volts: Array) -> Array:
    """Output in half ranges of the converter, from the middle."""
    middle = record.supply.nominal_v / 2
    return np.clip((volts - middle) / (RANGE_G * record.sensor.scale_v), -MARGIN, MARGIN)


def _bent_ratiometric(record: Record, volts: Array, size: float, constants: Constants) -> Array:
    q = record.supply.q
    return volts * (1 + size * (q + 0.25 * q**2))[:, None]


def _regulator(record: Record, volts: Array, size: float, constants: Constants) -> Array:
    """A regulator that holds the zero less well at the ends, and the scale factor in proportion."""
    q, zero = record.supply.q[:, None], record.sensor.zero_v
    return volts + size * zero * np.tanh(1.5 * q) + 0.5 * size * (volts - zero) * q


def _skew_bow(record: Record, volts: Array, size: float, constants: Constants) -> Array:
    u = share_of_range(record, volts)
    return volts + size * constants.sign * (1 - u**2) * (1 + 0.4 * u)


def _s_shape(record: Record, volts: Array, size: float, constants: Constants) -> Array:
    u = share_of_range(record, volts)
    return volts + size * constants.sign * (np.sin(np.pi * u) + 0.3 * np.sin(2 * np.pi * u + 1))


def _wrong_bits(record: Record, volts: Array, size: float, constants: Constants) -> Array:
    """Integral nonlinearity of a successive-approximation converter whose bits have wrong weights.

    Each bit adds its error where it is set: steps at 1/2, 1/4 ... of the range, rounded by the noise of the samples.
    Source: IEEE Std 1241, integral nonlinearity.
    """
    u = (share_of_range(record, volts) + MARGIN) / (2 * MARGIN)
    errors = np.zeros_like(volts)
    for k, error in enumerate(constants.bits):
        weight = 2.0 ** -(k + 1)
        wave = np.sin(2 * np.pi * (u / (2 * weight) - 0.5) + 1e-9)
        errors = errors + error * np.tanh(wave / 0.03) / 2
    return volts - size * errors


def _rounded(record: Record, samples: Array, size: float, constants: Constants) -> Array:
    return size * np.floor(samples / size + 0.5 + constants.offset) - size * constants.offset


def _unequal_codes(record: Record, samples: Array, size: float, constants: Constants) -> Array:
    """Differential nonlinearity: wide and narrow codes in turn; each returns its middle."""
    codes = samples / (2 * size) + constants.offset
    pair = np.floor(codes)
    is_wide = codes - pair < 0.62
    return 2 * size * (pair - constants.offset) + size * np.where(is_wide, 0.31, 1.62)


QUANTISATION = {
    "needs": ("few samples",),
    "is_smooth": False,
    "layouts": ("nested", "random", "irregular", "large", "serpentine"),
}
SUPPLY = {"needs": ("supply",), "high": 1.0}

CAUSES = (
    Cause(
        "supply-sensitivity",
        "ratiometric, bent",
        "V <- V [1 + A (q + 0.25 q^2)], q = (S-mean)/(1.5 sd)",
        "output",
        _bent_ratiometric,
        **SUPPLY,
    ),
    Cause(
        "supply-sensitivity",
        "regulator",
        "V <- V + A B tanh(1.5 q) + 0.5 A (V-B) q",
        "output",
        _regulator,
        **SUPPLY,
    ),
    response(
        "vibration-rectification",
        "saturating",
        "A m/(1 + m/3 sd(m)), m: mean square",
        lambda x, y, z, r: r.vibration.q / (1 + r.vibration.q / 3),
        ("vibration",),
    ),
    response(
        "vibration-rectification",
        "with preload",
        "A m (1 + 0.15 x)",
        lambda x, y, z, r: r.vibration.q * (1 + 0.15 * x),
        ("vibration",),
    ),
    Cause("adc-nonlinearity", "skew bow", "V += A (1-u^2)(1+0.4u), u = V over the range", "output", _skew_bow),
    Cause("adc-nonlinearity", "S shape", "V += A [sin(pi u) + 0.3 sin(2 pi u + 1)]", "output", _s_shape),
    Cause(
        "adc-nonlinearity",
        "wrong bit weights",
        "V -= A sum e_k bit_k(V), k = 1..5 (steps at 1/2, 1/4 .. of the range)",
        "output",
        _wrong_bits,
        is_smooth=False,
    ),
    Cause("quantisation", "rounding", "V <- q round(V/q + o) per sample", "converter", _rounded, **QUANTISATION),
    Cause(
        "quantisation",
        "codes of unequal width",
        "code widths 1.24 q and 0.76 q in turn, per sample",
        "converter",
        _unequal_codes,
        **QUANTISATION,
    ),
)
