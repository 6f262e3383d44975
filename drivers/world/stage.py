"""A rotary stage: the motor's angle over time, and the true angle of its table.

motor angle -> gear play (the table lags in the direction of approach) -> zero offset, wobble, worm gear
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from drivers.world.kernel import Floats, kernel

# The motor angle of a stage over time: a trapezoid of speed, or a part of one if there is a stop.
#
# Speed and acceleration belong to the twin of the drive; gear, play and tilt to the world.


@dataclass(frozen=True)
class Trajectory:
    """A move from rest to rest. Times in s, angles in deg, speed in deg/s, acceleration in deg/s^2."""

    start_s: float
    start_deg: float
    target_deg: float
    speed_deg_s: float
    acceleration_deg_s2: float
    stop_s: float | None = None  # when a stop was commanded; the motor then decelerates to rest

    @property
    def direction(self) -> float:
        return math.copysign(1.0, self.target_deg - self.start_deg) if self.target_deg != self.start_deg else 0.0

    @cached_property
    def _ramp_s(self) -> float:
        """Length of the acceleration ramp; a short move never reaches its speed."""
        distance = abs(self.target_deg - self.start_deg)
        return min(self.speed_deg_s / self.acceleration_deg_s2, math.sqrt(distance / self.acceleration_deg_s2))

    @cached_property
    def _cruise_s(self) -> float:
        distance = abs(self.target_deg - self.start_deg)
        if distance == 0:
            return 0.0
        peak = self._ramp_s * self.acceleration_deg_s2
        return max(0.0, (distance - peak * self._ramp_s) / peak)

    @property
    def end_s(self) -> float:
        planned = self.start_s + 2 * self._ramp_s + self._cruise_s
        if self.stop_s is None or self.stop_s >= planned:
            return planned
        return min(planned, self.stop_s + abs(self._planned_rate(self.stop_s)) / self.acceleration_deg_s2)

    def _planned_rate(self, t_s: float) -> float:
        t, ramp, cruise = t_s - self.start_s, self._ramp_s, self._cruise_s
        if t <= 0 or t >= 2 * ramp + cruise:
            return 0.0
        return self.direction * self.acceleration_deg_s2 * min(t, ramp, 2 * ramp + cruise - t)

    def _planned_angle(self, t_s: float) -> float:
        t, ramp, cruise, a = t_s - self.start_s, self._ramp_s, self._cruise_s, self.acceleration_deg_s2
        if t <= 0:
            return self.start_deg
        if t >= 2 * ramp + cruise:
            return self.target_deg
        if t < ramp:
            travelled = a * t * t / 2
        elif t < ramp + cruise:
            travelled = a * ramp * (t - ramp / 2)
        else:
            remaining_s = 2 * ramp + cruise - t
            travelled = abs(self.target_deg - self.start_deg) - a * remaining_s * remaining_s / 2
        return self.start_deg + self.direction * travelled

    def angle_deg(self, t_s: float) -> float:
        """Motor angle in deg at time `t_s`."""
        if self.stop_s is None or t_s <= self.stop_s:
            return self._planned_angle(t_s)
        rate = self._planned_rate(self.stop_s)
        t = min(t_s - self.stop_s, abs(rate) / self.acceleration_deg_s2)
        braking = math.copysign(self.acceleration_deg_s2, rate) * t * t / 2
        return self._planned_angle(self.stop_s) + rate * t - braking

    def rate_deg_s(self, t_s: float) -> float:
        """Motor rate in deg/s at time `t_s`."""
        if self.stop_s is None or t_s <= self.stop_s:
            return self._planned_rate(t_s)
        rate = self._planned_rate(self.stop_s)
        speed = abs(rate) - self.acceleration_deg_s2 * (t_s - self.stop_s)
        return math.copysign(max(0.0, speed), rate)

    def pieces(self) -> list[tuple[float, float, float, float]]:
        """The move as pieces of constant acceleration: (start in s, angle, rate, acceleration); the last is rest."""
        ramp, cruise = self._ramp_s, self._cruise_s
        turns = {self.start_s, self.start_s + ramp, self.start_s + ramp + cruise}
        if self.stop_s is not None:
            turns = {t for t in turns if t < self.stop_s} | {max(self.stop_s, self.start_s)}
        times = [*sorted(t for t in turns if t < self.end_s), self.end_s]
        rates = [*map(self.rate_deg_s, times[:-1]), 0.0]
        slopes = [(b - a) / (end - t) for (t, end), (a, b) in zip(pairwise(times), pairwise(rates), strict=True)]
        return list(zip(times, map(self.angle_deg, times), rates, [*slopes, 0.0], strict=True))

    def stopped(self, t_s: float) -> Trajectory:
        """The move with a stop commanded at `t_s`."""
        return self if self.stop_s is not None else replace(self, stop_s=t_s)


def at_rest(angle_deg: float) -> Trajectory:
    """A stage at rest at `angle_deg`."""
    return Trajectory(0.0, angle_deg, angle_deg, 1.0, 1.0)


AXES = ("alpha", "beta")
PIECES = 5  # a trapezoid has three pieces and a rest; a stop adds one


@dataclass(frozen=True)
class Stage:
    """Imperfections of one stage. Speed and resolution of the drive belong to its twin."""

    zero_offset_deg: float = 0.0  # true angle at motor angle 0
    play_deg: float = 0.0  # full width of the gear play
    wobble_deg: float = 0.0  # amplitude of one cycle per turn (eccentric bearing)
    wobble_phase_deg: float = 0.0  # angle at which that cycle crosses zero rising
    worm_deg: float = 0.0  # amplitude of the worm gear's periodic error
    worm_cycles: float = 5.0  # its cycles per turn


def motion(trajectory: Trajectory) -> Floats:
    """A trajectory as the kernels read it: shape (PIECES, 4), its pieces and then its rest."""
    pieces = trajectory.pieces()
    return np.array([*pieces, *pieces[-1:] * (PIECES - len(pieces))])


@kernel
def motor_angle_deg(pieces: Floats, t_s: float) -> float:
    """Angle on a table of (start in s, angle in deg, rate in deg/s, acceleration in deg/s^2), at `t_s`."""
    k = 0
    while k + 1 < len(pieces) and pieces[k + 1, 0] <= t_s:
        k += 1
    dt = max(0.0, t_s - pieces[k, 0])
    angle_deg: float = pieces[k, 1] + dt * (pieces[k, 2] + dt * pieces[k, 3] / 2)
    return angle_deg


@kernel
def engaged_deg(stage: Stage, table_deg: float, motor_deg: float) -> float:
    """The angle of the table behind the gear play, from its previous angle."""
    half = stage.play_deg / 2
    return min(max(table_deg, motor_deg - half), motor_deg + half)


@kernel
def true_angle_rad(stage: Stage, table_deg: float) -> float:
    """The true angle of the table in the laboratory."""
    wobble = stage.wobble_deg * math.sin(math.radians(table_deg - stage.wobble_phase_deg))
    worm = stage.worm_deg * math.sin(math.radians(stage.worm_cycles * table_deg))
    return math.radians(table_deg + stage.zero_offset_deg + wobble + worm)
