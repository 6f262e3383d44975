"""A simulated hand that turns a sensor to a wanted attitude, puts it down, and lets it go.

An attitude is the direction upward and the direction to the north in the frame of the sensor. Only the direction upward
matters to an accelerometer: without a wanted north, the hand turns the sensor by the shortest way. A hand is not exact:
it trembles, misses the attitude, sometimes takes a wrong one, holds on for too long, or picks the sensor up too early;
the table is not level, and the sensor sometimes slips after it was let go.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from drivers.handheld.motion import NORTH, Motion, Segment, Shaking, angle_between, last_north, move, unit
from drivers.world.kernel import Floats

SLIP_S = 0.4


@dataclass(frozen=True)
class Hand:
    """The way in which a person handles a sensor. Shares are probabilities for one position."""

    reaction_s: float = 0.8
    turning_deg_s: float = 90.0
    letting_go_s: float = 0.8
    patience_s: float = 10.0  # median time at rest after which it is picked up again, without being told
    tremor_g: float = 0.03  # rms of the acceleration along each axis
    tremor_deg: float = 0.4
    bump_g: float = 0.2  # of putting it down
    side_deg: float = 0.7  # standard deviation of a whole side on the table
    aim_deg: float = 8.0  # of an edge or a corner that leans on something
    heading_deg: float = 10.0  # of a side that shall point to the north
    place_mm: float = 30.0  # of the place on the table
    table_deg: float = 2.0  # tilt of the table
    slips: float = 0.1
    slip_deg: float = 2.0
    errs: float = 0.05  # takes a wrong orientation
    clings: float = 0.1  # holds the sensor for a while before it lets go
    clings_s: float = 5.0


class Script:
    """The coming movements of a hand, segments in the order of time. After the last one it picks the sensor up."""

    def __init__(self, hand: Hand, random: np.random.Generator, up: Floats) -> None:
        self._hand, self._random = hand, random
        self._wanted = up
        self._wanted_north: Floats | None = None
        self._table = _perturb(np.array([0.0, 0.0, 1.0]), hand.table_deg, random)
        direction = self._table_attitude(up)
        north = unit(np.array(NORTH) - (direction @ NORTH) * direction)
        self.segments = [Segment(0.0, math.inf, _floats(direction), _floats(direction), north=_floats(north))]

    def turn_to(self, up: Floats, now_s: float, north: Floats | None = None) -> None:
        """Begin to turn the sensor until `up` (3,) is upward and `north` (3,) points north, after the reaction time."""
        self._wanted = np.asarray(up, dtype=float)
        self._wanted_north = None if north is None else np.asarray(north, dtype=float)
        attitude = self.motion(np.array([now_s])).attitude[0]
        recent = [s for s in self.segments if s.start_s <= now_s and s.end_s > now_s - 1]
        place_mm = recent[-1].place_mm
        self.segments = [replace(s, end_s=min(s.end_s, now_s)) for s in recent]
        self._plan(attitude[:, 2], attitude[:, 0], place_mm, now_s, self._hand.reaction_s)

    def up(self, times_s: Floats) -> Floats:
        """Directions upward at rising times (n,), shape (n, 3)."""
        return np.asarray(self.motion(times_s).attitude[:, :, 2])

    def motion(self, times_s: Floats) -> Motion:
        """The motion at rising times (n,)."""
        self._plan_until(float(times_s[-1]))
        hand = self._hand
        shaking = Shaking(hand.tremor_g, hand.tremor_deg, hand.bump_g)
        parts = []
        for segment in self.segments:
            in_segment = (times_s >= segment.start_s) & (times_s < segment.end_s)
            if in_segment.any():
                parts.append(move(segment, shaking, times_s[in_segment]))
        fields = zip(*((p.attitude, p.force_g, p.rate_deg_s, p.place_mm) for p in parts), strict=True)
        return Motion(*(np.concatenate(values) for values in fields))

    def state(self) -> dict[str, Any]:
        """The state as JSON. A segment without end has no end time."""
        segments = [asdict(s) | {"end_s": None if math.isinf(s.end_s) else s.end_s} for s in self.segments]
        north = None if self._wanted_north is None else self._wanted_north.tolist()
        return {"wanted": self._wanted.tolist(), "north": north, "table": self._table.tolist(), "segments": segments}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a result of `state`."""
        self._wanted, self._table = np.array(state["wanted"]), np.array(state["table"])
        self._wanted_north = None if state["north"] is None else np.array(state["north"])
        self.segments = [
            Segment(
                **{name: tuple(value) if isinstance(value, list) else value for name, value in segment.items()}
                | {"end_s": math.inf if segment["end_s"] is None else segment["end_s"]}
            )
            for segment in state["segments"]
        ]

    def _plan_until(self, t_s: float) -> None:
        while self.segments[-1].end_s <= t_s:
            last = self.segments[-1]
            self._plan(np.array(last.after), last_north(last), last.place_mm, last.end_s, 0.0)

    def _plan(
        self, direction: Floats, north: Floats, place_mm: tuple[float, float], now_s: float, reaction_s: float
    ) -> None:
        """Pick the sensor up after `reaction_s`, turn it, put it down, let it go, and leave it for a while."""
        hand, random = self._hand, self._random
        chance, size = random.random(3), random.standard_normal(2)
        errs = chance[0] < hand.errs
        target = self._table_attitude(_err(self._wanted) if errs else self._wanted)
        turning = Segment(0.0, 1.0, _floats(direction), _floats(target), 1.0, north=_floats(north))
        heading_rad, next_mm = self._aim_heading(turning, errs), place_mm
        if self._wanted_north is not None:
            across, along = hand.place_mm * random.standard_normal(2)
            next_mm = (float(across), float(along))
        turn_s = math.degrees(max(angle_between(direction, target), abs(heading_rad))) / hand.turning_deg_s + 0.5
        self._add(reaction_s, direction, now_s, north, place_mm)
        self._add(turn_s, target, tremor=1.0, heading_rad=heading_rad, place_mm=next_mm)
        clings_s = hand.clings_s * math.exp(0.3 * size[0]) if chance[1] < hand.clings else 0.0
        self._add(hand.letting_go_s + clings_s, target, tremor=0.3)
        slips = chance[2] < hand.slips
        patience_s = hand.patience_s * math.exp(0.4 * size[1])
        self._add(1.0 if slips else patience_s, target, bumps=True)
        if slips:
            slipped = _perturb(target, hand.slip_deg, random)
            self._add(SLIP_S, slipped)
            self._add(patience_s, slipped)

    def _add(
        self,
        length_s: float,
        after: Floats,
        now_s: float | None = None,
        north: Floats | None = None,
        place_mm: tuple[float, float] | None = None,
        *,
        tremor: float = 0.0,
        bumps: bool = False,
        heading_rad: float = 0.0,
    ) -> None:
        """Add a segment that ends with `after` upward; omitted arguments are as at the end of the last one."""
        last = self.segments[-1]
        start_s = last.end_s if now_s is None else now_s
        before = _floats(after) if now_s is not None else last.after
        self.segments.append(
            Segment(
                start_s,
                start_s + length_s,
                before,
                _floats(after),
                tremor,
                bumps,
                _floats(last_north(last) if north is None else north),
                heading_rad,
                last.place_mm if place_mm is None else place_mm,
            )
        )

    def _aim_heading(self, turning: Segment, errs: bool) -> float:
        """The turn about the vertical that brings the wanted side to the north, rad, within half a turn; 0: none."""
        if self._wanted_north is None:
            return 0.0
        wanted = _err(self._wanted_north) if errs else self._wanted_north
        up, north = np.array(turning.after), last_north(turning)
        level = wanted - (wanted @ up) * up
        error_rad = math.radians(self._hand.heading_deg) * self._random.standard_normal()
        turn_rad = math.atan2(float(np.cross(north, level) @ up), float(north @ level)) + error_rad
        return math.remainder(turn_rad, 2 * math.pi)

    def _table_attitude(self, direction: Floats) -> Floats:
        hand = self._hand
        leaning = np.abs(direction).max() < 0.99
        placed = _perturb(direction, hand.aim_deg if leaning else hand.side_deg, self._random)
        tilt = self._table - np.array([0.0, 0.0, 1.0])
        return unit(placed + np.roll(tilt, int(np.argmax(np.abs(direction))) + 1))


def _err(direction: Floats) -> Floats:
    """A wrong side in place of the wanted one."""
    return np.asarray(np.roll(direction, 1) * np.array([1.0, -1.0, 1.0]))


def _perturb(direction: Floats, std_deg: float, random: np.random.Generator) -> Floats:
    """A direction turned by a normal angle about two axes."""
    offset = math.radians(std_deg) * random.standard_normal(3)
    return unit(direction + np.cross(offset, direction))


def _floats(vector: Floats) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in vector)
    return x, y, z
