"""What a procedure is given: instruments by role, poses that are still missing, a way to keep and to ask.

The same `Session` carries a run and its plan: only the instruments and the host differ.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from procedures.errors import Declined, SafetyLimit
from procedures.questions import EDGES, Confirm, Mounting, Number, Question

Read = TypeVar("Read")
SHORTEST_APPROACH_DEG = 0.5  # a stage that is nearer to a pose has not come from its side


@dataclass(frozen=True)
class Pose:
    """A position of the sensor to hold. Angles in deg; `direction` +1 while beta grows, -1 while it falls.

    `mount_deg` is the sensor's turn about the table's normal, `flip` 1 when it is mounted face down. `up` is the edge
    that stands along that normal, z but for a sensor on edge. Beta turns from `beta_deg` on at a `rate_deg_s` that is
    not 0: then it is a turn that is kept, and no pose.
    """

    alpha_deg: float
    beta_deg: float
    direction: int = 0
    path: str = ""
    mount_deg: float = 0.0
    flip: int = 0
    up: str = "z"
    rate_deg_s: float = 0.0


@dataclass(frozen=True)
class Limits:
    """What stops a run, and what its results are judged by.

    temperature_c   of the sensor
    overrun_deg     how far beyond a pose its approach begins
    level_deg       the greatest tilt of the table that a procedure begins with; None: it is not asked for
    results         by name: the greatest magnitude of a result, or its (lowest, highest) value
    """

    temperature_c: tuple[float, float] = (-20.0, 85.0)
    overrun_deg: float = 5.0
    level_deg: float | None = None
    results: Mapping[str, float | tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Dwell:
    """What was measured at a pose: of every channel the mean and the standard deviation of `n` samples, in V."""

    pose: Pose
    t_s: float
    means: Mapping[str, float]
    stds: Mapping[str, float]
    n: int
    temperature_c: float | None = None


@dataclass(frozen=True)
class Reading:
    """One number that belongs to the run and to none of its poses, such as the table's tilt."""

    name: str
    value: float
    unit: str
    std: float | None = None


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


class Turn(Protocol):
    """A turn at a constant rate that goes on; `require` is called every `beat_s`, and raises where it does not."""

    @property
    def rate_deg_s(self) -> float: ...
    @property
    def beat_s(self) -> float: ...
    @property
    def require(self) -> Callable[[], None]: ...


class Stage(Protocol):
    """One rotary stage."""

    def move_to(self, deg: float) -> None: ...
    def angle_deg(self) -> float: ...
    def home(self) -> None: ...
    def referenced(self) -> bool: ...
    def stop(self) -> None: ...
    def rate_deg_s(self, asked_deg_s: float) -> float:
        """The rate nearest to the one asked for that it can turn at."""

    def turning(self, rate_deg_s: float, first_deg: float, last_deg: float) -> AbstractContextManager[Turn]:
        """At a constant rate from one angle to another: it has the rate when the body begins, and stands after it."""


class Adc(Protocol):
    """The converter that the sensor's outputs go to."""

    def acquire(self, duration_s: float) -> Samples: ...
    def acquire_with(self, duration_s: float, reading: Callable[[], Read]) -> tuple[Samples, Read]:
        """The same, and what `reading` gives in the middle of it."""

    def acquire_watched(self, duration_s: float, watch: Callable[[], object], every_s: float) -> Samples:
        """The same; `watch` is called every so often, and at the end."""

    def only(self, *outputs: str) -> Adc:
        """The converter with the channels of these outputs alone; raises where one is not wired."""

    def stream(self, duration_s: float, block_s: float) -> Iterator[Samples]:
        """The same without a gap between blocks of `block_s`."""

    def power(self, on: bool) -> None:
        """Switch the sensor's supply."""


class Oven(Protocol):
    """Oven and thermometer."""

    def temperature_c(self) -> float | None:
        """Of the sensor, in C; None on a bench without a thermometer."""

    def set_temperature(self, c: float) -> None: ...
    def run(self, on: bool) -> None: ...


