"""The outputs of three axes in many orientations: coverage of the sphere of directions, and its six faces.

The magnitude over the sphere is a sum of spherical harmonics: degree 0 is the strength, 1 an offset (hard iron), 2 a
stretch (soft iron). They are orthogonal over the whole sphere. Where directions are missing, a combination of them is
known worse, by 1 / sqrt(least eigenvalue of their Gram matrix); beyond MOST_WORSE_COVERED it is not fitted.

The six faces give bias and scale factor of each axis from its own pair:

    b = (v_up + v_down) / 2        s = (v_up - v_down) / 2

Source  optimality of designs by the least eigenvalue (E-optimality): Pukelsheim, Optimal Design of Experiments (1993);
        faces: Ferraris, Grimaldi and Parvis, Procedure for effortless in-field calibration of three-axis rate gyros and
        accelerometers, Sensors and Materials 7 (1995); IEEE Std 1293, two-point tumble; Ang (1)-(2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.criteria import MOST_WORSE_COVERED, UPRIGHT_COSINE
from calibrations.table import Array, Table

HARD_IRON, SOFT_IRON = 1, 2  # highest degree of their part of the magnitude
REMEDIES = {
    HARD_IRON: "turn the sensor about two axes at least",
    SOFT_IRON: "turn the sensor about three axes, with each side up and down",
}


def coverage_fault(table: Table, degree: int) -> str | None:
    """The reason why these directions do not determine harmonics up to `degree`; None if they do."""
    ratio = worst_ratio(directions(table), degree)
    if ratio <= MOST_WORSE_COVERED:
        return None
    times = f"{ratio:.0f} times less certain than with all directions covered (limit: {MOST_WORSE_COVERED:g} times)"
    certainty = times if ratio < 1e4 else "unknown"
    remedy = REMEDIES[degree]
    return f"the orientations cover too little of the sphere: a combination of parameters is {certainty}; {remedy}"


def magnetometer_coverage_warning(table: Table) -> str | None:
    """The effects that a magnetometer's directions cannot determine; None where they cover the sphere."""
    if not table.type.field:
        return None
    for degree, effects in ((HARD_IRON, "hard-iron and soft-iron"), (SOFT_IRON, "soft-iron")):
        if fault := coverage_fault(table, degree):
            return f"{effects} cannot be tested: {fault}; the values assume a sensor without this effect"
    return None


def directions(table: Table) -> Array:
    """Unit vectors (n, 3) from the centre of the sphere fitted to the outputs."""
    return unit_vectors(table.outputs - sphere_centre(table.outputs))


def unit_vectors(vectors: Array) -> Array:
    """The directions of vectors (n, 3); 0 where a vector is 0."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny))


def sphere_centre(means: Array) -> Array:
    """Centre of the sphere through the means: |m|^2 = 2 m.c + const, linear in c."""
    middle: Array = means.mean(axis=0)
    offsets = means - middle
    if len(means) < 5:
        return middle
    A = np.column_stack([2 * offsets, np.ones(len(means))])
    solution: Array = np.linalg.lstsq(A, np.sum(offsets**2, axis=1), rcond=None)[0]
    return np.asarray(middle + solution[:3], dtype=np.float64)


def sphere_radius(table: Table) -> float:
    """Radius of the sphere fitted to the outputs."""
    return float(np.mean(np.linalg.norm(table.outputs - sphere_centre(table.outputs), axis=1))) or 1.0


def worst_ratio(u: Array, degree: int) -> float:
    """Uncertainty of the least known combination over that on the whole sphere; `u` unit vectors (n, 3)."""
    columns = harmonics(u, degree)
    least = float(np.linalg.eigvalsh(columns.T @ columns / len(u))[0])
    return float(1 / np.sqrt(max(least, np.finfo(float).eps)))


def harmonics(u: Array, degree: int) -> Array:
    """Real spherical harmonics up to `degree` (at most 2), of mean square 1 over the sphere, shape (n, 1, 4 or 9)."""
    x, y, z = u.T
    columns = [np.ones(len(u)), *(np.sqrt(3) * product for product in (x, y, z))]
    if degree > 1:
        columns += [np.sqrt(15) * product for product in (x * y, x * z, y * z, (x**2 - y**2) / 2)]
        columns.append(np.sqrt(5) * (3 * z**2 - 1) / 2)
    return np.column_stack(columns)


@dataclass(frozen=True)
class Faces:
    """Bias and scale factor (output per g) of each axis, in the outputs' unit, shape (3,)."""

    bias: Array
    scale: Array


def estimate_faces(outputs: Array) -> Faces | None:
    """From outputs at rest (n, 3), averaged over each face; None if an axis was not measured both up and down."""
    middle = (outputs.max(axis=0) + outputs.min(axis=0)) / 2
    cosine = unit_vectors(outputs - middle)
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
