"""Bias and scale factor of a triad of accelerometers from its six faces, each axis from its own pair.

    b = (v_up + v_down) / 2        s = (v_up - v_down) / 2

Source  Ferraris, Grimaldi and Parvis, Procedure for effortless in-field calibration of three-axis rate gyros and
        accelerometers, Sensors and Materials 7 (1995); IEEE Std 1293, two-point tumble; Ang (1)-(2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.criteria import UPRIGHT_COSINE
from calibrations.table import Array


@dataclass(frozen=True)
class Faces:
    """Bias and scale factor (output per g) of each axis, in the outputs' unit, shape (3,)."""

    bias: Array
    scale: Array


def estimate_faces(outputs: Array) -> Faces | None:
    """From still outputs (n, 3), averaged over each face; None if an axis was not held both up and down."""
    middle = (outputs.max(axis=0) + outputs.min(axis=0)) / 2
    size = np.linalg.norm(outputs - middle, axis=1, keepdims=True)
    cosine = (outputs - middle) / np.where(size > 0, size, 1.0)
    up, down = (_mean_along(outputs, side * cosine) for side in (1, -1))
    if up is None or down is None:
        return None
    return Faces((up + down) / 2, (up - down) / 2)


def _mean_along(outputs: Array, cosine: Array) -> Array | None:
    """Mean output of each axis over the rows in which it is upright, shape (3,); None if one never is."""
    upright = cosine > UPRIGHT_COSINE
    if not upright.any(axis=0).all():
        return None
    return np.array([outputs[upright[:, k], k].mean() for k in range(3)])
