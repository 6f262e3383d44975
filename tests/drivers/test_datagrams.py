"""Wires of datagrams: a simulated sensor that sends lines by UDP, and one that first waits for somebody."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import closing

import numpy as np
import pytest

from drivers.clock import SimulatedClock, WallClock
from drivers.errors import LinkRefused, LinkTimeout
from drivers.imu_lines import driver as imu_lines
from drivers.transport import Links
from drivers.transport.faults import Fault
from drivers.transport.server import Connection, Port, Server
from tests.drivers.digital import DigitalSensors

SETTINGS = imu_lines.Settings({"time": 1, "ax": 2, "ay": 3, "az": 4}, rate_hz=500.0)
Start = Callable[..., imu_lines.LineSensor]


def free_port() -> int:
    """A port for datagrams that nobody uses."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as own:
        own.bind(("127.0.0.1", 0))
        return int(own.getsockname()[1])


@pytest.fixture
def sensor(digital: DigitalSensors) -> Start:
    def start(*faults: Fault) -> imu_lines.LineSensor:
        listen = f"udpout://127.0.0.1:{free_port()}"
        line: imu_lines.LineSensor = digital.connect("imu_lines", SETTINGS, *faults, listen=listen)
        return line

    return start


def test_lines_in_datagrams_are_read_without_a_loss(sensor: Start) -> None:
    adc = sensor()
    for _ in range(3):
        samples = adc.acquire(4.0)
        assert len(samples.volts) == 2000
        assert np.diff(samples.volts[:, 0]) == pytest.approx(1e-3 / 500, abs=1.1e-6)
        adc._clock.sleep(120.0)  # longer than the system keeps datagrams: the old ones are dropped
    assert adc.tally()["samples-lost"] == (0.0, "")
    assert adc.self_test()[0].ok


def test_lost_and_doubled_datagrams_are_counted(sensor: Start) -> None:
    adc = sensor(Fault("lost-line", probability=0.003, seed=5), Fault("merged", probability=0.01))
    samples = adc.acquire(8.0)
    counts = {name: value for name, (value, _) in adc.tally().items()}
    steps = np.rint(np.diff(samples.volts[:, 0]) / 1e-3 * 500)
    assert counts["samples-lost"] == pytest.approx(steps.sum() - len(steps), abs=1)
    assert counts["samples-lost"] > 3
    assert counts["samples-doubled"] > 10


def test_silence_on_a_udp_port_is_a_timeout(sensor: Start) -> None:
    adc = sensor(Fault("silence"))
    with pytest.raises(LinkTimeout, match="received no line on udpin://"):
        adc.acquire(1.0)


@pytest.fixture
def echo() -> Iterator[tuple[Server, Links]]:
    """A server that returns each datagram, and links to it."""

    def answer(connection: Connection, now_s: float) -> None:
        connection.send(bytes(connection.inbox), now_s + 0.01)
        connection.inbox.clear()

    clock, server = SimulatedClock(), Server([Port("udpin://127.0.0.1:0", answer)], {}, {})
    clock.attach(server)
    links = Links(clock)
    yield server, links
    links.close()
    server.close()


def test_the_last_who_sends_gets_the_answers(echo: tuple[Server, Links]) -> None:
    server, links = echo
    first, second = links.link(server.url, "first"), links.link(server.url, "second")
    for k, (link, text) in enumerate(((first, b"one"), (first, b"two"), (second, b"three")), 1):
        link.write(text)
        assert link.read(1.0) == text
        assert links.clock.now() == pytest.approx(0.01 * k)
    assert first.read(0.1) == b""


def test_an_address_where_nobody_listens_is_an_error() -> None:
    link = Links(WallClock()).link(f"udpout://127.0.0.1:{free_port()}", "adc")
    link.write(b"x")
    with pytest.raises(LinkRefused, match="the connection is lost"):
        link.read(5.0)
    link.close()


def test_a_port_that_another_program_has_is_refused() -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as own:
        own.bind(("127.0.0.1", 0))
        with pytest.raises(LinkRefused, match="cannot be opened"):
            Links(SimulatedClock()).link(f"udpin://127.0.0.1:{own.getsockname()[1]}", "adc")