class Tilt(Protocol):
    """A reading of the level, deg."""

    @property
    def x_deg(self) -> float: ...
    @property
    def y_deg(self) -> float: ...
    @property
    def std_deg(self) -> float: ...


class Level(Protocol):
    """The digital level that lies on the table of beta."""

    def read(self) -> Tilt: ...


class Positioner(Protocol):
    """The nano-positioner that shakes the sensor along its x axis."""

    def servo(self, on: bool) -> None: ...
    def move_to(self, axis: str, um: float) -> None: ...
    def position_um(self, axis: str) -> float: ...
    def oscillate(self, axis: str, *, peak_to_peak_um: float, frequency_hz: float, centre_um: float) -> float:
        """Begin a sine; the frequency that it really has, Hz."""

    def stop(self) -> None: ...


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

    def measured(self) -> Sequence[Dwell]:
        """What was measured at them, in the order of keeping."""

    def readings(self) -> Sequence[Reading]:
        """The readings that the record already holds."""

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None: ...
    def keep_readings(self, *readings: Reading) -> None:
        """All of them or none: a run that goes on does not meet a half of what was read at once."""

    def ask(self, question: Question) -> str:
        """A person's checked answer; an answer that the record holds is not asked for again.

        Raises NoAnswer where nobody is there.
        """

    def doing(self, text: str) -> None:
        """What happens now, for people."""


def never(dwells: Sequence[Dwell], oven_c: float) -> bool:  # noqa: ARG001
    """A plan's answer to whether what was measured has come to rest: it is that of the longest run."""
    return False


