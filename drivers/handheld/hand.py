"""A simulated hand that turns a sensor to a wanted orientation, puts it down, and lets it go.

Only the direction upward matters to an accelerometer, so an orientation is this direction in the frame of the sensor.
A hand is not exact: it trembles, misses the orientation, sometimes takes a wrong one, holds on for too long, or picks
the sensor up too early; the table is not level, and the sensor sometimes slips after it was let go.

Source  Elble, J. Clinical Neurophysiology 13 (1996), 133-144: physiological tremor of a hand, 8 to 12 Hz.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from drivers.world.kernel import Floats

TREMOR_HZ = (7.0, 8.3, 9.1, 10.4, 11.8)
BUMP_HZ, BUMP_S = 25.0, 0.08
SLIP_S = 0.4


@dataclass(frozen=True)
class Hand:
    """How a person handles a sensor. Shares are probabilities for one position."""

    reaction_s: float = 0.8
    turning_deg_s: float = 90.0
    letting_go_s: float = 0.8
    patience_s: float = 10.0  # median time at rest after which it is picked up again, without being told
    tremor_g: float = 0.03  # rms of the acceleration along each axis
    tremor_deg: float = 0.4
    bump_g: float = 0.2  # of putting it down
    side_deg: float = 0.7  # standard deviation of a whole side on the table
    aim_deg: float = 8.0  # of an edge or a corner that leans on something
    table_deg: float = 2.0  # tilt of the table
    slips: float = 0.1
    slip_deg: float = 2.0
    errs: float = 0.05  # takes a wrong orientation
    clings: float = 0.1  # holds the sensor for a while before it lets go
    clings_s: float = 5.0


@dataclass(frozen=True)
class Segment:
    """From `start_s` to `end_s` the direction upward goes from `before` to `after`, both unit vectors.

    `tremor`: share of the hand's tremor that reaches the sensor. `bumps`: whether it was put down at `start_s`.
    """

    start_s: float
    end_s: float
    before: tuple[float, float, float]
    after: tuple[float, float, float]
    tremor: float = 0.0
    bumps: bool = False


class Script:
    """What a hand does from now on: segments in the order of time. It is picked up again at the end of the last."""

    def __init__(self, hand: Hand, random: np.random.Generator, up: Floats) -> None:
        self._hand, self._random = hand, random
        self._wanted = up
        self._table = _perturb(np.array([0.0, 0.0, 1.0]), hand.table_deg, random)
        direction = _as_tuple(self._on_table(up))
        self.segments = [Segment(0.0, math.inf, direction, direction)]

    def turn_to(self, up: Floats, now_s: float) -> None:
        """Begin to turn the sensor until `up` (3,) is upward, after the reaction time."""
        self._wanted = np.asarray(up, dtype=float)
        direction = self.up(np.array([now_s]))[0]
        recent = [s for s in self.segments if s.start_s <= now_s and s.end_s > now_s - 1]
        self.segments = [Segment(s.start_s, min(s.end_s, now_s), s.before, s.after, s.tremor, s.bumps) for s in recent]
        self._plan(direction, now_s, self._hand.reaction_s)

    def force_g(self, times_s: Floats) -> Floats:
        """Specific force in the frame of the sensor at rising times (n,), shape (n, 3)."""
        self._plan_until(float(times_s[-1]))
        force = np.empty((len(times_s), 3))
        for segment in self.segments:
            in_segment = (times_s >= segment.start_s) & (times_s < segment.end_s)
            if in_segment.any():
                force[in_segment] = self._segment_force(segment, times_s[in_segment])
        return force

    def up(self, times_s: Floats) -> Floats:
        """Directions upward at rising times (n,), without tremor, shape (n, 3)."""
        self._plan_until(float(times_s[-1]))
        up = np.empty((len(times_s), 3))
        for segment in self.segments:
            in_segment = (times_s >= segment.start_s) & (times_s < segment.end_s)
            up[in_segment] = _turn_slowly(segment, times_s[in_segment])
        return up

    def state(self) -> dict[str, Any]:
        """What it remembers, as JSON. An endless segment has no end."""
        segments = [asdict(s) | {"end_s": None if math.isinf(s.end_s) else s.end_s} for s in self.segments]
        return {"wanted": self._wanted.tolist(), "table": self._table.tolist(), "segments": segments}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from what `state` gave."""
        self._wanted, self._table = np.array(state["wanted"]), np.array(state["table"])
        self.segments = [
            Segment(
                s["start_s"], math.inf if s["end_s"] is None else s["end_s"], tuple(s["before"]), tuple(s["after"]),
                s["tremor"], s["bumps"],
            )
            for s in state["segments"]
        ]  # fmt: skip

    def _plan_until(self, t_s: float) -> None:
        while self.segments[-1].end_s <= t_s:
            last = self.segments[-1]
            self._plan(np.array(last.after), last.end_s, 0.0)

    def _plan(self, direction: Floats, now_s: float, reaction_s: float) -> None:
        """Pick the sensor up after `reaction_s`, turn it, put it down, let it go, and leave it for a while."""
        hand, random = self._hand, self._random
        chance, size = random.random(3), random.standard_normal(2)
        target = self._aim(chance[0])
        turn_s = math.degrees(_angle(direction, target)) / hand.turning_deg_s + 0.5
        self._add(now_s, reaction_s, direction, direction)
        self._add(self._end(now_s), turn_s, direction, target, 1.0)
        clings_s = hand.clings_s * math.exp(0.3 * size[0]) if chance[1] < hand.clings else 0.0
        self._add(self._end(now_s), hand.letting_go_s + clings_s, target, target, 0.3)
        slips = chance[2] < hand.slips
        patience_s = hand.patience_s * math.exp(0.4 * size[1])
        self._add(self._end(now_s), 1.0 if slips else patience_s, target, target, 0.0, True)
        if slips:
            slipped = _perturb(target, hand.slip_deg, random)
            self._add(self._end(now_s), SLIP_S, target, slipped)
            self._add(self._end(now_s), patience_s, slipped, slipped)

    def _add(
        self, start_s: float, length_s: float, start: Floats, end: Floats, tremor: float = 0.0, bumps: bool = False
    ) -> None:
        self.segments.append(Segment(start_s, start_s + length_s, _as_tuple(start), _as_tuple(end), tremor, bumps))

    def _end(self, now_s: float) -> float:
        return self.segments[-1].end_s if self.segments else now_s

    def _aim(self, chance: float) -> Floats:
        """Where the hand puts the sensor: near the wanted orientation, or a wrong one."""
        direction = self._wanted
        if chance < self._hand.errs:
            direction = np.roll(direction, 1) * np.array([1.0, -1.0, 1.0])
        return self._on_table(direction)

    def _on_table(self, direction: Floats) -> Floats:
        hand = self._hand
        leaning = np.abs(direction).max() < 0.99
        placed = _perturb(direction, hand.aim_deg if leaning else hand.side_deg, self._random)
        tilt = self._table - np.array([0.0, 0.0, 1.0])
        return _unit(placed + np.roll(tilt, int(np.argmax(np.abs(direction))) + 1))

    def _segment_force(self, segment: Segment, times_s: Floats) -> Floats:
        hand, force = self._hand, _turn_slowly(segment, times_s)
        if segment.tremor:
            swing = segment.tremor * np.sqrt(2 / len(TREMOR_HZ))
            turns = 2 * np.pi * np.outer(times_s, TREMOR_HZ)
            tremor = np.stack([np.sin(turns + 1.7 * k + np.arange(len(TREMOR_HZ)) ** 2).sum(axis=1) for k in range(6)])
            tilted = np.cross(force, math.radians(hand.tremor_deg) * swing * tremor[:3].T)
            force = force + tilted + hand.tremor_g * swing * tremor[3:].T
        if segment.bumps:
            after_s = times_s - segment.start_s
            bump = hand.bump_g * np.exp(-after_s / BUMP_S) * np.cos(2 * np.pi * BUMP_HZ * after_s)
            force = force + bump[:, None] * np.array(segment.after)
        return force


