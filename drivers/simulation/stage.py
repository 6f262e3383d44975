"""A rotary stage: from the motor's angle to where the table really points.

motor angle -> gear play (the table lags in the direction of approach) -> zero offset, wobble, worm gear
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.simulation.kernel import Floats, kernel
from drivers.simulation.trajectory import Trajectory

AXES = ("alpha", "beta")
PIECES = 5  # a trapezoid has three pieces and a rest; a stop adds one


@dataclass(frozen=True)
class Stage:
    """One stage's imperfections; the drive's own speed and resolution are not the world's."""

    zero_offset_deg: float = 0.0  # true angle at motor angle 0
    play_deg: float = 0.0  # full width of the gear play
    wobble_deg: float = 0.0  # amplitude of one cycle per turn (eccentric bearing)
    wobble_phase_deg: float = 0.0  # angle at which that cycle crosses zero rising
    worm_deg: float = 0.0  # amplitude of the worm gear's periodic error
    worm_cycles: float = 5.0  # its cycles per turn


def motion(trajectory: Trajectory) -> Floats:
    """A trajectory as the kernels read it: shape (PIECES, 4), its pieces and then its rest."""
    pieces = trajectory.pieces()
    return np.array([*pieces, *pieces[-1:] * (PIECES - len(pieces))])


@kernel
def motor_angle_deg(pieces: Floats, t_s: float) -> float:
    """Angle on a table of (start in s, angle in deg, rate in deg/s, acceleration in deg/s^2), at `t_s`."""
    k = 0
    while k + 1 < len(pieces) and pieces[k + 1, 0] <= t_s:
        k += 1
    dt = max(0.0, t_s - pieces[k, 0])
    angle_deg: float = pieces[k, 1] + dt * (pieces[k, 2] + dt * pieces[k, 3] / 2)
    return angle_deg


@kernel
def engaged_deg(stage: Stage, table_deg: float, motor_deg: float) -> float:
    """Where the table stands behind the gear play, given where it stood."""
    half = stage.play_deg / 2
    return min(max(table_deg, motor_deg - half), motor_deg + half)


@kernel
def true_angle_rad(stage: Stage, table_deg: float) -> float:
    """The angle that the table really has in the laboratory."""
    wobble = stage.wobble_deg * math.sin(math.radians(table_deg - stage.wobble_phase_deg))
    worm = stage.worm_deg * math.sin(math.radians(stage.worm_cycles * table_deg))
    return math.radians(table_deg + stage.zero_offset_deg + wobble + worm)
