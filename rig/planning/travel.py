"""How long the stages take from one pose to another, as a session moves them: alpha first, then beta from its side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from calibrations.table import Array
from procedures.session import SHORTEST_APPROACH_DEG, Pose
from rig.bench import Bench
from rig.planning.planned import EXCHANGE_S

REMOUNT_S = 900.0  # a person turns the sensor over, and it takes its temperature again: as seldom as possible
HOME = Pose(0.0, 0.0)


def moves_s(bench: Bench, poses: Sequence[Pose]) -> Array:
    """From each of `poses` to each, shape (n, n)."""
    moves = _Moves.of(bench)
    return np.array([[moves.seconds(a, b) for b in poses] for a in poses])


def from_home_s(bench: Bench, poses: Sequence[Pose]) -> Array:
    """From where both stages stand at 0 with the sensor face up, shape (n,)."""
    moves = _Moves.of(bench)
    return np.array([moves.seconds(HOME, pose) for pose in poses])


@dataclass(frozen=True)
class _Moves:
    """Seconds that each stage needs for a distance, and how far an approach begins beyond a pose."""

    alpha_s: Callable[[float], float]
    beta_s: Callable[[float], float]
    overrun_deg: float

    @staticmethod
    def of(bench: Bench) -> _Moves:
        alpha, beta = (bench.instruments[role].typed_settings().move_s for role in ("alpha", "beta"))
        return _Moves(cache(alpha), cache(beta), bench.limits.overrun_deg)

    def seconds(self, start: Pose, end: Pose) -> float:
        """Of all moves from one pose to another, and of a remount."""
        way_deg = end.beta_deg - start.beta_deg
        beta_deg = [abs(way_deg)]
        if end.direction and way_deg * end.direction < SHORTEST_APPROACH_DEG:
            beta_deg = [abs(way_deg - end.direction * self.overrun_deg), self.overrun_deg]
        moves = [(self.alpha_s, abs(end.alpha_deg - start.alpha_deg)), *((self.beta_s, deg) for deg in beta_deg)]
        remount_s = REMOUNT_S * ((end.mount_deg, end.flip) != (start.mount_deg, start.flip))
        return remount_s + sum(move_s(deg) + EXCHANGE_S for move_s, deg in moves if deg)