def _turn_slowly(segment: Segment, times_s: Floats) -> Floats:
    """Directions between both ends of a segment: along the great circle, slowly at both ends."""
    start, end = np.array(segment.before), np.array(segment.after)
    angle = _angle(start, end)
    if angle < 1e-9:
        return np.repeat(end[None], len(times_s), axis=0)
    perpendicular = end - (end @ start) * start
    if np.linalg.norm(perpendicular) < 1e-6:  # upside down: over any side
        perpendicular = np.cross(start, np.eye(3)[int(np.argmin(np.abs(start)))])
    perpendicular = _unit(perpendicular)
    share = (times_s - segment.start_s) / (segment.end_s - segment.start_s)
    turned = angle * share**2 * (3 - 2 * share)
    return np.asarray(np.outer(np.cos(turned), start) + np.outer(np.sin(turned), perpendicular))


def _perturb(direction: Floats, std_deg: float, random: np.random.Generator) -> Floats:
    """A direction turned by a normal angle about two axes."""
    offset = math.radians(std_deg) * random.standard_normal(3)
    return _unit(direction + np.cross(offset, direction))


def _angle(first: Floats, second: Floats) -> float:
    return math.acos(min(1.0, max(-1.0, float(first @ second))))


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


def _as_tuple(vector: Floats) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in vector)
    return x, y, z
