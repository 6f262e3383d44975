"""Rotary stages with a motor: common settings, the duration of a move, the path of a turn, and the steps of both."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from drivers.errors import DriverError, LimitError, NotSettled
from drivers.instrument import OUTSIDE_ANGLE, require_positive, require_range, require_within

LEAD_S, TAIL_S = 0.2, 0.5  # at constant rate before a turn, for the motor to settle, and after it, for late records


def move_s(distance_deg: float, speed_deg_s: float, acceleration_deg_s2: float) -> float:
    """Duration of a move, s: a trapezoid of speed, or a triangle for a short way."""
    if distance_deg < speed_deg_s**2 / acceleration_deg_s2:
        return 2 * math.sqrt(distance_deg / acceleration_deg_s2)
    return distance_deg / speed_deg_s + speed_deg_s / acceleration_deg_s2


def require_rate(name: str, asked_deg_s: float, rate_deg_s: float, limit_deg_s: float) -> None:
    """Raises LimitError if the stage cannot turn at `rate_deg_s`, its rate that is nearest to the requested one."""
    if not 0 < abs(rate_deg_s) <= limit_deg_s:
        raise LimitError(
            f"{name}: the stage cannot turn at {abs(asked_deg_s):g} deg/s; its limit is "
            f"{limit_deg_s:g} deg/s; nothing was sent",
            "Ask for a slower turn, or change speed_limit_deg_s in the bench file after checking the load",
        )


@dataclass(frozen=True)
class TurnPath:
    """A turn at a constant rate from one angle to another, with run-up and braking."""

    rate_deg_s: float
    acceleration_deg_s2: float
    first_deg: float
    last_deg: float

    @property
    def ends_deg(self) -> tuple[float, float]:
        """The angles at which run-up begins and braking ends."""
        speed, sense = abs(self.rate_deg_s), math.copysign(1.0, self.last_deg - self.first_deg)
        ramp_deg = speed**2 / (2 * self.acceleration_deg_s2)
        return self.first_deg - sense * (ramp_deg + LEAD_S * speed), self.last_deg + sense * (TAIL_S * speed + ramp_deg)

    def within(self, name: str, limits_deg: tuple[float, float]) -> tuple[float, float]:
        """The ends. Raises LimitError where they are not within the limits."""
        ends, (low, high) = self.ends_deg, limits_deg
        if not (low <= min(ends) and max(ends) <= high):  # NaN is outside as well
            raise LimitError(
                f"{name}: a turn from {self.first_deg:g} to {self.last_deg:g} deg at {abs(self.rate_deg_s):g} deg/s "
                f"needs, with acceleration and braking, {ends[0]:g} .. {ends[1]:g} deg in all, outside its limits "
                f"{low:g} .. {high:g} deg; nothing was sent",
                "Ask for a slower or shorter turn, raise acceleration_deg_s2 if the load permits, or widen "
                "limits_deg in the bench file after checking the cables",
            )
        return ends


@dataclass(frozen=True)
class MotorSettings:
    """The settings of every stage with a motor. Raises ValueError for impossible values."""

    limits_deg: tuple[float, float]
    speed_deg_s: float
    speed_limit_deg_s: float
    acceleration_deg_s2: float
    settle_deg: float

    def __post_init__(self) -> None:
        require_positive(self, "speed_deg_s", "acceleration_deg_s2", "settle_deg")
        require_range(self, "limits_deg")
        if self.speed_deg_s > self.speed_limit_deg_s:
            raise ValueError(f"speed_deg_s must be at most speed_limit_deg_s, {self.speed_limit_deg_s:g}")

    def rate_deg_s(self, asked_deg_s: float) -> float:
        """The possible rate that is nearest to the requested one."""
        return asked_deg_s

    def way_of_turn(self, name: str, rate_deg_s: float, first_deg: float, last_deg: float) -> tuple[float, float]:
        """Angles where the run-up begins and the braking ends, deg, for a turn at a constant rate between two angles.

        Raises LimitError if the stage cannot make this turn.
        """
        require_rate(name, rate_deg_s, self.rate_deg_s(rate_deg_s), self.speed_limit_deg_s)
        return TurnPath(rate_deg_s, self.acceleration_deg_s2, first_deg, last_deg).within(name, self.limits_deg)

    def move_s(self, distance_deg: float) -> float:
        """Duration of a move, s."""
        return move_s(distance_deg, self.speed_deg_s, self.acceleration_deg_s2)


@dataclass(frozen=True)
class Turn:
    """A turn in progress: its rate, and the longest time between two calls of `require`.

    `require` raises StageAlarm, StageLost, or NotSettled for a stage that does not turn as commanded.
    """

    rate_deg_s: float
    beat_s: float
    require: Callable[[], None]


class MotorStage:
    """A stage that is moved to angles in deg and holds them. A driver has the commands of its motor."""

    name: str
    settings: MotorSettings
    _target_deg = math.nan  # of the last move; not a number before the first one

    def rate_deg_s(self, asked_deg_s: float) -> float:
        """The possible rate that is nearest to the requested one."""
        return self.settings.rate_deg_s(asked_deg_s)

    def move_to(self, angle_deg: float) -> None:
        """Turn to `angle_deg` and return when the stage is at rest there.

        Raises LimitError before anything is sent, StageAlarm, StageLost, Interlocked, NotSettled, errors of the link.
        """
        if self.start(angle_deg):
            self.wait()

    def start(self, angle_deg: float) -> bool:
        """Start turning to `angle_deg` and return at once; False if the stage is there already.

        A drive with a communication time-out needs `wait` within it. Raises LimitError before anything is sent,
        StageAlarm, StageLost, Interlocked.
        """
        require_within(f"{self.name}: ", angle_deg, self.settings.limits_deg, "deg", OUTSIDE_ANGLE)
        return self._start(angle_deg, self.settings.speed_deg_s) is not None

    def wait(self) -> None:
        """Wait until the started move has ended at its target.

        Raises StageAlarm, StageLost, Interlocked, NotSettled.
        """
        raise NotImplementedError

    def stop(self) -> None:
        """Brake, and wait for the standstill. A stage with an alarm counts as stopped if it does not move."""
        raise NotImplementedError

    @contextmanager
    def turning(self, rate_deg_s: float, first_deg: float, last_deg: float) -> Iterator[Turn]:
        """Turn from `first_deg` to `last_deg` at a constant rate, which the stage has when the body begins.

        A stage with limits is sent to an angle within them at that speed, and ends there even if this program crashes.
        The body has the time of the turn and half a second more, and must call the turn's `require`. After the body the
        stage is at rest, also after an error. Raises LimitError before anything is sent, StageAlarm, StageLost,
        Interlocked, NotSettled.
        """
        start_deg, end_deg = self.settings.way_of_turn(self.name, rate_deg_s, first_deg, last_deg)
        rate = math.copysign(self.settings.rate_deg_s(abs(rate_deg_s)), last_deg - first_deg)
        self.move_to(start_deg)
        try:
            yield self._begin_turn(rate, start_deg, end_deg)
            self._end_turn()
        except BaseException:
            with suppress(DriverError):  # the first error is reported
                self.stop()
            raise

    def _start(self, angle_deg: float, speed_deg_s: float) -> float | None:
        """Start turning to an angle within the limits. Returns the time of the start; None if the stage is there."""
        raise NotImplementedError

    def _begin_turn(self, rate_deg_s: float, start_deg: float, end_deg: float) -> Turn:
        """Start turning at `start_deg`, and return when the stage has the rate."""
        raise NotImplementedError

    def _end_turn(self) -> None:
        """Bring the stage to rest after a turn."""
        self.wait()

    def _away_from_target(self, angle_deg: float, remedy: str, cause: str = "") -> NotSettled:
        """The error of a stage that is at `angle_deg` and not at the target of its last move."""
        return NotSettled(
            f"{self.name}: is at {angle_deg:.3f} deg instead of {self._target_deg:.3f} deg, "
            f"more than {self.settings.settle_deg:g} deg away{cause}",
            remedy,
        )
