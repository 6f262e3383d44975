"""A simulated rig without sockets: instruments that act on the world directly, and a host that remembers."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calibrations.table import Table
from drivers.handheld.world import HandheldWorld
from drivers.motor_stage import Turn
from drivers.recorder import Samples
from drivers.world.stage import Trajectory
from drivers.world.world import World
from procedures.questions import Mounting, Question
from procedures.session import Dwell, Guidance, Limits, Pose, Reading, Session
from rig.record.values import KeptPose

CHANNELS = ("vx", "vy", "supply")
RATE_HZ = 1000.0


@dataclass
class Stage:
    """Turns the world's stage at 30 deg/s."""

    world: World
    axis: str

    def move_to(self, deg: float) -> None:
        if deg != self.angle_deg():
            way = Trajectory(self.world.now_s, self.angle_deg(), deg, 30.0, 60.0)
            self.world.move_stage(self.axis, way)
            self.world.advance(way.end_s)

    def angle_deg(self) -> float:
        return self.world.motor_angle_deg(self.axis)

    def rate_deg_s(self, asked_deg_s: float) -> float:
        return asked_deg_s

    @contextmanager
    def turning(self, rate_deg_s: float, first_deg: float, last_deg: float) -> Iterator[Turn]:
        """Two seconds of run-up on either side, at 60 deg/s^2."""
        way = math.copysign(1.0, last_deg - first_deg)
        beyond_deg = rate_deg_s**2 / 120.0 + 2.0 * rate_deg_s
        self.move_to(first_deg - way * beyond_deg)
        turn = Trajectory(self.world.now_s, self.angle_deg(), last_deg + way * beyond_deg, rate_deg_s, 60.0)
        self.world.move_stage(self.axis, turn)
        self.world.advance(self.world.now_s + rate_deg_s / 60.0 + 2.0)
        yield Turn(way * rate_deg_s, math.inf, lambda: None)
        self.world.advance(turn.end_s)

    def home(self) -> None: ...

    def referenced(self) -> bool:
        return True

    def stop(self) -> None: ...


@dataclass
class Adc:
    """Samples of the world's outputs, rounded to codes."""

    world: World
    power_log: list[bool] = field(default_factory=list)
    channels: tuple[str, ...] = CHANNELS

    def prepare(self) -> None: ...

    def acquire(self, duration_s: float) -> Samples:
        start_s, n = self.world.now_s, round(duration_s * RATE_HZ)
        volts = self.world.adc_volts(self.channels, start_s, 1 / RATE_HZ, n)
        step_v = self.world.config.converter.step_v
        return Samples(np.rint(volts / step_v) * step_v, self.channels, RATE_HZ, start_s)

    def acquire_watched(self, duration_s: float, watch: Callable[[], object], every_s: float) -> Samples:
        return self.acquire(duration_s)

    def only(self, *outputs: str) -> Adc:
        return replace(self, channels=outputs)

    def acquire_with(self, duration_s: float, reading: Callable[[], Any]) -> tuple[Samples, Any]:
        return self.acquire(duration_s), reading()

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        raise NotImplementedError

    def power(self, on: bool) -> None:
        self.power_log.append(on)
        self.world.power(on)


@dataclass
class Oven:
    """The world's oven, with a log of what it was told."""

    world: World
    set_c: float = 25.0
    told: list[object] = field(default_factory=list)

    def temperature_c(self) -> float:
        return self.world.thermometer_c()

    def set_temperature(self, c: float) -> None:
        self.told.append(c)
        self.set_c = c

    def run(self, on: bool) -> None:
        self.told.append(on)
        self.world.oven_set(self.set_c, on)


@dataclass
class Clock:
    """The world's time."""

    world: World

    def now(self) -> float:
        return self.world.now_s

    def sleep(self, seconds: float) -> None:
        self.world.advance(self.world.now_s + seconds)


@dataclass
class Book:
    """A host that remembers, and a technician who does what is asked."""

    world: World
    dwells: list[Dwell] = field(default_factory=list)
    blocks: list[KeptPose] = field(default_factory=list)
    read: list[Reading] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    guided: list[Guidance] = field(default_factory=list)

    def kept(self) -> Sequence[Pose]:
        return [dwell.pose for dwell in self.dwells]

    def expect(self, missing: int) -> None: ...

    def measured(self) -> Sequence[Dwell]:
        return self.dwells

    def recorded(self) -> Sequence[KeptPose]:
        return self.blocks

    def readings(self) -> Sequence[Reading]:
        return self.read

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None:
        middle_s = samples.start_s + len(samples.volts) / samples.rate_hz / 2
        self.blocks.append(KeptPose(pose, samples, middle_s, temperature_c, number=len(self.blocks)))
        self.dwells.append(self.blocks[-1].dwell)

    def keep_readings(self, *readings: Reading) -> None:
        names = {reading.name for reading in readings}
        self.read = [r for r in self.read if r.name not in names] + list(readings)

    def ask(self, question: Question) -> str:
        self.asked.append(question.name)
        if isinstance(question, Mounting):
            self.world.mount_sensor(question.mount_deg, question.flip, question.up)
        return question.checked("yes")

    def doing(self, text: str) -> None: ...

    def guide(self, guidance: Guidance) -> None:
        """A world with a hand follows."""
        self.guided.append(guidance)
        if isinstance(self.world, HandheldWorld) and guidance.moves:
            self.world.turn_by_hand(guidance.up, guidance.north)

    def table(self) -> Table:
        """What was kept, as the table that analysis takes."""
        poses = [dwell.pose for dwell in self.dwells]
        names = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
        columns = {name: [float(getattr(pose, name)) for pose in poses] for name in names}
        columns |= {f"{c}_v": [d.means[c] for d in self.dwells] for c in CHANNELS}
        columns |= {f"{c}_std_v": [d.stds[c] for d in self.dwells] for c in CHANNELS[:2]}
        columns |= {"n": [float(d.n) for d in self.dwells], "t_s": [d.t_s for d in self.dwells]}
        columns |= {"temperature_c": [d.temperature_c or 0.0 for d in self.dwells]}
        constants = {"sample_rate_hz": RATE_HZ, "filter_corner_hz": 15.07}
        return Table.from_columns("poses", columns, constants, "test", {"path": tuple(p.path for p in poses)})


def session(world: World, limits: Limits | None = None, dwells: Sequence[Dwell] = ()) -> tuple[Session, Book]:
    """A session on `world`, and its host, which already holds `dwells`."""
    book = Book(world, list(dwells))
    alpha, beta = Stage(world, "alpha"), Stage(world, "beta")
    positioner: object = None
    rig = Session(alpha, beta, Adc(world), Oven(world), None, positioner, Clock(world), book, limits or Limits())
    return rig, book
