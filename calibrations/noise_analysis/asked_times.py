"""The overlapping Allan deviation at times that are asked for, with every overlap; the record is held in memory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibrations.errors import DataError, TooFewRows
from calibrations.noise_analysis.exact import deviations
from calibrations.noise_analysis.freedom import freedom, interval, overlap_of
from calibrations.noise_analysis.noise_type import FEWEST, moments_of, noise_type
from calibrations.noise_analysis.octaves import Curve
from calibrations.table import Array

KIND = "overlapping"


def curve_at(values: Array, rate_hz: float, tau_s: Sequence[float], source: str) -> Curve:
    """At the nearest whole numbers of samples, shape (k,), from values (n,).

    Raises DataError for a time below one sample, TooFewRows for one of which the record does not hold two.
    """
    steps = [_steps(tau, len(values), rate_hz, source) for tau in tau_s]
    found = deviations(values, steps, KIND)
    alphas = tuple(_alpha(values, m) for m in steps)
    edf = np.array(
        [freedom(KIND, a, len(values), m, overlap_of(KIND, m, a)) for a, m in zip(alphas, steps, strict=True)]
    )
    bounds = np.array([interval(*pair) for pair in zip(found.tolist(), edf.tolist(), strict=True)])
    return Curve(KIND, np.array(steps) / rate_hz, found, bounds[:, 0], bounds[:, 1], alphas, edf)


def _steps(tau_s: float, n: int, rate_hz: float, source: str) -> int:
    """Samples to an averaging time."""
    m = round(tau_s * rate_hz)
    if m < 1:
        raise DataError(f"{source}: an averaging time of {tau_s:g} s is below that of one sample, {1 / rate_hz:g} s")
    if 2 * m > n:
        raise TooFewRows(
            f"{source}: an averaging time of {tau_s:g} s needs a record of {2 * tau_s:g} s or more, and this one has "
            f"{n / rate_hz:g} s; ask for {n / rate_hz / 2:g} s at most"
        )
    return m


def _alpha(values: Array, m: int) -> int:
    """The noise type at m samples, or at the longest time below of which the record has means enough to tell."""
    m = max(1, min(m, len(values) // FEWEST))
    means = values[: len(values) // m * m].reshape(-1, m).mean(axis=1)
    return noise_type(len(means), moments_of(means - means.mean())) or 0
