"""What a procedure is given: instruments by role, poses that are still missing, a way to keep and to ask.

The same `Session` carries a run and its plan: only the instruments and the host differ.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from procedures.errors import SafetyLimit

SHORTEST_APPROACH_DEG = 0.5  # a stage that is nearer to a pose has not come from its side


@dataclass(frozen=True)
class Pose:
    """A position of the sensor to hold. Angles in deg; `direction` +1 while beta grows, -1 while it falls.

    `mount_deg` is the sensor's turn about its z axis on the stage, `flip` 1 when it is mounted face down.
    """

    alpha_deg: float
    beta_deg: float
    direction: int = 0
    path: str = ""
    mount_deg: float = 0.0
    flip: int = 0


@dataclass(frozen=True)
class Limits:
    """Measured values outside these stop a run. `overrun_deg`: how far beyond a pose its approach begins."""

    temperature_c: tuple[float, float] = (-20.0, 85.0)
    overrun_deg: float = 5.0


class Samples(Protocol):
    """A stretch of samples: `volts`, shape (n, channels), `start_s` on the clock."""

    @property
    def volts(self) -> NDArray[np.float64]: ...
    @property
    def channels(self) -> Sequence[str]: ...
    @property
    def rate_hz(self) -> float: ...
    @property
    def start_s(self) -> float: ...


class Stage(Protocol):
    """One rotary stage."""

    def move_to(self, deg: float) -> None: ...
    def angle_deg(self) -> float: ...
    def home(self) -> None: ...
    def referenced(self) -> bool: ...
    def stop(self) -> None: ...


class Adc(Protocol):
    """The converter that the sensor's outputs go to."""

    def acquire(self, duration_s: float) -> Samples: ...


class Oven(Protocol):
    """Oven and thermometer."""

    def temperature_c(self) -> float | None:
        """Of the sensor, in C; None on a bench without a thermometer."""

    def set_temperature(self, c: float) -> None: ...
    def run(self, on: bool) -> None: ...


class Clock(Protocol):
    """The only way to wait."""

    def now(self) -> float: ...
    def sleep(self, seconds: float) -> None: ...


class Host(Protocol):
    """Who carries the procedure out: a run into the record, or a plan."""

    def kept(self) -> Sequence[Pose]:
        """The poses that the record already holds."""

    def expect(self, missing: int) -> None:
        """So many poses are to come."""

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None: ...

    def ask(self, name: str, question: str, default: str) -> str:
        """A person's answer; an answer that the record holds is not asked for again."""

    def doing(self, text: str) -> None:
        """What happens now, for people."""


@dataclass(frozen=True)
class Session:
    """The bench as a procedure sees it."""

    alpha: Stage
    beta: Stage
    adc: Adc
    oven: Oven
    clock: Clock
    host: Host
    limits: Limits = Limits()

    def missing(self, poses: Iterable[Pose]) -> Iterator[Pose]:
        """Those of `poses` that the record does not hold yet, in order; a pose named twice is kept twice."""
        kept = Counter(self.host.kept())
        left = []
        for pose in poses:
            if kept[pose] > 0:
                kept[pose] -= 1
            else:
                left.append(pose)
        self.host.expect(len(left))
        yield from left

    def move_to(self, pose: Pose) -> None:
        """Turn both stages to `pose`; beta arrives from below for direction +1, from above for -1."""
        self.host.doing(f"moving to alpha {pose.alpha_deg:g}, beta {pose.beta_deg:g} deg")
        self.alpha.move_to(pose.alpha_deg)
        way_deg = (pose.beta_deg - self.beta.angle_deg()) * pose.direction
        if pose.direction and way_deg < SHORTEST_APPROACH_DEG:
            self.beta.move_to(pose.beta_deg - pose.direction * self.limits.overrun_deg)
        self.beta.move_to(pose.beta_deg)
        self.host.doing(f"holding alpha {pose.alpha_deg:g}, beta {pose.beta_deg:g} deg")

    def keep(self, pose: Pose, *, samples: Samples, temperature_c: float | None = None) -> None:
        """Put `pose` into the record. Raises SafetyLimit for a temperature outside the bench's limits."""
        low, high = self.limits.temperature_c
        if temperature_c is not None and not (math.isfinite(temperature_c) and low <= temperature_c <= high):
            raise SafetyLimit(
                f"the sensor is at {temperature_c:g} C, outside the bench's limits of {low:g} to {high:g} C; "
                "let it come back, or change limits.temperature_c in the bench file"
            )
        self.host.keep(pose, samples, temperature_c)

    def ask(self, name: str, question: str, default: str = "yes") -> str:
        """A person's answer to `question`; `name` is its key in a file of answers."""
        return self.host.ask(name, question, default)

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.clock.sleep(seconds)

    def reference(self) -> None:
        """Home every stage that does not know where it is."""
        for name, stage in (("alpha", self.alpha), ("beta", self.beta)):
            if not stage.referenced():
                self.host.doing(f"homing {name}")
                stage.home()
