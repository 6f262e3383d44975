"""Paths of rotary stages with a motor: how long a move takes, and the way that a turn at a constant rate needs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.errors import LimitError

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
