"""The session: the interface of a procedure to the instruments, the record and a person.

A run and its plan use the same `Session` with different instruments and a different host.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.recorder import Samples
from procedures.bounds import require_bounded
from procedures.errors import Declined, SafetyLimit, SettingError
from procedures.instruments import Adc, Clock, Level, Oven, Positioner, Stage
from procedures.questions import EDGES, Confirm, Mounting, Number, Question

SHORTEST_APPROACH_DEG = 0.5  # a shorter move does not take up the gear play
LONGEST_DWELL_S = 3600.0  # its samples are in memory at once; longer is a mistyped setting, or a soak in blocks


@dataclass(frozen=True)
class Pose:
    """A position of the sensor. Angles in deg; `direction` is +1 if beta rises to it, -1 if beta falls to it.

    `mount_deg` is the rotation of the sensor about the table's normal. `flip` is 1 for a sensor mounted face down. `up`
    is the sensor's axis along the normal: x or y for a sensor on edge. With a `rate_deg_s` other than 0 this is a turn
    of beta at this rate, which begins at `beta_deg`.
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
    """The limits of a bench: a run stops at them, or its results are checked against them.

    temperature_c   lowest and highest temperature of the sensor
    overrun_deg     distance of the point before a pose from which beta approaches it
    level_deg       maximum tilt of the table at the beginning of a run; None: no check
    results         by name: the maximum magnitude of a result, or its (lowest, highest) value
    """

    temperature_c: tuple[float, float] = (-20.0, 85.0)
    overrun_deg: float = 5.0
    level_deg: float | None = None
    results: Mapping[str, float | tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Dwell:
    """The measurement at a pose: mean and standard deviation of `n` samples for every channel, in its unit."""

    pose: Pose
    t_s: float
    means: Mapping[str, float]
    stds: Mapping[str, float]
    n: int
    temperature_c: float | None = None


@dataclass(frozen=True)
class Reading:
    """A number that belongs to the run, not to a pose, such as the tilt of the table."""

    name: str
    value: float
    unit: str
    std: float | None = None


class NoiseAtRest(Protocol):
    """The noise of a sensor at rest."""

    @property
    def rate_hz(self) -> float: ...


class Stillness(Protocol):
    """The test of a window: `noise` is its standard deviation over that at rest, `by` the test with the largest
    ratio.
    """

    @property
    def still(self) -> bool: ...
    @property
    def by(self) -> str: ...
    @property
    def noise(self) -> float: ...


class HandCourse(Protocol):
    """The positions so far of a sensor in a hand, and the attitude that it needs next. Directions are unit vectors in
    the sensor's frame: of gravity upward, or of the magnetic field.
    """

    @property
    def count(self) -> int: ...
    @property
    def directions(self) -> NDArray[np.float64]:
        """Directions of the positions, shape (n, 3)."""

    @property
    def wanted(self) -> tuple[float, ...]:
        """The most informative direction."""

    @property
    def up(self) -> tuple[float, ...]:
        """The direction in the sensor that must point upward for it."""

    @property
    def north(self) -> tuple[float, ...]:
        """The direction in the sensor that must point to the north for it; empty if this has no effect."""

    @property
    def words(self) -> str:
        """The attitude in words."""

    @property
    def turn(self) -> str:
        """How to turn the sensor there; empty if that is not known."""

    @property
    def uncertainty(self) -> tuple[float, str]:
        """The largest standard uncertainty as a share of the full scale (1 g, the field), and its parameter."""

    @property
    def doubt(self) -> str:
        """A contradiction to the assumptions of the calibration, in words; "" without one."""

    def is_new(self, mean: NDArray[np.float64]) -> bool:
        """Whether a rest with this mean (3,) is worth taking."""


class HandAnalysis(Protocol):
    """The analysis behind calibration by hand: the test of rest, and the choice of attitudes."""

    def learn(self, windows: Sequence[NDArray[np.float64]], rate_hz: float) -> NoiseAtRest | None:
        """The noise from windows at rest, each (n, 3); None if they are too few or differ."""

    def judge(self, windows: Sequence[NDArray[np.float64]], noise: NoiseAtRest) -> Stillness:
        """The test of the last of successive windows, each (n, 3)."""

    def course(self, dwells: Sequence[Dwell], noise: NoiseAtRest, skipped: Sequence[str]) -> HandCourse:
        """The positions of an accelerometer so far. Orientations in `skipped` (their words) are not requested again."""

    def field_course(self, dwells: Sequence[Dwell], noise: NoiseAtRest, skipped: Sequence[str]) -> HandCourse:
        """The positions of a magnetometer so far, as `course`."""

    def clipped(self, turn: NDArray[np.float64], rest: NDArray[np.float64]) -> int | None:
        """The number of an output that a turn (n, outputs) clips; None if none does. `rest`: samples at rest."""

    def turn_course(self, recorded: Sequence[RecordedPose], noise: NoiseAtRest, rest_s: float) -> HandCourse:
        """The rests and turns of an accelerometer and a gyroscope so far. A turn begins with a rest of `rest_s`."""


@dataclass(frozen=True)
class Guidance:
    """The next action of a person with a sensor in the hand. It needs no answer: the program sees when it is done.

    `up` is the direction that shall be upward in the sensor's frame, and `north` that to the north, if it matters.
    `taken`: directions of the positions so far, of gravity or of the magnetic field; `wanted`: the next one, if it is
    not `up`. `moves`: whether the sensor shall be turned.
    """

    text: str
    up: tuple[float, ...]
    taken: tuple[tuple[float, ...], ...] = ()
    moves: bool = True
    north: tuple[float, ...] = ()
    wanted: tuple[float, ...] = ()

    @property
    def target(self) -> tuple[float, ...]:
        """The direction that the next position adds."""
        return self.wanted or self.up


class RecordedPose(Protocol):
    """A pose in the record with its samples; `number` counts all poses of the run, `t_s` is the middle."""

    @property
    def pose(self) -> Pose: ...
    @property
    def samples(self) -> Samples: ...
    @property
    def t_s(self) -> float: ...
    @property
    def temperature_c(self) -> float | None: ...
    @property
    def number(self) -> int: ...


class Host(Protocol):
    """The run or the plan that executes the procedure."""

    def recorded(self) -> Sequence[RecordedPose]:
        """The poses in the record with their samples, in order."""

    def kept(self) -> Sequence[Pose]:
        """The poses in the record."""

    def expect(self, missing: int) -> None:
        """Report the number of poses that the procedure will add."""

    def measured(self) -> Sequence[Dwell]:
        """The measurements in the record, in the order of the poses."""

    def readings(self) -> Sequence[Reading]:
        """The readings in the record."""

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None: ...
    def keep_readings(self, *readings: Reading) -> None:
        """Store all of them in one transaction, so a resumed run does not find a part of them."""

    def ask(self, question: Question) -> str:
        """The checked answer of a person, from the record if it is there. Raises NoAnswer if nobody can answer."""

    def doing(self, text: str) -> None:
        """Report the present step to the observer."""

    def guide(self, guidance: Guidance) -> None:
        """Tell the person with the sensor in the hand what to do next."""


def never(dwells: Sequence[Dwell], oven_c: float) -> bool:  # noqa: ARG001
    """`steady` of a plan: False, so the plan shows the longest run."""
    return False


@dataclass(frozen=True)
class Session:
    """The bench for a procedure.

    `steady` decides whether bias and scale factor of the dwells are steady, in an oven at some C (0: no oven).
    `by_hand` is the analysis behind positions of a sensor in a hand.
    """

    alpha: Stage
    beta: Stage
    adc: Adc
    oven: Oven
    level: Level | None  # None: a person reads a level and types
    positioner: Positioner
    clock: Clock
    host: Host
    limits: Limits = Limits()
    steady: Callable[[Sequence[Dwell], float], bool] = never
    by_hand: HandAnalysis | None = None

    def missing(self, poses: Iterable[Pose]) -> Iterator[Pose]:
        """The `poses` that are not in the record yet, in order. A pose that occurs twice is measured twice.

        Raises SettingError for more than MOST_POSES.
        """
        counts = Counter(self.host.kept())
        missing = []
        for pose in require_bounded(poses):
            if counts[pose] > 0:
                counts[pose] -= 1
            else:
                missing.append(pose)
        self.host.expect(len(missing))
        yield from missing

    def move_to(self, pose: Pose) -> None:
        """Move both stages to `pose`; beta arrives from below for direction +1, from above for -1.

        If the pose needs another mounting, a person remounts the sensor first. Raises Declined, NoAnswer.
        """
        self.mount(pose.mount_deg, pose.flip, pose.up)
        self.host.doing(f"moving to alpha {pose.alpha_deg:g}, beta {pose.beta_deg:g} deg")
        self.alpha.move_to(pose.alpha_deg)
        approach_deg = (pose.beta_deg - self.beta.angle_deg()) * pose.direction
        if pose.direction and approach_deg < SHORTEST_APPROACH_DEG:
            self.beta.move_to(pose.beta_deg - pose.direction * self.limits.overrun_deg)
        self.beta.move_to(pose.beta_deg)
        self.host.doing(f"holding alpha {pose.alpha_deg:g}, beta {pose.beta_deg:g} deg")

    def hold(self, pose: Pose, dwell_s: float, settle_s: float) -> None:
        """Move to `pose`, wait `settle_s`, record `dwell_s` seconds, and the temperature in the middle of them.

        Raises SettingError above LONGEST_DWELL_S, before anything moves.
        """
        if dwell_s > LONGEST_DWELL_S:
            raise SettingError(f"a dwell of {dwell_s:g} s is longer than {LONGEST_DWELL_S:g} s; give a shorter dwell_s")
        self.move_to(pose)
        self.wait(settle_s)
        samples, temperature_c = self.adc.acquire_with(dwell_s, self.oven.temperature_c)
        self.keep(pose, samples=samples, temperature_c=temperature_c)

    def turn(self, pose: Pose, turn_deg: float) -> None:
        """Turn beta by `turn_deg` from the pose's angle at the pose's rate, and record the samples of the turn.

        The converter is prepared before: beta does not wait for it during the turn.
        """
        self.mount(pose.mount_deg, pose.flip, pose.up)
        self.alpha.move_to(pose.alpha_deg)
        self.host.doing(f"turning beta at {pose.rate_deg_s:g} deg/s, alpha {pose.alpha_deg:g} deg")
        last_deg = pose.beta_deg + math.copysign(turn_deg, pose.rate_deg_s)
        self.adc.prepare()
        with self.beta.turning(abs(pose.rate_deg_s), pose.beta_deg, last_deg) as turn:
            samples = self.adc.acquire_watched(turn_deg / abs(turn.rate_deg_s), turn.require, turn.beat_s)
        self.keep(pose, samples=samples, temperature_c=self.oven.temperature_c())

    def mount(self, mount_deg: float, flip: int, up: str = "z") -> None:
        """Ask a person for this mounting if it is a new one, at alpha = 0, where the table is horizontal."""
        mount = {"mount": mount_deg, "flip": flip, "edge": EDGES.index(up)}
        if all((self.reading(name) or 0.0) == value for name, value in mount.items()):
            return
        self.alpha.move_to(0.0)
        question = Mounting.of(mount_deg, flip, up)
        if self.host.ask(question) == "no":
            raise Declined(f"{question.name}: the sensor does not have this mounting; mount it, then resume the run")
        units = {"mount": "deg"}
        self.keep_readings(*(Reading(name, value, units.get(name, "")) for name, value in mount.items()))

    def keep(self, pose: Pose, *, samples: Samples, temperature_c: float | None = None) -> None:
        """Store `pose` in the record. The temperature that the sensor reports replaces that of a thermometer beside it.

        Raises SafetyLimit for a temperature outside the limits of the bench.
        """
        temperature_c = temperature_c if samples.temperature_c is None else samples.temperature_c
        self.check_temperature(temperature_c)
        self.host.keep(pose, samples, temperature_c)

    def check_temperature(self, temperature_c: float | None) -> None:
        """Raises SafetyLimit for a temperature of the sensor outside the limits; an unknown temperature passes."""
        low, high = self.limits.temperature_c
        if temperature_c is not None and not (math.isfinite(temperature_c) and low <= temperature_c <= high):
            raise SafetyLimit(
                f"oven: the sensor is at {temperature_c:g} C, outside the limits of {low:g} to {high:g} C; wait until "
                "it is back inside them, or change limits.temperature_c in the bench file"
            )

    def keep_stretch(self, poses: Sequence[Pose], block_s: float) -> None:
        """Record without gaps: `block_s` seconds for each of `poses`. The stages do not move."""
        blocks = self.adc.stream(len(poses) * block_s, block_s)
        for pose, samples in zip(poses, blocks, strict=True):
            self.keep(pose, samples=samples, temperature_c=self.oven.temperature_c())

    def measured(self) -> Sequence[Dwell]:
        """All measurements of this run, in order. An adaptive procedure chooses its poses by them."""
        return self.host.measured()

    def recorded(self) -> Sequence[RecordedPose]:
        """All poses of this run with their samples, in order."""
        return self.host.recorded()

    def reading(self, name: str) -> float | None:
        """The value of a reading of this run; None if it is not in the record."""
        return next((reading.value for reading in self.host.readings() if reading.name == name), None)

    def keep_readings(self, *readings: Reading) -> None:
        """Store numbers that belong to the run, not to a pose, in one transaction."""
        self.host.keep_readings(*readings)

    def confirm(self, name: str, text: str, drawing: str = "") -> None:
        """Ask a person to confirm `text`; `name` is the key in a file of answers. Raises Declined, NoAnswer."""
        self.request(Confirm(name, text, drawing))

    def request(self, question: Confirm) -> None:
        """Ask a person to do the work in `question` and to confirm it. Raises Declined, NoAnswer."""
        if self.host.ask(question) == "no":
            raise Declined(f'{question.name}: the answer to "{question.text}" is no; correct this, then resume the run')

    def number(self, name: str, text: str, unit: str, low: float, high: float) -> float:
        """Ask a person for a number, every time. Raises NoAnswer."""
        return float(self.host.ask(Number(name, text, unit=unit, low=low, high=high, repeated=True)))

    def wait(self, seconds: float) -> None:
        """Wait on the clock."""
        self.clock.sleep(seconds)

    def reference(self) -> None:
        """Home every stage without a reference."""
        for name, stage in (("alpha", self.alpha), ("beta", self.beta)):
            if not stage.referenced():
                self.host.doing(f"homing {name}")
                stage.home()