@dataclass(frozen=True)
class Session:
    """The bench as a procedure sees it.

    `steady` judges whether bias and scale factor of dwells have come to rest, in an oven of so many C (0: in none).
    """

    alpha: Stage
    beta: Stage
    adc: Adc
    oven: Oven
    level: Level | None  # None: a person reads one and types
    positioner: Positioner
    clock: Clock
    host: Host
    limits: Limits = Limits()
    steady: Callable[[Sequence[Dwell], float], bool] = never

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
        """Turn both stages to `pose`; beta arrives from below for direction +1, from above for -1.

        A person is asked where the sensor is mounted otherwise. Raises Declined, NoAnswer.
        """
        self.mount(pose.mount_deg, pose.flip, pose.up)
        self.host.doing(f"moving to alpha {pose.alpha_deg:g}, beta {pose.beta_deg:g} deg")
        self.alpha.move_to(pose.alpha_deg)
        way_deg = (pose.beta_deg - self.beta.angle_deg()) * pose.direction
        if pose.direction and way_deg < SHORTEST_APPROACH_DEG:
            self.beta.move_to(pose.beta_deg - pose.direction * self.limits.overrun_deg)
        self.beta.move_to(pose.beta_deg)
        self.host.doing(f"holding alpha {pose.alpha_deg:g}, beta {pose.beta_deg:g} deg")

    def hold(self, pose: Pose, dwell_s: float, settle_s: float) -> None:
        """Go to `pose`, let it settle, and keep `dwell_s` seconds of it, with the temperature in their middle."""
        self.move_to(pose)
        self.wait(settle_s)
        samples, temperature_c = self.adc.acquire_with(dwell_s, self.oven.temperature_c)
        self.keep(pose, samples=samples, temperature_c=temperature_c)

    def turn(self, pose: Pose, turn_deg: float) -> None:
        """Turn beta at the pose's rate by `turn_deg` from its angle on, and keep the samples of it."""
        self.mount(pose.mount_deg, pose.flip, pose.up)
        self.alpha.move_to(pose.alpha_deg)
        self.host.doing(f"turning beta at {pose.rate_deg_s:g} deg/s, alpha {pose.alpha_deg:g} deg")
        last_deg = pose.beta_deg + math.copysign(turn_deg, pose.rate_deg_s)
        with self.beta.turning(abs(pose.rate_deg_s), pose.beta_deg, last_deg) as turn:
            samples = self.adc.acquire_watched(turn_deg / abs(turn.rate_deg_s), turn.require, turn.beat_s)
        self.keep(pose, samples=samples, temperature_c=self.oven.temperature_c())

    def mount(self, mount_deg: float, flip: int, up: str = "z") -> None:
        """Have the sensor mounted so, at alpha = 0 where it lies flat; nothing where it is."""
        wanted = {"mount": mount_deg, "flip": flip, "edge": EDGES.index(up)}
        if all((self.reading(name) or 0.0) == value for name, value in wanted.items()):
            return
        self.alpha.move_to(0.0)
        question = Mounting.of(mount_deg, flip, up)
        if self.host.ask(question) == "no":
            raise Declined(f"{question.name}: the sensor is not mounted so; mount it, then resume the run")
        units = {"mount": "deg"}
        self.keep_readings(*(Reading(name, value, units.get(name, "")) for name, value in wanted.items()))

    def keep(self, pose: Pose, *, samples: Samples, temperature_c: float | None = None) -> None:
        """Put `pose` into the record. Raises SafetyLimit for a temperature outside the bench's limits."""
        self.check_temperature(temperature_c)
        self.host.keep(pose, samples, temperature_c)

    def check_temperature(self, temperature_c: float | None) -> None:
        """Raises SafetyLimit for a sensor's temperature outside the bench's limits; an unknown one passes."""
        low, high = self.limits.temperature_c
        if temperature_c is not None and not (math.isfinite(temperature_c) and low <= temperature_c <= high):
            raise SafetyLimit(
                f"oven: the sensor is at {temperature_c:g} C, outside the bench's limits of {low:g} to {high:g} C; "
                "let it come back, or change limits.temperature_c in the bench file"
            )

    def keep_stretch(self, poses: Sequence[Pose], block_s: float) -> None:
        """Put a record without gaps into the record: `block_s` seconds of it as each of `poses`, which stand still."""
        stretch = self.adc.stream(len(poses) * block_s, block_s)
        for pose, samples in zip(poses, stretch, strict=True):
            self.keep(pose, samples=samples, temperature_c=self.oven.temperature_c())

    def measured(self) -> Sequence[Dwell]:
        """All that the record holds of this run, in the order of keeping: what an adaptive procedure goes by."""
        return self.host.measured()

    def reading(self, name: str) -> float | None:
        """A reading of this run that the record holds."""
        return next((reading.value for reading in self.host.readings() if reading.name == name), None)

    def keep_readings(self, *readings: Reading) -> None:
        """Put numbers that belong to the run and to no pose into the record: all that were read at once, at once."""
        self.host.keep_readings(*readings)

    def confirm(self, name: str, text: str, drawing: str = "") -> None:
        """A person confirms `text`; `name` is its key in a file of answers. Raises Declined, NoAnswer."""
        self.have_done(Confirm(name, text, drawing))

    def have_done(self, question: Confirm) -> None:
        """A person does what `question` says, and confirms it. Raises Declined, NoAnswer."""
        if self.host.ask(question) == "no":
            asked = f'{question.name}: "{question.text}"'
            raise Declined(f"{asked} was answered with no; put it right, then resume the run")

    def number(self, name: str, text: str, unit: str, low: float, high: float) -> float:
        """A number that a person reads off and types, anew each time. Raises NoAnswer."""
        return float(self.host.ask(Number(name, text, unit=unit, low=low, high=high, repeated=True)))

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.clock.sleep(seconds)

    def reference(self) -> None:
        """Home every stage that does not know where it is."""
        for name, stage in (("alpha", self.alpha), ("beta", self.beta)):
            if not stage.referenced():
                self.host.doing(f"homing {name}")
                stage.home()
