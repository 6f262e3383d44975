"""What a gyroscope on a turning table should feel: the angular rate along its reference axes, and the earth's.

    w = rate e + W sin(latitude) u        W = 0.0041781 deg/s; e the axis of the table, u the vertical, unit vectors

The axis in the sensor's frame is given by the columns axis_x, axis_y, axis_z. Else it is vertical, and the edge of the
sensor that the columns ax, ay, az show to stand upright; without them it is the edge whose output follows the rate. A
rate is positive about its axis by the right hand. Of the earth's rotation the horizontal part goes round in the
sensor's frame and averages out over whole turns; at rest it is in the bias, W cos(latitude) at most.

Source  IEEE Std 1431, tests on a rate table; IERS Conventions (2010), the earth's rotation.
"""

from __future__ import annotations

import numpy as np

from calibrations.errors import DataError
from calibrations.evaluations.six_faces import faces
from calibrations.table import AXES, Array, Table

EARTH_DEG_S = np.degrees(7.292115e-5)
UPRIGHT = 0.94  # cosine between an edge and the vertical: 20 deg
HARDLY = 0.01  # of the mean square rate about another axis: 6 deg off it
DOMINANT = 0.8  # of all outputs' slopes over the rate, by the edge that was turned about


def rate_deg_s(table: Table) -> Array:
    """Angular rate along the sensor's reference axes, deg/s, shape (n, 3), as far as it is known."""
    turned = table.column("rate_deg_s")[:, None] * axes_of_turn(table)
    return turned + _vertical_deg_s(table) * _up(table)


def axes_of_turn(table: Table) -> Array:
    """The axis that each row was turned about, unit vectors in the sensor's frame, shape (n, 3).

    Raises DataError where nothing tells it.
    """
    if all(f"axis_{axis}" in table for axis in AXES):
        return _unit(np.column_stack([table.column(f"axis_{axis}") for axis in AXES]), table)
    if all(f"a{axis}" in table for axis in AXES):
        return _upright(table)
    found = np.abs(slopes(table))
    if found.max() < DOMINANT * np.linalg.norm(found):
        raise DataError(
            f"{table.source}: more than one output follows the rate, and nothing tells the axis of each turn; add the "
            "columns axis_x, axis_y, axis_z (1, 0, 0 for a turn about x), or ax, ay, az"
        )
    return np.tile(np.eye(3)[np.argmax(found)], (table.n, 1))


def slopes(table: Table) -> Array:
    """Output of each axis per deg/s of the table's rate, shape (3,). Raises DataError where the rate never changes."""
    rate = _changing(table)
    away = rate - rate.mean()
    return np.asarray(away @ table.outputs / (away @ away))


def scales(table: Table) -> Array:
    """Output of each axis per deg/s about itself, shape (3,); 0 for an axis that was not turned about, or hardly.

    Raises DataError where the rate never changes.
    """
    rate = _changing(table)[:, None] * axes_of_turn(table)
    away = rate - rate.mean(axis=0)
    squares = np.sum(away**2, axis=0)
    turned = squares > HARDLY * squares.max()
    return np.where(turned, np.sum(away * table.outputs, axis=0) / np.where(turned, squares, 1.0), 0.0)


def specific_force_g(table: Table) -> Array:
    """Specific force by the columns ax, ay, az, g, shape (n, 3): by six faces where they were held, else by size.

    Raises DataError where there is none.
    """
    a = np.column_stack([table.column(f"a{axis}") for axis in AXES])
    still = table.column("rate_deg_s") == 0
    held = faces(a[still]) if still.any() else None
    if held is not None:
        return (a - held.bias) / held.scale
    gravity = float(np.median(np.linalg.norm(a, axis=1)))
    if not gravity > 0:
        raise DataError(f"{table.source}: ax, ay and az are 0; leave the columns out where no accelerometer was read")
    return np.asarray(a / gravity)


def earth_unknown(table: Table) -> str | None:
    """What cannot be said of the earth's rotation in a table of rates, in words; None where it is accounted for."""
    if table.kind != "rates" or "latitude_deg" in table.constants:
        return None
    return (
        f"the earth's rotation, {EARTH_DEG_S:.4f} deg/s at most, is not taken off the rates, as the latitude is not "
        "known: it is in the bias; give the constant latitude_deg"
    )


def _changing(table: Table) -> Array:
    rate = table.column("rate_deg_s")
    if not np.ptp(rate):
        raise DataError(
            f'{table.source}: the column "rate_deg_s" never changes; a gyroscope is turned at several rates, both ways'
        )
    return rate


def _vertical_deg_s(table: Table) -> float:
    """The earth's rotation about the vertical; 0 where the latitude is not known."""
    return float(EARTH_DEG_S * np.sin(np.radians(table.number("latitude_deg", 0.0))))


def _up(table: Table) -> Array:
    """The vertical in the sensor's frame, shape (n, 3); that of the table's axis where no accelerometer tells it."""
    if all(f"a{axis}" in table for axis in AXES):
        a = specific_force_g(table)
        return np.asarray(a / np.linalg.norm(a, axis=1, keepdims=True))
    return axes_of_turn(table)


def _upright(table: Table) -> Array:
    """The edge nearest to the vertical, with its sign. Raises DataError for a turn about none."""
    up = _up(table)
    rows, nearest = np.arange(table.n), np.argmax(np.abs(up), axis=1)
    oblique = (np.abs(up[rows, nearest]) < UPRIGHT) & (table.column("rate_deg_s") != 0)
    if oblique.any():
        raise DataError(
            f"{table.source}: row {int(np.argmax(oblique)) + 1} was turned while no edge of the sensor stood upright; "
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
