"""The floor: it shakes the rig at one frequency, as a machine next door does.

To first order: the shaking's share along a sensing beam times the sensitivity, behind the output filter. The carriage's
own motion, which is large, goes through the whole mechanics (see mechanics).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.simulation.kernel import Floats, kernel, shared


@dataclass(frozen=True)
class Floor:
    """Amplitudes of its acceleration in g, in the frame of the base."""

    shaking_up_g: float = 0.0
    shaking_along_g: float = 0.0  # along the base's x axis
    shaking_hz: float = 24.0


@kernel
def acceleration_g(floor: Floor) -> Floats:
    """Amplitude in the frame of the base, shape (3,)."""
    return np.array([floor.shaking_along_g, 0.0, floor.shaking_up_g])


@kernel
def shakes(floor: Floor) -> bool:
    """Whether it does at all."""
    return floor.shaking_up_g != 0 or floor.shaking_along_g != 0


@shared
def passed(floor: Floor, filter_s: float) -> tuple[float, float]:
    """Gain of a low-pass of time constant `filter_s` at the floor's frequency, and its lag, rad."""
    turn = 2 * math.pi * floor.shaking_hz * filter_s
    return 1 / math.hypot(1.0, turn), math.atan(turn)
