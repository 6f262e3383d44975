"""The tumble test: four positions at which the in-plane axes feel +1 g, 0 and -1 g, with beta rising and falling."""

from __future__ import annotations

from collections.abc import Iterator

from procedures.session import Pose

QUARTERS_DEG = (0.0, 90.0, 180.0, 270.0)


def tumble(path: str) -> Iterator[Pose]:
    """The four positions with beta rising, then falling: a drift linear in time then has the same mean at each."""
    for beta_deg in QUARTERS_DEG:
        yield Pose(90.0, beta_deg, 1, path)
    for beta_deg in reversed(QUARTERS_DEG):
        yield Pose(90.0, beta_deg, -1, path)


def is_first(pose: Pose) -> bool:
    """Whether `pose` is the first of a tumble."""
    return (pose.beta_deg, pose.direction) == (QUARTERS_DEG[0], 1)
