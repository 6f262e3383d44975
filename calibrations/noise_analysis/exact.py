"""Deviations of an array at hand at any averaging time, with every overlap.

    sigma^2(m) = mean((x[i+2m] - 2 x[i+m] + x[i])^2) / (2 m^2)        x: running sum of the values

The Hadamard deviation has the third difference and 6 for 2, the modified one a mean over m phases, the total one a
record that goes on as its own mirror image at both ends.

Source  IEEE 952, annex C; NIST SP 1065, 5.2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType

import numpy as np

from calibrations.errors import DataError
from calibrations.noise_analysis.kernels import modified_squares, reflected_squares, second_order, third_order
from calibrations.table import Array

Squares = tuple[float, int, float]  # sum, number, what their mean is divided by to be a variance


def deviations(values: Array, steps: Iterable[int], kind: str = "overlapping") -> Array:
    """Deviation of `values`, shape (n,), over each of `steps` samples; nan where the record is too short for it.

    `kind`: overlapping, modified, total; hadamard (overlapping); and, without overlap, allan and separate-hadamard.

    Raises DataError for another kind, for values that are no numbers, and for steps below 1.
    """
    if kind not in KINDS:
        raise DataError(f'unknown kind of deviation "{kind}"; there are {", ".join(KINDS)}')
    whole = [int(m) for m in steps]
    if min(whole, default=1) < 1:
        raise DataError(f"an averaging time of {min(whole)} samples; it is 1 or more")
    values = np.ascontiguousarray(values, dtype=np.float64)
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values)))
        raise DataError(f"row {row + 1} is {values[row]:g}, not a number; take a stretch of the record without gaps")
    centred = values - values.mean() if len(values) else values
    phase = np.concatenate([[0.0], np.cumsum(centred)])
    return np.array([_deviation(*KINDS[kind](phase, centred, m)) for m in whole])


def _deviation(total: float, number: int, divisor: float) -> float:
    return float(np.sqrt(total / number / divisor)) if number > 0 else np.nan


def _overlapping(phase: Array, _: Array, m: int) -> Squares:
    return second_order(phase, m, 0), len(phase) - 2 * m, 2.0 * m**2


def _hadamard(phase: Array, _: Array, m: int) -> Squares:
    return third_order(phase, m, 0), len(phase) - 3 * m, 6.0 * m**2


def _allan(phase: Array, _: Array, m: int) -> Squares:
    every = np.ascontiguousarray(phase[::m])
    return second_order(every, 1, 0), len(every) - 2, 2.0 * m**2


def _separate_hadamard(phase: Array, _: Array, m: int) -> Squares:
    every = np.ascontiguousarray(phase[::m])
    return third_order(every, 1, 0), len(every) - 3, 6.0 * m**2


def _modified(_: Array, centred: Array, m: int) -> Squares:
    total, number = modified_squares(np.append(centred, 0.0), m)  # one more, as the last phase is where it would begin
    return total, number, 2.0 * float(m) ** 4


def _total(phase: Array, centred: Array, m: int) -> Squares:
    if len(centred) < 2 * m:
        return 0.0, 0, 1.0
    ends = reflected_squares(centred, m) + reflected_squares(centred[::-1].copy(), m)
    return second_order(phase, m, 0) + ends, len(centred) - 1, 2.0 * m**2


KINDS: Mapping[str, Callable[[Array, Array, int], Squares]] = MappingProxyType(
    {
        "overlapping": _overlapping,
        "modified": _modified,
        "hadamard": _hadamard,
        "total": _total,
        "allan": _allan,
        "separate-hadamard": _separate_hadamard,
    }
)
