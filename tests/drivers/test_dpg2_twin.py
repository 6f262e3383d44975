"""The simulated DPG2: what it says unasked and asked, when, and on what; with our driver, and with pyserial alone."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import serial

from drivers.clock import SimulatedClock, serve_forever
from drivers.dpg2 import driver as dpg2
from drivers.dpg2 import twin as dpg2_twin
from drivers.dpg2.twin import LevelServer
from drivers.errors import InstrumentError
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7 import twin as labjack_t7_twin
from drivers.transport import Links
from drivers.transport.address import Url
from drivers.transport.link import Link, open_link
from drivers.world.config import WorldConfig
from drivers.world.stage import Trajectory, at_rest
from drivers.world.world import World

PAIR = re.compile(r"X=([+-]\d\d\.\d{3})\r\nY=([+-]\d\d\.\d{3})\r\n")
CHARACTER_S = 10 / 9600
USUAL = dpg2.Settings()


class Plate:
    """A plate that is at `x_deg`, or as steep as it is late."""

    def __init__(self, x_deg: float | None = None) -> None:
        self.now_s, self._x_deg = 0.0, x_deg

    def advance(self, t_s: float) -> None:
        assert t_s >= self.now_s
        self.now_s = t_s

    def level_deg(self) -> tuple[float, float]:
        return (self.now_s if self._x_deg is None else self._x_deg), -0.007


@pytest.fixture
def serve(clock: SimulatedClock) -> Iterator[Callable[..., LevelServer]]:
    servers: list[LevelServer] = []

    def start(world: Any, listen: str = dpg2_twin.LISTEN, clock: SimulatedClock = clock) -> LevelServer:
        servers.append(dpg2_twin.serve(world, {"level": (1, dpg2.Settings())}, listen))
        clock.attach(servers[-1])
        return servers[-1]

    yield start
    for server in servers:
        server.close()


@pytest.fixture
def link(serve: Callable[..., LevelServer], clock: SimulatedClock) -> Iterator[Link]:
    """A wire to a level on a plate that is as steep as it is late."""
    opened = open_link(serve(Plate()).url, clock)
    yield opened
    opened.close()


def heard(link: Link, seconds: float) -> str:
    """All that comes within `seconds`."""
    deadline, data = link.clock.now() + seconds, b""
    while more := link.read(deadline - link.clock.now()):
        data += more
    return data.decode()


def asked(link: Link, letters: bytes, seconds: float = 0.09) -> str:
    link.write(letters)
    return heard(link, seconds)


def test_it_talks_ten_times_a_second_unasked(link: Link) -> None:
    pairs = PAIR.findall(heard(link, 0.95))
    assert pairs == [(f"+00.{k}00", "-00.007") for k in range(10)]


def test_a_line_takes_its_time_at_9600_baud(link: Link) -> None:
    times_s = []
    for _ in range(4):
        link.read(1.0)
        times_s.append(link.clock.now())
    first_s, second_s = 11 * CHARACTER_S, 22 * CHARACTER_S
    assert times_s == pytest.approx([first_s, second_s, 0.1 + first_s, 0.1 + second_s])


def test_stopped_it_answers_letter_by_letter(link: Link) -> None:
    assert asked(link, b"s", 0.2).endswith("s")
    assert heard(link, 1.0) == ""
    assert PAIR.fullmatch(asked(link, b"R"))
    assert asked(link, b"V") == "DPL2 V1.8.0\r\nSN:123456789\r\n"
    assert asked(link, b"fxq?\r\n") == ""
    assert asked(link, b"s") == "s"
    assert len(PAIR.findall(asked(link, b"S", 1.0))) == 10


def test_while_it_talks_it_hears_nothing_but_the_stop(link: Link) -> None:
    assert "SN" not in asked(link, b"VR", 0.05)
    assert len(PAIR.findall(heard(link, 1.0))) == 10


@pytest.mark.parametrize(
    ("deg", "shown"),
    [(29.9994, "+29.999"), (-0.0004, "-00.000"), (-4.25, "-04.250"), (30.01, "+++++++"), (-171.0, "-------")],
)
def test_the_twin_shows_its_tilt_as_the_manual_says(
    serve: Callable[..., LevelServer], clock: SimulatedClock, deg: float, shown: str
) -> None:
    link = open_link(serve(Plate(deg), "rtu+tcp://127.0.0.1:0").url, clock)
    assert heard(link, 0.09) == f"X={shown}\r\nY=-00.007\r\n"
    link.close()


def test_what_nobody_reads_is_lost_and_time_passes_freely(serve: Callable[..., LevelServer], clock: Any) -> None:
    world = Plate()
    server = serve(world)
    clock.sleep(3600.0)
    assert world.now_s < 600.0  # the line was full, and it looked no more
    link = open_link(server.url, clock)
    link.discard()
    text = heard(link, 0.5)
    assert text.count("X=+++++++\r\n") >= 4  # of this hour
    assert PAIR.findall(text) == []
    link.close()


def test_after_a_sleep_every_line_is_of_its_own_time(link: Link) -> None:
    link.clock.sleep(2.05)
    shown = [float(x) for x, _ in PAIR.findall(heard(link, 0.03))]
    assert shown == pytest.approx([0.1 * k for k in range(21)], abs=0.0006)


def test_a_restored_level_is_as_talkative_as_it_was(serve: Callable[..., LevelServer], clock: SimulatedClock) -> None:
    first, second = serve(Plate()), serve(Plate(1.0))
    link = open_link(first.url, clock)
    asked(link, b"s")
    kept = json.dumps(first.state())
    link.close()
    other = open_link(second.url, clock)
    heard(other, 0.5)
    second.restore(json.loads(kept))
    other.discard(0.05)
    assert heard(other, 1.0) == ""
    other.close()


def driver_on(
    world: Any, serve: Callable[..., LevelServer], clock: SimulatedClock, settings: dpg2.Settings = USUAL
) -> tuple[dpg2.Level, Links]:
    links = Links(clock)
    return dpg2.connect(serve(world).addresses["level"], links, settings, "level"), links


def test_the_driver_reads_the_tilt_of_the_rig(serve: Callable[..., LevelServer], clock: SimulatedClock) -> None:
    world = World(WorldConfig.ideal().changed({"base": {"tilt_x_deg": 0.2, "tilt_y_deg": 0.4}}), seed=3)
    level, links = driver_on(world, serve, clock)
    front = level.read()
    world.move_stage("beta", at_rest(180.0))
    back = level.read()
    assert (front.x_deg, front.y_deg) == pytest.approx((-back.x_deg, -back.y_deg), abs=0.01)
    assert abs(front.x_deg) == pytest.approx(0.4, rel=0.4)  # an individual rig: its tilt is scattered
    assert 0.0003 < front.std_deg < 0.002
    world.move_stage("alpha", at_rest(40.0))
    with pytest.raises(InstrumentError, match="beyond its range"):
        level.read()
    links.close()


def test_the_driver_waits_for_a_stage_that_turns(serve: Callable[..., LevelServer], clock: SimulatedClock) -> None:
    world = World(WorldConfig.ideal(), seed=3)
    level, links = driver_on(world, serve, clock)
    world.advance(clock.now())
    world.move_stage("alpha", Trajectory(clock.now(), 0.0, 5.0, 2.0, 2.0))
    assert level.read().x_deg == pytest.approx(5.0, abs=0.01)
    links.close()


def test_the_same_seed_gives_the_same_readings(serve: Callable[..., LevelServer]) -> None:
    found = []
    for clock in (SimulatedClock(), SimulatedClock()):
        links = Links(clock)
        address = serve(World(WorldConfig.adxl203(), seed=5), clock=clock).addresses["level"]
        level = dpg2.connect(address, links, dpg2.Settings(), "level")
        found.append([*(level.read() for _ in range(3)), clock.now()])
        links.close()
    assert found[0] == found[1]


def test_a_level_that_does_not_hear_the_stop_is_read_without_delay(
    serve: Callable[..., LevelServer], clock: SimulatedClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dpg2_twin, "STOP", b"-")
    level, links = driver_on(Plate(), serve, clock, dpg2.Settings(readings=2, interval_s=2.0, unrest_deg=5.0))
    shown_s = level.read().x_deg  # the mean of two readings, 2 s apart
    assert clock.now() - 1.3 < shown_s < clock.now() - 0.9
    links.close()


def samples_beside(serve: Callable[..., LevelServer], clock: SimulatedClock, talking: bool) -> bytes:
    world, links, settings = World(WorldConfig.adxl203(), seed=5), Links(clock), labjack_t7.Settings({"vx": 0, "vy": 1})
    if talking:
        level = open_link(serve(world, clock=clock).url, clock)
    converter = labjack_t7_twin.serve(world, {"adc": (1, settings)})
    clock.attach(converter)
    volts = labjack_t7.connect(converter.addresses["adc"], links, settings, "adc").acquire(0.5).volts
    if talking:
        assert heard(level, 0.01).count("\r\n") >= 10
        level.close()
    links.close()
    converter.close()
    return volts.tobytes()


def test_a_level_that_talks_beside_a_stream_does_not_disturb_it(serve: Callable[..., LevelServer]) -> None:
    alone, beside = SimulatedClock(), SimulatedClock()
    assert samples_beside(serve, alone, False) == samples_beside(serve, beside, True)


@pytest.fixture
def port(serve: Callable[..., LevelServer]) -> Iterator[serial.Serial]:
    """What any terminal program opens, on a level that is served in real time."""
    server, ended = serve(World(WorldConfig.adxl203(), seed=1)), threading.Event()
    thread = threading.Thread(target=serve_forever, args=([server], ended.is_set))
    thread.start()
    with serial.Serial(Url.parse(server.url).path, 9600, timeout=2.0) as opened:
        yield opened
    ended.set()
    thread.join()


def test_pyserial_sees_what_the_manual_shows(port: serial.Serial) -> None:
    port.read_until(b"\n")  # joined anywhere
    lines = [port.read_until(b"\n") for _ in range(3)]
    assert all(re.fullmatch(rb"[XY]=[+-]00\.\d{3}\r\n", line) for line in lines)
    assert {line[:1] for line in lines[:2]} == {b"X", b"Y"}
    port.write(b"s")
    assert port.read_until(b"s").endswith(b"s")
    port.write(b"V")
    assert port.read_until(b"\n") + port.read_until(b"\n") == b"DPL2 V1.8.0\r\nSN:123456789\r\n"
    port.write(b"R")
    assert PAIR.fullmatch((port.read_until(b"\n") + port.read_until(b"\n")).decode())
    port.write(b"S")
    assert port.read_until(b"Y=").startswith(b"X=")
