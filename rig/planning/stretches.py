"""A plan in a few lines: poses of one path are a stretch, and what is done besides moving and recording is named."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from procedures.session import Pose
from rig.planning.plan import Plan

PLAIN = re.compile(
    r"(alpha|beta) (from|seeks|turns|brakes)|adc records|wait |level is read"
)  # steps that go without saying
COUNTER = re.compile(r"\s*(\d+)$")  # of a path: "still 3" is the third of one stretch
LONG_WAIT_S = 30.0


@dataclass(frozen=True)
class Stretch:
    """Poses in a row, the first dwell of which begins at `start_s`; `also` is what else is done on the way there."""

    start_s: float
    poses: tuple[Pose, ...]
    also: tuple[str, ...]

    @property
    def words(self) -> str:
        """In one line."""
        number = f"{len(self.poses)} pose{'s' * (len(self.poses) > 1)}"
        alpha, beta = _range([p.alpha_deg for p in self.poses]), _range([p.beta_deg for p in self.poses])
        return "  ".join([f"alpha {alpha}, beta {beta} deg: {number}", *_named(self.poses)])


def stretches(plan: Plan) -> list[Stretch]:
    """All poses of a plan, in order."""
    found, before_s = [], 0.0
    for _, group in groupby(plan.held, lambda held: _kind(held.pose)):
        held = list(group)
        also = tuple(_besides(plan, before_s, held[-1].start_s))
        found.append(Stretch(held[0].start_s, tuple(each.pose for each in held), also))
        before_s = held[-1].start_s
    return found


def _kind(pose: Pose) -> tuple[str, float, int]:
    return COUNTER.sub("", pose.path), pose.mount_deg, pose.flip


def _besides(plan: Plan, from_s: float, to_s: float) -> Iterator[str]:
    """What is done between two moments that is no plain step, each once, and how long is waited where it is long."""
    mine = [step for step in plan.steps if from_s <= step.start_s < to_s]
    yield from dict.fromkeys(step.what for step in mine if not PLAIN.match(step.what))
    waited_s = sum(step.duration_s for step in mine if step.what.startswith("wait ") and step.duration_s >= LONG_WAIT_S)
    if waited_s:
        yield f"waiting for {waited_s:g} s"


def _range(angles_deg: Sequence[float]) -> str:
    first, last = angles_deg[0], angles_deg[-1]
    low, high = min(angles_deg), max(angles_deg)
    if low == high:
        return f"{low:g}"
    return f"{first:g} to {last:g}" if {first, last} == {low, high} else f"{low:g} .. {high:g}"


def _named(poses: Sequence[Pose]) -> Iterator[str]:
    """The path, and how the sensor is mounted where that is not as usual."""
    numbers = [match[1] for pose in (poses[0], poses[-1]) if (match := COUNTER.search(pose.path))]
    path = COUNTER.sub("", poses[0].path)
    counted = [*dict.fromkeys(numbers)]
    if path:
        yield f"{path} {' to '.join(counted)}".rstrip()
    if rates := sorted({abs(pose.rate_deg_s) for pose in poses} - {0.0}):
        yield f"at {', '.join(f'{rate:g}' for rate in rates)} deg/s both ways"
    if poses[0].mount_deg or poses[0].flip:
        yield f"mounted face {'down' if poses[0].flip else 'up'}, turned by {poses[0].mount_deg:g} deg"
