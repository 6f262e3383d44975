"""Oriental Motor AZ: what a bench file says of a stage, and what follows from it: times and ways of its moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.errors import LimitError
from drivers.transport.modbus import Register

LEAD_S, TAIL_S = 0.2, 0.5  # at constant rate before a turn, for the motor to settle, and after it, for late records


@dataclass(frozen=True)
class Settings:
    """One stage: gear and resolution, limits of the motor angle and speed, how it moves, when it counts as settled.

    With a `communication_timeout_s`, the drive stops by itself (alarm 85) when its controller falls silent for so long
    in the middle of a move; 0 is off. It is off unless the bench file sets it, since the address of the drive's
    parameter "Communication timeout (Modbus)", which counts ms, is from memory [M]: look it up in HM-60262 first. AR
    drives of the same maker have theirs elsewhere, at 0x1200.

    With `own_limits`, `limits_deg` are written into the drive as its software limits and read back, before the first
    move: it brakes there by itself, whoever sent it. Off unless the bench file sets it: see oriental_az_table.

    Raises ValueError for what no stage can be.
    """

    steps_per_turn: int = 18000  # 1.2 arcmin a step [M]
    limits_deg: tuple[float, float] = (-400.0, 400.0)
    speed_deg_s: float = 30.0
    speed_limit_deg_s: float = 1200.0  # 200 r/min of a DGII's table [M]; less for what stands on it
    acceleration_deg_s2: float = 60.0
    settle_deg: float = 0.05
    current_percent: float = 100.0
    communication_timeout_s: float = 0.0
    communication_timeout_register: int = 0x138A  # [M]
    own_limits: bool = False

    def __post_init__(self) -> None:
        positive = ("steps_per_turn", "speed_deg_s", "acceleration_deg_s2", "settle_deg", "current_percent")
        if wrong := [name for name in positive if not getattr(self, name) > 0]:
            raise ValueError(f"{', '.join(wrong)} must be positive")
        if not self.limits_deg[0] < self.limits_deg[1]:
            raise ValueError("limits_deg must be the lower limit, then the upper one")
        if self.own_limits and not all(map(math.isfinite, self.limits_deg)):
            raise ValueError("own_limits needs limits_deg that are numbers of degrees, both of them")
        if self.speed_deg_s > self.speed_limit_deg_s:
            raise ValueError(f"speed_deg_s must be at most speed_limit_deg_s, {self.speed_limit_deg_s:g}")
        if self.communication_timeout_s and not 0.5 <= self.communication_timeout_s <= 10:
            raise ValueError("communication_timeout_s must be 0 for none, or 0.5 to 10")

    @property
    def communication_timeout(self) -> Register:
        """The drive's own parameter."""
        return Register(self.communication_timeout_register, "uint32", "communication time-out", "s", 0.001)

    def rate_deg_s(self, asked_deg_s: float) -> float:
        """The rate nearest to the one asked for that is a whole number of steps a second."""
        per_deg = self.steps_per_turn / 360
        return round(asked_deg_s * per_deg) / per_deg

    def way_of_turn(self, name: str, rate_deg_s: float, first_deg: float, last_deg: float) -> tuple[float, float]:
        """Where run-up begins and braking ends, deg, of a turn at a constant rate from one angle to another.

        Raises LimitError for a rate or a way that the stage has not.
        """
        if not 0 < abs(self.rate_deg_s(rate_deg_s)) <= self.speed_limit_deg_s:
            raise LimitError(
                f"{name}: {abs(rate_deg_s):g} deg/s is no rate of this stage, whose limit is "
                f"{self.speed_limit_deg_s:g} deg/s; nothing was sent",
                "Ask for a slower turn, or change speed_limit_deg_s in the bench file after looking at what turns",
            )
        if self.endless and not self.communication_timeout_s:
            raise LimitError(
                f"{name}: has no limits, and would turn for ever should this program die; nothing was sent",
                "Set communication_timeout_s in the bench file, so that the drive stops by itself, or set limits_deg",
            )
        speed, way = abs(rate_deg_s), math.copysign(1.0, last_deg - first_deg)
        ramp_deg = speed**2 / (2 * self.acceleration_deg_s2)
        ends = first_deg - way * (ramp_deg + LEAD_S * speed), last_deg + way * (TAIL_S * speed + ramp_deg)
        low, high = self.limits_deg
        if not (low <= min(ends) and max(ends) <= high):  # NaN is outside as well
            raise LimitError(
                f"{name}: a turn from {first_deg:g} to {last_deg:g} deg at {speed:g} deg/s takes run-up and braking, "
                f"{ends[0]:g} .. {ends[1]:g} deg in all, outside its limits {low:g} .. {high:g} deg; nothing was sent",
                "Ask for a slower or shorter turn, raise acceleration_deg_s2 if the load can bear it, or widen "
                "limits_deg in the bench file after looking at the cables",
            )
        return ends

    @property
    def endless(self) -> bool:
        """Whether the stage can turn on and on: nothing such as a cable limits it."""
        return all(map(math.isinf, self.limits_deg))

    def move_s(self, distance_deg: float) -> float:
        """How long a move takes: a trapezoid of speed, or a triangle when the way is short."""
        speed, acceleration = self.speed_deg_s, self.acceleration_deg_s2
        if distance_deg < speed**2 / acceleration:
            return 2 * math.sqrt(distance_deg / acceleration)
        return distance_deg / speed + speed / acceleration
