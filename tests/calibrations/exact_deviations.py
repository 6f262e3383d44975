"""Deviations of all kinds with every overlap, by their definitions: the reference of those in one pass."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from calibrations.noise.kernels import reflected_squares
from calibrations.table import Array

KINDS = ("overlapping", "modified", "hadamard", "total", "allan", "separate-hadamard")


def exact_deviations(values: Array, steps: Iterable[int], kind: str = "overlapping") -> Array:
    """Deviation of `values`, shape (n,), over each of `steps` samples. allan and separate-hadamard do not overlap."""
    centred = np.asarray(values, float) - np.mean(values)
    return np.array([_deviation(centred, int(m), kind) for m in steps])


def _deviation(centred: Array, m: int, kind: str) -> float:
    phase = np.concatenate([[0.0], np.cumsum(centred)])
    if kind == "modified":  # the mean of the phase over m samples has an m-th of each
        sums = np.concatenate([[0.0], np.cumsum(phase)])
        return float(np.sqrt(np.mean(np.diff(_apart(sums, m), 3, axis=1) ** 2) / 2) / m**2)
    if kind == "total":
        ends = reflected_squares(centred, m) + reflected_squares(centred[::-1].copy(), m)
        inside = np.diff(_apart(phase, m, 3), 2, axis=1)
        return float(np.sqrt((np.sum(inside**2) + ends) / (len(centred) - 1) / 2) / m)
    order, divisor = (3, 6) if "hadamard" in kind else (2, 2)
    apart = _apart(phase, m, order + 1)
    apart = apart[::m] if kind in ("allan", "separate-hadamard") else apart
    return float(np.sqrt(np.mean(np.diff(apart, order, axis=1) ** 2) / divisor) / m)


def _apart(x: Array, m: int, count: int = 4) -> Array:
    """`count` values m samples apart from each place on, shape (places, count)."""
    places = len(x) - (count - 1) * m
    return np.column_stack([x[k * m : k * m + places] for k in range(count)])
