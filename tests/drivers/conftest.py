"""A small world and a whole bench on it: two stages on one bus, a converter, an oven, all through sockets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from drivers.clock import SimulatedClock
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7 import twin as labjack_t7_twin
from drivers.omega_cn7500 import driver as omega_cn7500
from drivers.omega_cn7500 import twin as omega_cn7500_twin
from drivers.oriental_az import driver as oriental_az
from drivers.oriental_az import twin as oriental_az_twin
from drivers.transport import Links
from drivers.transport.link import open_link
from drivers.transport.server import Server
from drivers.world import positioner
from drivers.world.kernel import record
from drivers.world.stage import Trajectory, at_rest
from tests.carriages import at_rest as carriage_at_rest
from tests.drivers.digital import DigitalSensors

STAGE = oriental_az.Settings(limits_deg=(-400.0, 400.0), speed_deg_s=20.0, acceleration_deg_s2=40.0)
CONVERTER = labjack_t7.Settings(channels={"time": 2, "noise": 0, "supply": 5}, rate_hz=1000.0, power_dio=3)
LOOP = record(positioner.Positioner())
OVEN = omega_cn7500.Settings(limits_c=(0.0, 85.0))


class SmallWorld:
    """Volts that tell when they were sampled, noise out of a generator, motors that follow their plans."""

    def __init__(self, seed: int = 0) -> None:
        self.now_s = 0.0
        self.powered = True
        self.oven = (25.0, False)
        self.plans = {"alpha": at_rest(7.0), "beta": at_rest(0.0)}
        self.carriages = {axis: carriage_at_rest(0.5) for axis in positioner.AXES}
        self._random = np.random.Generator(np.random.PCG64(seed))

    def advance(self, t_s: float) -> None:
        assert t_s >= self.now_s - 1e-9, "time went back"
        self.now_s = max(t_s, self.now_s)

    def move_stage(self, axis: str, trajectory: Trajectory) -> None:
        self.plans[axis] = trajectory

    def motor_angle_deg(self, axis: str) -> float:
        return self.plans[axis].angle_deg(self.now_s)

    def move_positioner(self, axis: str, command: positioner.Command) -> float:
        self.carriages[axis], settled_s = positioner.follow_command(LOOP, self.carriages[axis], command)
        return settled_s

    def positioner_um(self, axis: str, times_s: ArrayLike) -> NDArray[np.float64]:
        return positioner.read_um(LOOP, self.carriages[axis], times_s, positioner.AXES.index(axis))

    def power(self, on: bool) -> None:
        self.powered = on

    def oven_set(self, set_point_c: float, running: bool) -> None:
        self.oven = (set_point_c, running)

    def thermometer_c(self) -> float:
        return 21.5 + (self.now_s > 100 and self.oven[1]) * 10

    def level_deg(self) -> tuple[float, float]:
        return self.motor_angle_deg("alpha") + 0.002 * np.sin(1e3 * self.now_s), -0.007

    def adc_volts(self, inputs: Sequence[str], start_s: float, interval_s: float, n: int) -> NDArray[np.float64]:
        assert start_s >= self.now_s - 1e-9, "samples of the past"
        t = start_s + interval_s * np.arange(n)
        self.advance(float(t[-1]))
        noise = self._random.standard_normal(n)
        columns = {"time": 0.01 * t, "noise": 1e-3 * noise, "supply": np.full(n, 5.0)}
        return np.column_stack([columns[name] for name in inputs])

    def state(self) -> dict[str, Any]:
        return {
            "now_s": self.now_s,
            "plans": {axis: asdict(plan) for axis, plan in self.plans.items()},
            "carriages": {axis: pieces.tolist() for axis, pieces in self.carriages.items()},
            "oven": list(self.oven),
            "random": self._random.bit_generator.state,
        }

    def restore(self, state: dict[str, Any]) -> None:
        self.now_s = state["now_s"]
        self.plans = {axis: Trajectory(**plan) for axis, plan in state["plans"].items()}
        self.carriages = {axis: np.array(pieces) for axis, pieces in state["carriages"].items()}
        self.oven = (state["oven"][0], state["oven"][1])
        self._random.bit_generator.state = state["random"]


@contextmanager
def bytes_exchanged(server: Server, clock: SimulatedClock) -> Iterator[Callable[[str], str]]:
    """A function that sends hexadecimal bytes to a simulated instrument, and returns those of the answer."""
    clock.attach(server)
    link = open_link(server.url, clock)

    def exchange(request: str) -> str:
        link.write(bytes.fromhex(request))
        return link.read(0.2).hex(" ").upper()

    yield exchange
    link.close()
    server.close()


@dataclass
class SmallBench:
    """Everything, by role."""

    world: SmallWorld
    clock: SimulatedClock
    servers: dict[str, Server]
    links: Links
    alpha: oriental_az.RotaryStage
    beta: oriental_az.RotaryStage
    adc: labjack_t7.T7
    oven: omega_cn7500.Oven

    def close(self) -> None:
        self.links.close()
        for server in self.servers.values():
            server.close()


def small_bench(seed: int = 0) -> SmallBench:
    world, clock = SmallWorld(seed), SimulatedClock()
    servers = {
        "bus": oriental_az_twin.serve(world, {"alpha": (1, STAGE), "beta": (2, STAGE)}),
        "adc": labjack_t7_twin.serve(world, {"adc": (1, CONVERTER)}),
        "oven": omega_cn7500_twin.serve(world, {"oven": (1, OVEN)}),
    }
    for server in servers.values():
        clock.attach(server)
    links, at = Links(clock), {role: a for s in servers.values() for role, a in s.addresses.items()}
    return SmallBench(
        world,
        clock,
        servers,
        links,
        oriental_az.connect(at["alpha"], links, STAGE, "alpha"),
        oriental_az.connect(at["beta"], links, STAGE, "beta"),
        labjack_t7.connect(at["adc"], links, CONVERTER, "adc"),
        omega_cn7500.connect(at["oven"], links, OVEN, "oven"),
    )


@pytest.fixture
def clock() -> SimulatedClock:
    return SimulatedClock()


@pytest.fixture
def make_bench() -> Iterator[Callable[..., SmallBench]]:
    """Build a bench with a seed; all are closed at the end."""
    benches: list[SmallBench] = []

    def make(seed: int = 0) -> SmallBench:
        benches.append(small_bench(seed))
        return benches[-1]

    yield make
    for one in benches:
        one.close()


@pytest.fixture
def bench(make_bench: Callable[..., SmallBench]) -> SmallBench:
    return make_bench()


@pytest.fixture
def small_world() -> SmallWorld:
    return SmallWorld()


@pytest.fixture
def digital() -> Iterator[DigitalSensors]:
    """Simulated digital sensors, closed at the end of the test."""
    sensors = DigitalSensors()
    yield sensors
    sensors.close()
