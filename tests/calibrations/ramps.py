"""Still records of a sensor at rest while an oven warms and cools it. Nothing here is shared with the effects.

The die is a mass that a resistance connects to the board, and the thermometer another one. The zero of the sensor is
the difference of two springs whose stiffness changes with temperature; a glue joint slips where it is strained.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.calibrations.hidden_noise import lagged

Array = NDArray[np.float64]
RATE_HZ = 1.0
SAMPLES = 14_400  # 4 h


def oven(cycles: float = 1.5) -> Array:
    """Board temperature in C: up to 60 and down to 20 in straight ramps."""
    phase = np.arange(SAMPLES) / SAMPLES * cycles
    return 20 + 40 * (1 - np.abs(1 - 2 * (phase % 1)))


def follower(board_c: Array, delay_s: float) -> Array:
    """The temperature of a mass on the board."""
    return lagged(board_c, delay_s * RATE_HZ)


def slipping(die_c: Array, grip_c: float) -> Array:
    """Temperature at which the glue is free of strain: it follows the die only beyond its grip."""
    out, free = np.empty(len(die_c)), float(die_c[0])
    for k, now in enumerate(die_c):
        free = min(max(free, now - grip_c), now + grip_c)
        out[k] = free
    return out


def record(
    random: np.random.Generator, *, line: float = 0.0, bow: float = 0.0, glue: float = 0.0, delay_s: float = 0.0
) -> tuple[Array, Array]:
    """(output in V, thermometer in C): V/K, V at 20 K from the middle, V between branches, s behind the board."""
    board = oven()
    die = follower(board, delay_s) if delay_s else board
    upper, lower = 1.0 + line / 2 * (die - 40), 1.0 - line / 2 * (die - 40)
    stress = (slipping(die, 2.0) - die) / 2.0
    volts = upper - lower + bow * ((die - 40) / 20) ** 2 - glue / 2 * stress
    return volts + 1e-3 * random.standard_normal(SAMPLES), board + 0.01 * random.standard_normal(SAMPLES)
