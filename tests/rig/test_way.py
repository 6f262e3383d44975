"""The way that the model takes the stages to have gone is the way that the session goes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibrations.criteria import SHORTEST_APPROACH_DEG
from calibrations.effects.kernels import slip
from calibrations.geometry.orientation import Pose as Angles
from calibrations.geometry.orientation import specific_force
from calibrations.geometry.stage_path import sensed_turning_points
from calibrations.table import Array, Table
from procedures.session import SHORTEST_APPROACH_DEG as SESSION_DEG
from procedures.session import Limits, Pose, Session
from procedures.sweep import grid
from rig.bench import read_bench

LIMITS = np.repeat([[0.02], [0.2], [0.7]], 3, axis=1)  # of three elements along each axis, g
IDEAL = np.eye(3)
TURNED = Rotation.from_euler("xyz", [1.5, -0.8, 0.4], degrees=True).as_matrix()  # a sensor at an angle in its package


@dataclass
class Way:
    """All angles (alpha, beta) that two stages go through, in quarters of a degree."""

    points: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.0)])


@dataclass
class Stage:
    """One of the two: it adds each of its moves to the way."""

    way: Way
    axis: int

    def move_to(self, deg: float) -> None:
        before = self.way.points[-1]
        for angle in np.linspace(before[self.axis], deg, 2 + int(4 * abs(deg - before[self.axis])))[1:]:
            self.way.points.append((angle, before[1]) if self.axis == 0 else (before[0], angle))

    def angle_deg(self) -> float:
        return self.way.points[-1][self.axis]


class Silent:
    def doing(self, text: str) -> None: ...

    def readings(self) -> tuple[()]:
        return ()


def gone(poses: list[Pose]) -> tuple[Array, list[int]]:
    """Specific force all along the session's way, and where on it the poses are."""
    way, parts, places = Way(), {}, []
    parts |= {
        "adc": None,
        "oven": None,
        "level": None,
        "positioner": None,
        "clock": None,
        "host": Silent(),
        "limits": Limits(),
    }
    session = Session(alpha=Stage(way, 0), beta=Stage(way, 1), **parts)
    for pose in poses:
        session.move_to(pose)
        places.append(len(way.points) - 1)
    alpha, beta = np.radians(way.points).T
    none = np.zeros(len(alpha))
    return specific_force(Angles(alpha, beta, none, none, np.array([0.0, 0.0, 1.0]))), places


def random_poses() -> list[Pose]:
    random = np.random.default_rng(3)
    angles = random.uniform([-150, -180], [150, 360], (60, 2))
    return [Pose(a, b, int(d)) for (a, b), d in zip(angles, random.integers(-1, 2, 60), strict=True)]


@pytest.mark.parametrize(("mounted", "tolerance"), [(IDEAL, 2e-4), (TURNED, 5e-3)])
@pytest.mark.parametrize("poses", [random_poses(), list(grid((90.0, 30.0, 135.0), 10.0, "ang"))])
def test_the_session_and_the_model_have_the_same_path_of_the_stages(
    poses: list[Pose], mounted: Array, tolerance: float
) -> None:
    columns: dict[str, Any] = {
        "alpha_deg": [pose.alpha_deg for pose in poses],
        "beta_deg": [pose.beta_deg for pose in poses],
        "direction": [pose.direction for pose in poses],
        "t_s": np.arange(len(poses)),
        "vx_v": np.zeros(len(poses)),
    }
    table = Table.from_columns("poses", columns, read_bench().constants)
    path, places = gone(poses)
    path = path @ mounted.T
    felt = slip(path, path[:, None], np.ones_like(path), LIMITS, np.zeros(3))[places]
    a = path[places]
    remembered = slip(a, sensed_turning_points(table, a), np.ones_like(a), LIMITS, np.zeros(3))
    # The way is sampled every quarter degree. Between poses, the force of a turned sensor turns round 2 deg beside the
    # angles of an ideal one; along z, which beta does not change in an ideal one, it turns where none is expected.
    measured = slice(None) if mounted is IDEAL else slice(2)
    np.testing.assert_allclose(remembered[:, measured], felt[:, measured], atol=tolerance)
    assert SHORTEST_APPROACH_DEG == SESSION_DEG
