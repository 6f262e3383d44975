"""Noise coefficients of records of 12 h at 1 Hz, beside the Cramer-Rao bound and the package allan-variance.

The records are made without this program: white noise, fractionally integrated noise of order 1/2 as a convolution
(Hosking), a sum of steps. The bound is that of all three together, from their spectra at every frequency.
"""

from __future__ import annotations

import json
import sys
import time
from statistics import median
from typing import Any

import allan_variance
import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from calibrations.noise.analysis import Coefficient, analyse
from calibrations.noise.record import Samples, reduce_record
from tests.calibrations.noises import least_std

SAMPLES = 43_200
TRUTH = {"white-noise": 1.0, "flicker-noise": 0.5, "rate-random-walk": 0.02}
THEIRS = {"white-noise": "white", "flicker-noise": "flicker", "rate-random-walk": "walk"}
Array = NDArray[np.float64]


def record(seed: int) -> Array:
    """White noise, flicker and a random walk."""
    random = np.random.default_rng(seed)
    white, walk = random.standard_normal(SAMPLES), np.cumsum(random.standard_normal(SAMPLES))
    parts = zip(TRUTH.values(), (white, half_integrated(random.standard_normal(2 * SAMPLES)), walk), strict=True)
    return np.asarray(sum(value * part for value, part in parts))


def half_integrated(white: Array) -> Array:
    """1/f noise out of white noise (2n,), shape (n,): the first half is its past."""
    n = len(white)
    k = np.arange(1, n)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    size = next_fast_len(2 * n, real=True)
    return np.asarray(np.fft.irfft(np.fft.rfft(white, size) * np.fft.rfft(response, size), size)[n // 2 : n])


def ours(samples: Array) -> dict[str, Coefficient]:
    return analyse(reduce_record([Samples("x", [samples], 1.0, "V")], "made")).channels["x"].coefficients


def theirs(samples: Array) -> dict[str, float]:
    found, _ = allan_variance.estimate_parameters(*allan_variance.compute_avar(samples))
    return {name: float(found[THEIRS[name]]) for name in TRUTH}


def compared(seeds: int) -> dict[str, Any]:
    """Errors, coverage and time. Of a process that was not identified, its most likely value counts."""
    ours(record(0))
    errors: dict[str, list[tuple[float, float, float]]] = {name: [] for name in TRUTH}
    milliseconds, false = [], 0
    for seed in range(seeds):
        samples = record(seed)
        began = time.process_time()
        found = ours(samples)
        milliseconds.append(1e3 * (time.process_time() - began))
        false += any(each.identified for name, each in found.items() if name not in TRUTH)
        peer = theirs(samples)
        for name, true in TRUTH.items():
            std = found[name].std if found[name].identified else 0.0
            errors[name].append((found[name].value - true, std, peer[name] - true))
    bound = least_std(TRUTH, SAMPLES)
    return {
        "median_ms": median(milliseconds),
        "false": false / seeds,
        "coefficients": {name: _figures(np.array(errors[name]), bound[name]) for name in TRUTH},
    }


def _figures(errors: Array, least: float) -> dict[str, float]:
    """errors (seeds, 3): ours, its standard uncertainty, theirs."""
    ours_rms, theirs_rms = np.sqrt(np.mean(errors[:, [0, 2]] ** 2, axis=0))
    identified = errors[errors[:, 1] > 0]
    return {
        "rms_over_bound": float(ours_rms / least),
        "coverage": float(np.mean(np.abs(identified[:, 0]) < 1.96 * identified[:, 1])),
        "identified": len(identified) / len(errors),
        "times_better": float(theirs_rms / ours_rms),
    }


if __name__ == "__main__":
    print(json.dumps(compared(int(sys.argv[1]))))
