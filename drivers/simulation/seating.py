"""No two mountings are alike: how the package sits on the table, and how its clamp grips it, is anew each time.

A grip bends the package, which displaces the proof mass; each sensor of a batch has its own clamp on one plate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.simulation.gravity import rotation
from drivers.simulation.kernel import Floats

TILT, GRIP = 4, 5  # of the seeds: what belongs to the plate, and to each clamp


@dataclass(frozen=True)
class Seating:
    """Standard deviations from one mounting to the next."""

    tilt_deg: float = 0.0  # of the plate, about each of its axes
    grip_pm: float = 0.0  # displacement of the mass along each sensing axis


def seated(seating: Seating, seed: int, place: int, now_ns: int) -> tuple[Floats, Floats]:
    """(rotation of the plate, displacement in nm) of a mounting at `now_ns`; time and seed alone settle it."""
    tilts_deg = seating.tilt_deg * np.random.default_rng([seed, TILT, now_ns]).standard_normal(3)
    grips_pm = seating.grip_pm * np.random.default_rng([seed, GRIP, now_ns, place]).standard_normal(2)
    return rotation(*tilts_deg), 1e-3 * grips_pm
