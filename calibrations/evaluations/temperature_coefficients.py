"""What temperature does to bias and scale factor in a cycle: the slope, and the difference between up and down.

    y = y0 + k (T - T0) + h s [+ d t]     s = 1/2 on the way up, the top included, -1/2 on the way down

d is drift, told from hysteresis only where there is more than one cycle. What a straight line leaves (curvature, slow
noise) widens the standard errors, with few steps by Student's t.

Source  IEEE 1293; JCGM 101, 6.4.9: the standard uncertainty of a t-distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.errors import DataError
from calibrations.evaluations.tumble import Tumble
from calibrations.table import Array

WAYS = {"up": 0.5, "down": -0.5}


@dataclass(frozen=True)
class Coefficients:
    """Per K, and up minus down, each (value, standard error): of a bias in V, of a scale factor as a fraction."""

    slope: tuple[float, float]
    hysteresis: tuple[float, float]


def bias_coefficients(steps: Sequence[Tumble]) -> Coefficients:
    """V/K, and V. Raises DataError for one temperature only."""
    return _fitted(steps, np.array([s.bias_v for s in steps]), np.array([s.bias_std_v for s in steps]))


def scale_coefficients(steps: Sequence[Tumble]) -> Coefficients:
    """1/K, and a fraction; of the mean scale factor. Raises DataError as `bias_coefficients`."""
    scale = np.array([s.scale_v_per_g for s in steps])
    return _fitted(steps, scale / scale.mean() - 1, np.array([s.scale_std for s in steps]))


def _fitted(steps: Sequence[Tumble], y: Array, std: Array) -> Coefficients:
    temperature_c, t_s = (np.array([getattr(s, name) for s in steps]) for name in ("temperature_c", "t_s"))
    way = np.array([WAYS[s.path.partition(" ")[0]] for s in steps])
    columns = np.column_stack([temperature_c - temperature_c.mean(), way, np.ones(len(steps))])
    if len({s.path.rpartition(" ")[2] for s in steps}) > 1:
        columns = np.column_stack([columns, (t_s - t_s.mean()) / np.ptp(t_s)])
    free = len(steps) - columns.shape[1]
    if not np.isfinite(columns).all() or np.linalg.matrix_rank(columns) < columns.shape[1]:
        raise DataError("the cycle has no temperatures up and down to compare; does the bench have an oven?")
    weight = 1 / np.where(std > 0, std, 1.0)
    inverse = np.linalg.pinv(columns * weight[:, None])
    factors = inverse @ (y * weight)
    left = float(np.sum(((y - columns @ factors) * weight) ** 2))
    widened = np.sqrt(np.diag(inverse @ inverse.T) * max(1.0, left / max(free - 2, 1)))
    return Coefficients((float(factors[0]), float(widened[0])), (float(factors[1]), float(widened[1])))
