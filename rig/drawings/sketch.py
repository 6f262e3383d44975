"""The table of beta in a terminal: braille dots, two by four to a character."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rig.drawings.attitude import Attitude

COLUMNS, ROWS = 26, 13  # characters; a dot is as wide as it is high on most terminals
DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
BLANK = 0x2800
TABLE, AXIS, BOARD = 23.0, 16.0, 7.0  # dots from the middle


def sketch(attitude: Attitude) -> list[str]:
    """Lines for a terminal: the table's rim, its zero mark, the sensor with pin 1, its axes with their names."""
    dots = np.zeros((4 * ROWS, 2 * COLUMNS), bool)
    x_deg = -(attitude.beta_deg + attitude.mount_deg)
    y_deg = x_deg + (-90 if attitude.flip else 90)
    _set(dots, (_polar(TABLE, deg) for deg in range(0, 360, 4)))
    _set(dots, (_polar(r, -attitude.beta_deg) for r in (TABLE + 1, TABLE + 2, TABLE - 1, TABLE - 2)))
    corners = [_polar(BOARD * 1.414, x_deg + 45 + 90 * k) for k in range(5)]
    for a, b in pairwise(corners):
        _set(dots, _line_points(a, b))
    for deg in (x_deg, y_deg):
        _set(dots, _line_points((0, 0), _polar(AXIS, deg)))
    lines = [
        [chr(BLANK + _code(dots[4 * r : 4 * r + 4, 2 * c : 2 * c + 2])) for c in range(COLUMNS)] for r in range(ROWS)
    ]
    for name, deg in (("x", x_deg), ("y", y_deg)):
        column, row = _character(_polar(AXIS + 3, deg))
        lines[row][column] = name
    pin = _polar(BOARD * 0.75, x_deg + (225 if attitude.flip else 135))
    column, row = _character(pin)
    lines[row][column] = "o"
    return ["".join(line) for line in lines]


def _polar(radius: float, deg: float) -> tuple[float, float]:
    return radius * float(np.cos(np.radians(deg))), radius * float(np.sin(np.radians(deg)))


def _line_points(a: tuple[float, float], b: tuple[float, float]) -> list[tuple[float, float]]:
    steps = np.linspace(0, 1, 2 + int(np.hypot(b[0] - a[0], b[1] - a[1])))
    return [(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])) for t in steps]


def _place(point: tuple[float, float]) -> tuple[int, int]:
    """(column, row) of a dot."""
    return round(COLUMNS - 0.5 + point[0]), round(2 * ROWS - 0.5 - point[1])


def _character(point: tuple[float, float]) -> tuple[int, int]:
    column, row = _place(point)
    return column // 2, row // 4


def _set(dots: NDArray[np.bool_], points: Iterable[tuple[float, float]]) -> None:
    for column, row in map(_place, points):
        if 0 <= row < dots.shape[0] and 0 <= column < dots.shape[1]:
            dots[row, column] = True


def _code(cell: NDArray[np.bool_]) -> int:
    return sum(
        dot_bit
        for row, row_bits in zip(cell, DOTS, strict=True)
        for on, dot_bit in zip(row, row_bits, strict=True)
        if on
    )
