"""Whether the orientations of a turned sensor are spread widely enough for what is to be fitted to its magnitude.

The magnitude over the sphere of directions is a sum of spherical harmonics: degree 0 is the strength, 1 an offset (hard
iron), 2 a stretch (soft iron). Over the whole sphere they are orthogonal, and each is known as well as a mean. Where
the directions leave parts of it out, some combination is known worse, by 1 / sqrt(least eigenvalue of their Gram
matrix); what is worse than WORST times is not fitted.

Source  optimality of designs by the least eigenvalue (E-optimality): Pukelsheim, Optimal Design of Experiments (1993).
"""

from __future__ import annotations

import numpy as np

from calibrations.reading.stills import sphere_centre
from calibrations.table import Array, Table

HARD_IRON, SOFT_IRON = 1, 2  # highest degree of what they add to the magnitude
WORST = 10.0
NEEDED = {
    HARD_IRON: "turn the sensor about two axes at least",
    SOFT_IRON: "turn the sensor about three axes, each of its sides up and down",
}


def too_small(table: Table, degree: int) -> str | None:
    """Why harmonics up to `degree` cannot be told from these directions, in words; None where they can."""
    found = worse(directions(table), degree)
    if found <= WORST:
        return None
    times = f"{found:.0f} times worse than from as many on all sides, and {WORST:g} times is the limit"
    known = times if found < 1e4 else "not at all"
    return f"the orientations cover too little of the sphere: something in it would be known {known}; {NEEDED[degree]}"


def uncovered(table: Table) -> str | None:
    """What orientations of a magnetometer leave unasked, in words; None where they cover the sphere."""
    if table.content != "fields":
        return None
    for degree, what in ((HARD_IRON, "hard-iron and soft-iron"), (SOFT_IRON, "soft-iron")):
        if why := too_small(table, degree):
            return f"{what} cannot be asked: {why}; until then every value is that of a sensor without it"
    return None


def directions(table: Table) -> Array:
    """Unit vectors (n, 3) from the middle of the sphere that comes nearest to the outputs."""
    away = table.outputs - sphere_centre(table.outputs)
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), np.finfo(float).tiny))


def radius(table: Table) -> float:
    """Of the sphere that comes nearest to the outputs."""
    return float(np.mean(np.linalg.norm(table.outputs - sphere_centre(table.outputs), axis=1))) or 1.0


def worse(u: Array, degree: int) -> float:
    """How many times worse the least known combination is than over the whole sphere; `u` unit vectors (n, 3)."""
    columns = harmonics(u, degree)
    least = float(np.linalg.eigvalsh(columns.T @ columns / len(u))[0])
    return float(1 / np.sqrt(max(least, np.finfo(float).eps)))


def harmonics(u: Array, degree: int) -> Array:
    """Real spherical harmonics up to `degree` (at most 2), of mean square 1 over the sphere, shape (n, 1, 4 or 9)."""
    x, y, z = u.T
    columns = [np.ones(len(u)), *(np.sqrt(3) * each for each in (x, y, z))]
    if degree > 1:
        columns += [np.sqrt(15) * each for each in (x * y, x * z, y * z, (x**2 - y**2) / 2)]
        columns.append(np.sqrt(5) * (3 * z**2 - 1) / 2)
    return np.column_stack(columns)
