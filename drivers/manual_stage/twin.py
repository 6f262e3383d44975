"""The simulated hand at a stage of the world: it sets the dial as well as a hand can, and reads it to its marks.

It serves nothing: its wire is a person, so whoever answers for the simulated technician turns it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from drivers.manual_stage.driver import Settings
from drivers.transport.address import Address
from drivers.transport.person import PERSON
from drivers.transport.server import Server
from drivers.world.stage import Trajectory

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

LISTEN = PERSON
TURNING_DEG_S = 30.0
TURNING_DEG_S2 = 60.0
SETTING = 0.25  # of a mark: standard deviation
LARGEST_MISS = 0.45  # of a mark, of setting: nearer than half of one it seems to be set
READING_STD = 0.1  # of a mark: standard deviation of telling which is nearest
NANO = 1e-9


class Hand:
    """The simulated hand at the world's `axis`. Its actions depend on `seed`, time and angle only: they repeat."""

    def __init__(self, world: AnyWorld, axis: str, settings: Settings, seed: int) -> None:
        self._world, self._axis, self._mark_deg, self._seed = world, axis, settings.resolution_deg, seed

    def turn_to(self, angle_deg: float) -> Trajectory | None:
        """Begin to turn the stage to where its dial seems to show `angle_deg`; None where it does already."""
        from_deg = self._world.motor_angle_deg(self._axis)
        if abs(from_deg - angle_deg) <= self._mark_deg / 2:
            return None
        missed = np.clip(SETTING * self._normal(self._world.now_s), -LARGEST_MISS, LARGEST_MISS)
        to_deg = angle_deg + self._mark_deg * float(missed)
        turn = Trajectory(self._world.now_s, from_deg, to_deg, TURNING_DEG_S, TURNING_DEG_S2)
        self._world.move_stage(self._axis, turn)
        return turn

    def read_deg(self) -> float:
        """The mark of the dial that seems nearest."""
        angle_deg = self._world.motor_angle_deg(self._axis)
        reading_deg = angle_deg / self._mark_deg + READING_STD * self._normal(angle_deg)
        return round(reading_deg) * self._mark_deg

    def _normal(self, place: float) -> float:
        """A normal number that belongs to a time or an angle."""
        return float(np.random.default_rng([self._seed, abs(round(place / NANO)), len(self._axis)]).standard_normal())


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:  # noqa: ARG001
    """Serves no port: the address of each role is that of a person."""
    return Server([], {}, {role: Address(PERSON) for role in roles})
