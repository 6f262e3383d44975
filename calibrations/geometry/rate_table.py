"""The angular rate along a gyroscope's reference axes on a rate table, with the earth's rate.

    w = rate e + W sin(latitude) u        W = 0.0041781 deg/s; e the axis of the table, u the vertical, unit vectors

The columns axis_x, axis_y, axis_z give the axis in the sensor's frame. Without them it is vertical, along the edge that
ax, ay, az show to be upright; without those, along the edge whose output follows the rate. Rates are positive by the
right-hand rule. The horizontal part of the earth's rate rotates in the sensor's frame and averages to 0 over whole
turns; at rest it adds to the bias, W cos(latitude) at most.

Source  IEEE Std 1431, tests on a rate table; IERS Conventions (2010), the earth's rotation.
"""

from __future__ import annotations

import numpy as np

from calibrations.criteria import LEAST_MAIN_SLOPE, LEAST_OTHER_AXIS, MOST_MAGNITUDE_SPREAD, UPRIGHT_COSINE
from calibrations.errors import DataError
from calibrations.geometry.sphere import estimate_faces, unit_vectors
from calibrations.table import AXES, Array, Table

EARTH_DEG_S = np.degrees(7.292115e-5)


def rate_deg_s(table: Table) -> Array:
    """Angular rate along the sensor's reference axes, deg/s, shape (n, 3), as far as it is known."""
    turned = table.column("rate_deg_s")[:, None] * turn_axes(table)
    return turned + vertical_deg_s(table) * _up(table)


def turn_axes(table: Table) -> Array:
    """The rotation axis of each row, unit vectors in the sensor's frame, shape (n, 3).

    Raises DataError where the axis is unknown.
    """
    if all(f"axis_{axis}" in table for axis in AXES):
        return _unit(np.column_stack([table.column(f"axis_{axis}") for axis in AXES]), table)
    if all(f"a{axis}" in table for axis in AXES):
        return _upright(table)
    slopes = np.abs(rate_slopes(table))
    if slopes.max() < LEAST_MAIN_SLOPE * np.linalg.norm(slopes):
        raise DataError(
            f"{table.source}: more than one output follows the rate, and the axis of each turn is not known; add the "
            "columns axis_x, axis_y, axis_z (1, 0, 0 for a turn about x), or ax, ay, az"
        )
    return np.tile(np.eye(3)[np.argmax(slopes)], (table.n, 1))


def rate_slopes(table: Table) -> Array:
    """Output of each axis per deg/s of the table's rate, shape (3,). Raises DataError where the rate never changes."""
    rate = _varied_rate(table)
    deviations = rate - rate.mean()
    return np.asarray(deviations @ table.outputs / (deviations @ deviations))


def at_rest(output: str) -> str:
    """The column of an output at the rest before each turn."""
    return f"{output}_at_rest"


def outputs_at_rest(table: Table) -> Array:
    """The outputs without a rate, (3,): at the rests before the turns, or at the smallest rate."""
    names = [at_rest(name) for name in table.output_names]
    if all(name in table for name in names):
        return np.array([table.column(name).mean() for name in names])
    return np.asarray(table.outputs[np.argmin(np.abs(table.column("rate_deg_s")))])


def rate_scales(table: Table) -> Array:
    """Output of each axis per deg/s about itself, shape (3,); 0 for an axis without enough rotation about it.

    Raises DataError where the rate never changes.
    """
    rate = _varied_rate(table)[:, None] * turn_axes(table)
    deviations = rate - rate.mean(axis=0)
    squares = np.sum(deviations**2, axis=0)
    turned = squares > LEAST_OTHER_AXIS * squares.max()
    return np.where(turned, np.sum(deviations * table.outputs, axis=0) / np.where(turned, squares, 1.0), 0.0)


def is_turned(table: Table, axis: int) -> float:
    """1 if the sensor was turned about this axis, else 0."""
    return float(rate_scales(table)[axis] != 0)


def specific_force_g(table: Table) -> Array:
    """Specific force from the columns ax, ay, az, g, shape (n, 3): calibrated by six faces, or else by its magnitude.

    Raises DataError where it is 0 throughout, or its magnitude is not that of gravity.
    """
    a = np.column_stack([table.column(f"a{axis}") for axis in AXES])
    still = table.column("rate_deg_s") == 0
    faces = estimate_faces(a[still]) if still.any() else None
    if faces is not None:
        return (a - faces.bias) / faces.scale
    low, gravity, high = np.quantile(np.linalg.norm(a, axis=1), [0.25, 0.5, 0.75])
    if not gravity > 0:
        raise DataError(f"{table.source}: ax, ay and az are 0; remove the columns if there was no accelerometer")
    if high - low > MOST_MAGNITUDE_SPREAD * gravity:
        raise DataError(
            f"{table.source}: in half of the rows the magnitude of ax, ay, az is {low:.3g} to {high:.3g}, but gravity "
            "is constant; exchange them with gx, gy, gz if these hold the accelerations, or remove them"
        )
    return np.asarray(a / gravity)


def earth_rate_warning(table: Table) -> str | None:
    """A warning that the earth's rate is not subtracted; None where it is."""
    if not table.type.turning or "latitude_deg" in table.constants:
        return None
    return (
        f"the earth's rotation, {EARTH_DEG_S:.4f} deg/s at most, is part of the bias here, because the latitude is "
        "unknown; give the constant latitude_deg"
    )


def _varied_rate(table: Table) -> Array:
    rate = table.column("rate_deg_s")
    if not np.ptp(rate):
        raise DataError(
            f'{table.source}: the column "rate_deg_s" never changes; turn the gyroscope at several rates, in both '
            "directions"
        )
    return rate


def vertical_deg_s(table: Table) -> float:
    """The earth's rotation about the vertical; 0 where the latitude is not known."""
    return float(EARTH_DEG_S * np.sin(np.radians(table.number("latitude_deg", 0.0))))


def _up(table: Table) -> Array:
    """The vertical in the sensor's frame, shape (n, 3); the table's axis without an accelerometer."""
    if all(f"a{axis}" in table for axis in AXES):
        return unit_vectors(specific_force_g(table))
    return turn_axes(table)


def _upright(table: Table) -> Array:
    """The edge nearest to the vertical, with its sign. Raises DataError for a turn about no edge."""
    up = _up(table)
    rows, nearest = np.arange(table.n), np.argmax(np.abs(up), axis=1)
    oblique = (np.abs(up[rows, nearest]) < UPRIGHT_COSINE) & (table.column("rate_deg_s") != 0)
    if oblique.any():
        raise DataError(
            f"{table.source}: row {int(np.argmax(oblique)) + 1} is a turn without a vertical edge of the sensor; "
            "give the axis of each turn in the columns axis_x, axis_y, axis_z"
        )
    axis = np.zeros_like(up)
    axis[rows, nearest] = np.sign(up[rows, nearest])
    return axis


def _unit(vectors: Array, table: Table) -> Array:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not np.all(size > 0):
        row = int(np.argmin(size)) + 1
        raise DataError(f"{table.source}: row {row} has no axis: axis_x, axis_y and axis_z are 0; give its direction")
    return np.asarray(vectors / size)
