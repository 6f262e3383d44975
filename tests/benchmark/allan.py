"""Allan deviation of twelve hours at 1 kHz at octave times, against allantools; and how near to the truth ours is."""

from __future__ import annotations

import json
import resource
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibrations.noise.deviations import deviations, octaves

SAMPLES, RATE_HZ = 43_200_000, 1000.0
MEAN = 20_000.0
GRID = 2.0**-20  # noise on it is exact, with the mean and without
RECORDS, LENGTH = 300, 1 << 14
Array = NDArray[np.float64]


def record(file: Path) -> None:
    """White noise and a random walk under a mean, in pieces."""
    random, level = np.random.default_rng(1), 0.0
    out = np.lib.format.open_memmap(file, mode="w+", dtype=np.float64, shape=(SAMPLES,))
    for start in range(0, SAMPLES, SAMPLES // 40):
        walk = level + 1e-4 * np.cumsum(random.standard_normal(SAMPLES // 40))
        out[start : start + len(walk)] = MEAN + np.round((random.standard_normal(len(walk)) + walk) / GRID) * GRID
        level = walk[-1]
    out.flush()


def ours(samples: Array) -> Array:
    return octaves([samples], RATE_HZ).deviation


def exact(samples: Array) -> Array:
    return deviations(samples, 2 ** np.arange((SAMPLES // 2).bit_length()))


def theirs(samples: Array) -> Array:
    import allantools

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.asarray(allantools.oadev(samples, RATE_HZ, "freq", taus="octave")[1])


def measured(call: Callable[[Array], Array], samples: Array) -> dict[str, float]:
    """Processor time, the least of two, and memory beyond what was held before."""
    call(samples[:100_000])  # compile, import
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    seconds = []
    for _ in range(2):
        began = time.process_time()
        call(samples)
        seconds.append(time.process_time() - began)
    extra_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb
    return {"processor_s": min(seconds), "extra_mb": extra_kb / 1024}


def error_under_mean() -> float:
    """The largest relative error by a mean of 20,000, up to 2^20 samples of averaging."""
    noise = np.round(np.random.default_rng(2).standard_normal(1 << 23) / GRID) * GRID
    return float(np.max(np.abs(octaves([MEAN + noise], 1.0).deviation / octaves([noise], 1.0).deviation - 1)))


def variance_ratio() -> float:
    """The largest variance of ours over that of every overlap, over averaging times and white noise or random walk."""
    random, worst = np.random.default_rng(3), 0.0
    for kind in (lambda x: x, np.cumsum):
        pairs = np.array([_both(kind(random.standard_normal(LENGTH))) for _ in range(RECORDS)])
        worst = max(worst, float(np.max(np.var(pairs[:, 0] ** 2, axis=0) / np.var(pairs[:, 1] ** 2, axis=0))))
    return worst


def _both(samples: Array) -> tuple[Array, Array]:
    curve = octaves([samples], 1.0)
    return curve.deviation, deviations(samples, curve.tau_s.astype(int))


def main(what: str, file: str = "") -> None:
    if what == "record":
        record(Path(file))
    elif what == "truth":
        print(json.dumps({"variance_ratio": variance_ratio(), "error_under_mean": error_under_mean()}))
    else:
        call = {"octaves": ours, "exact": exact, "allantools": theirs}[what]
        print(json.dumps(measured(call, np.load(file))))


if __name__ == "__main__":
    main(*sys.argv[1:])
