"""A tumble test: the four positions in which each in-plane axis feels +1 g, 0 and -1 g, from both sides."""

from __future__ import annotations

from collections.abc import Iterator

from procedures.session import Pose

QUARTERS_DEG = (0.0, 90.0, 180.0, 270.0)


def tumble(path: str) -> Iterator[Pose]:
    """Up and down again, so that what changes evenly in time is the same for every position."""
    for beta_deg in QUARTERS_DEG:
        yield Pose(90.0, beta_deg, 1, path)
    for beta_deg in reversed(QUARTERS_DEG):
        yield Pose(90.0, beta_deg, -1, path)


def is_first(pose: Pose) -> bool:
    """Whether `pose` begins a tumble: what shall come before one is done before it, and not again on the way."""
    return (pose.beta_deg, pose.direction) == (QUARTERS_DEG[0], 1)
