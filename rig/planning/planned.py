"""Planned instruments: they record the steps and durations of a procedure, and nothing moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Protocol

import numpy as np

from calibrations.table import Array
from drivers.dpg2.driver import LevelReading
from drivers.errors import LimitError
from drivers.instrument import OUTSIDE_ANGLE, OUTSIDE_POSITION, OUTSIDE_TEMPERATURE, require_within
from drivers.labjack_t7.driver import Settings as AdcSettings
from drivers.motor_stage import Turn
from drivers.omega_cn7500.driver import Settings as OvenSettings
from drivers.recorder import Samples
from procedures.bounds import MOST_POSES
from procedures.questions import Choice, Number, Question
from procedures.session import SHORTEST_APPROACH_DEG, Dwell, Guidance, Pose, Reading, RecordedPose
from rig.bench import Bench
from rig.errors import PlanError

LEVEL_S = 1.0  # a reading of the level
ROOM_C = 25.0
MOST_STEPS = 10 * MOST_POSES
DAY_S = 86_400.0
MOST_S = 400 * DAY_S  # a stability test takes a year; more is a mistyped setting
EXCHANGE_S = 0.05  # time of commands and polls for each move or recording


@dataclass(frozen=True)
class Step:
    """One step of a plan: from `start_s` for `duration_s`."""

    start_s: float
    duration_s: float
    what: str


@dataclass(frozen=True)
class PlannedDwell:
    """A recorded pose: its dwell begins at `start_s`."""

    start_s: float
    pose: Pose


@dataclass
class Ledger:
    """The clock of the plan, and its steps so far."""

    now_s: float = 0.0
    steps: list[Step] = field(default_factory=list)
    asked: list[Question] = field(default_factory=list)
    held: list[PlannedDwell] = field(default_factory=list)
    samples: int = 0

    def now(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.add(f"wait {seconds:g} s", seconds)

    def add(self, action: str, duration_s: float) -> None:
        if len(self.steps) >= MOST_STEPS:
            raise PlanError(
                f"the plan has more than {MOST_STEPS} steps; give larger steps, a shorter time, or fewer repetitions"
            )
        self.steps.append(Step(self.now_s, duration_s, action))
        self.now_s += duration_s
        if not self.now_s < MOST_S:
            raise PlanError(
                f"the plan has more than {MOST_S / DAY_S:.0f} days; give a shorter time, or fewer repetitions"
            )


class StageSettings(Protocol):
    """The settings of a stage that a plan needs, for any driver."""

    @property
    def limits_deg(self) -> tuple[float, float]: ...

    def move_s(self, distance_deg: float) -> float: ...

    def way_of_turn(self, name: str, rate_deg_s: float, first_deg: float, last_deg: float) -> tuple[float, float]: ...

    def rate_deg_s(self, asked_deg_s: float) -> float: ...


class PlannedStage:
    """A planned stage: it is at the last target, and refuses the same targets as its driver."""

    def __init__(self, name: str, settings: StageSettings, ledger: Ledger) -> None:
        self._name, self._settings, self._ledger = name, settings, ledger
        self._at_deg = 0.0
        self._homed = False
        self.reach = (0.0, 0.0)

    def move_to(self, deg: float) -> None:
        require_within(f"{self._name}: ", deg, self._settings.limits_deg, "deg", OUTSIDE_ANGLE, "nothing was moved")
        if deg != self._at_deg:
            move_s = self._settings.move_s(abs(deg - self._at_deg))
            self._ledger.add(f"{self._name} from {self._at_deg:g} to {deg:g} deg", move_s + EXCHANGE_S)
        self._at_deg = deg
        self.reach = (min(self.reach[0], deg), max(self.reach[1], deg))

    def rate_deg_s(self, asked_deg_s: float) -> float:
        return self._settings.rate_deg_s(asked_deg_s)

    @contextmanager
    def turning(self, rate_deg_s: float, first_deg: float, last_deg: float) -> Iterator[Turn]:
        start_deg, end_deg = self._settings.way_of_turn(self._name, rate_deg_s, first_deg, last_deg)
        self.move_to(start_deg)
        self._ledger.add(f"{self._name} turns to {end_deg:g} deg at {rate_deg_s:g} deg/s", EXCHANGE_S)
        yield Turn(math.copysign(rate_deg_s, last_deg - first_deg), math.inf, lambda: None)
        outside_deg = abs(end_deg - start_deg) - abs(last_deg - first_deg)
        self._ledger.add(f"{self._name} brakes", outside_deg / rate_deg_s + EXCHANGE_S)
        self._at_deg = end_deg
        self.reach = (min(self.reach[0], end_deg), max(self.reach[1], end_deg))

    def angle_deg(self) -> float:
        return self._at_deg

    def home(self) -> None:
        self._ledger.add(f"{self._name} seeks its home", EXCHANGE_S)
        self._homed = True

    def referenced(self) -> bool:
        return self._homed

    def stop(self) -> None:
        """Do nothing: a planned stage does not move."""

    @property
    def limits(self) -> tuple[float, float]:
        return self._settings.limits_deg


class PlannedAdc:
    """A planned converter that counts samples. The sensor is on until it is switched off."""

    def __init__(self, name: str, settings: AdcSettings, ledger: Ledger) -> None:
        self._name, self._settings, self._ledger = name, settings, ledger
        self._power = True

    def prepare(self) -> None:
        """Nothing to set up."""

    def acquire(self, duration_s: float) -> Samples:
        return next(self.stream(duration_s, duration_s))

    def acquire_with(self, duration_s: float, reading: Callable[[], Any]) -> tuple[Samples, None]:  # noqa: ARG002
        return self.acquire(duration_s), None

    def acquire_watched(self, duration_s: float, watch: Callable[[], object], every_s: float) -> Samples:  # noqa: ARG002
        return self.acquire(duration_s)

    def only(self, *outputs: str) -> PlannedAdc:
        return PlannedAdc(self._name, self._settings.only(self._name, outputs), self._ledger)

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        names, rate_hz = tuple(self._settings.channels), self._settings.rate_hz
        start_s = self._ledger.now()
        count = max(1, round(duration_s / block_s))
        self._ledger.add(f"{self._name} records {', '.join(names)} for {duration_s:g} s", duration_s + EXCHANGE_S)
        self._ledger.now_s -= duration_s
        for k in range(count):  # a record may be ended before its last block
            self._ledger.now_s += duration_s / count
            self._ledger.samples += max(1, round(duration_s / count * rate_hz)) * len(names)
            yield Samples(np.zeros((1, len(names))), names, rate_hz, start_s + k * block_s)

    def power(self, on: bool) -> None:
        if self._settings.power_dio is None:
            raise LimitError(f"{self._name}: the program cannot switch the power", "Set power_dio in the bench file")
        if on != self._power:
            self._ledger.add(f"{self._name} switches the sensor {'on' if on else 'off'}", EXCHANGE_S)
        self._power = on


class PlannedOven:
    """A planned oven at its set point. It is off until it is switched on."""

    def __init__(self, name: str, settings: OvenSettings, ledger: Ledger) -> None:
        self._name, self._settings, self._ledger = name, settings, ledger
        self._set_c: float | None = None
        self._on = False

    def temperature_c(self) -> float:
        return ROOM_C if self._set_c is None else self._set_c

    def set_temperature(self, c: float) -> None:
        require_within(f"{self._name}: ", c, self._settings.limits_c, "C", OUTSIDE_TEMPERATURE)
        if c != self._set_c:
            self._ledger.add(f"{self._name} to {c:g} C", EXCHANGE_S)
        self._set_c = c

    def run(self, on: bool) -> None:
        if on != self._on:
            self._ledger.add(f"{self._name} {'on' if on else 'off'}", EXCHANGE_S)
        self._on = on


class PlannedLevel:
    """A planned level that reads 0."""

    def __init__(self, name: str, settings: Any, ledger: Ledger) -> None:  # noqa: ARG002
        self._name, self._ledger = name, ledger

    def read(self) -> LevelReading:
        self._ledger.add(f"{self._name} is read", LEVEL_S)
        return LevelReading(0.0, 0.0, 0.0, 1, 0.0)


class PlannedPositioner:
    """A planned positioner, which refuses the same targets as its driver."""

    def __init__(self, name: str, settings: Any, ledger: Ledger) -> None:
        self._name, self._settings, self._ledger = name, settings, ledger

    def servo(self, on: bool) -> None:
        self._ledger.add(f"{self._name} servo {'on' if on else 'off'}", EXCHANGE_S)

    def move_to(self, axis: str, um: float) -> None:
        self._require_within(axis, um)
        self._ledger.add(f"{self._name} moves {axis} to {um:g} um", EXCHANGE_S)

    def oscillate(self, axis: str, *, peak_to_peak_um: float, frequency_hz: float, centre_um: float) -> float:
        self._require_within(axis, centre_um - peak_to_peak_um / 2, centre_um + peak_to_peak_um / 2)
        really_hz: float = self._settings.wave(self._name, frequency_hz).frequency_hz
        action = f"{self._name} swings {axis} by {peak_to_peak_um:g} um peak to peak at {really_hz:g} Hz"
        self._ledger.add(action, EXCHANGE_S)
        return really_hz

    def stop(self) -> None:
        self._ledger.add(f"{self._name} stops", EXCHANGE_S)

    def _require_within(self, axis: str, *positions_um: float) -> None:
        for um in positions_um:
            require_within(f"{self._name}: {axis} = ", um, self._settings.limits_um, "um", OUTSIDE_POSITION)


def plan_answer(question: Question) -> str:
    """A valid answer to a question."""
    if isinstance(question, Number):
        return repr(min(max(0.0, question.low), question.high))
    return question.choices[0] if isinstance(question, Choice) else "yes"


@dataclass
class PlanHost:
    """The host of a planned session: it stores readings, such as the mounting of the sensor, and no samples."""

    ledger: Ledger
    read: dict[str, Reading] = field(default_factory=dict, kw_only=True)

    def kept(self) -> Sequence[Pose]:
        return ()

    def expect(self, missing: int) -> None:
        """A plan has no progress."""

    def measured(self) -> Sequence[Dwell]:
        return ()

    def recorded(self) -> Sequence[RecordedPose]:
        return ()

    def readings(self) -> Sequence[Reading]:
        return list(self.read.values())

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None:  # noqa: ARG002
        self.ledger.held.append(PlannedDwell(samples.start_s, pose))

    def keep_readings(self, *readings: Reading) -> None:
        self.read |= {reading.name: reading for reading in readings}

    def ask(self, question: Question) -> str:
        self.ledger.asked.append(question)
        return plan_answer(question)

    def doing(self, text: str) -> None:
        """The steps of the plan are enough."""

    def guide(self, guidance: Guidance) -> None:
        """The steps of the plan are enough."""


# Duration of moves between poses, in the order of a session: alpha first, then beta from its side.

REMOUNT_S = 900.0  # a person turns the sensor over, and its temperature settles again
HOME = Pose(0.0, 0.0)


def moves_s(bench: Bench, poses: Sequence[Pose]) -> Array:
    """Duration from each of `poses` to each, s, shape (n, n)."""
    moves = _Moves.of(bench)
    return np.array([[moves.seconds(a, b) for b in poses] for a in poses])


def from_home_s(bench: Bench, poses: Sequence[Pose]) -> Array:
    """Duration from both stages at 0 with the sensor face up, s, shape (n,)."""
    moves = _Moves.of(bench)
    return np.array([moves.seconds(HOME, pose) for pose in poses])


@dataclass(frozen=True)
class _Moves:
    """Duration of a move of each stage by its distance, and the overrun of an approach."""

    alpha_s: Callable[[float], float]
    beta_s: Callable[[float], float]
    overrun_deg: float

    @staticmethod
    def of(bench: Bench) -> _Moves:
        alpha, beta = (bench.instruments[role].parse_settings().move_s for role in ("alpha", "beta"))
        return _Moves(cache(alpha), cache(beta), bench.limits.overrun_deg)

    def seconds(self, start: Pose, end: Pose) -> float:
        """Duration of all moves from one pose to another, with a remount, s."""
        distance_deg = end.beta_deg - start.beta_deg
        beta_deg = [abs(distance_deg)]
        if end.direction and distance_deg * end.direction < SHORTEST_APPROACH_DEG:
            beta_deg = [abs(distance_deg - end.direction * self.overrun_deg), self.overrun_deg]
        moves = [(self.alpha_s, abs(end.alpha_deg - start.alpha_deg)), *((self.beta_s, deg) for deg in beta_deg)]
        remount_s = REMOUNT_S * ((end.mount_deg, end.flip) != (start.mount_deg, start.flip))
        return remount_s + sum(move_s(deg) + EXCHANGE_S for move_s, deg in moves if deg)
