"""Simulated time: it moves only while the controller waits, in the order of what is due, without real waiting."""

from __future__ import annotations

import socket
import threading
import time

import pytest

from drivers import clock as clock_module
from drivers.clock import SimulatedClock, WallClock, serve_forever
from drivers.errors import ClockStuck
from drivers.transport.link import Link, open_link
from drivers.transport.server import Connection, Port, Server, Twin

LISTEN = "tcp://127.0.0.1:0"


class Ticker(Twin):
    """A twin that says the time every second until it has done so `count` times."""

    def __init__(self, port: Port, count: int) -> None:
        self._port, self._left, self._said = port, count, 0

    def advance(self, now_s: float) -> None:
        while self._left and self._said + 1 <= now_s:
            self._said, self._left = self._said + 1, self._left - 1
            for connection in self._port.connections.values():
                connection.send(b"%d;" % self._said, self._said)

    def due_s(self) -> float:
        return self._said + 1.0 if self._left else float("inf")


def ticking(clock: SimulatedClock, count: int = 5) -> Link:
    port = Port(LISTEN)
    clock.attach(Server([port], {"ticker": Ticker(port, count)}, {}))
    return open_link(port.url, clock)


def echoing(clock: SimulatedClock, delay_s: float) -> Link:
    def answer(connection: Connection, now_s: float) -> None:
        connection.send(bytes(connection.inbox), now_s + delay_s)
        connection.inbox.clear()

    port = Port(LISTEN, answer)
    clock.attach(Server([port], {}, {}))
    return open_link(port.url, clock)


def test_twelve_hours_of_sleep_take_no_time() -> None:
    clock, started = SimulatedClock(), time.monotonic()
    clock.sleep(12 * 3600)
    assert clock.now() == 12 * 3600
    assert time.monotonic() - started < 1


def test_a_negative_sleep_does_not_move_the_clock() -> None:
    clock = SimulatedClock(5.0)
    clock.sleep(-1.0)
    assert clock.now() == 5.0


def test_a_restored_clock_goes_on_where_it_stood() -> None:
    clock = SimulatedClock()
    clock.restore(1e6 + 1 / 3)
    clock.sleep(1)
    assert clock.now() == 1e6 + 1 / 3 + 1


def test_an_answer_comes_when_it_is_due() -> None:
    clock = SimulatedClock()
    link = echoing(clock, 0.25)
    link.write(b"hello")
    assert link.read(1.0) == b"hello"
    assert clock.now() == 0.25


def test_a_time_out_elapses_on_the_simulated_clock_only() -> None:
    clock = SimulatedClock()
    link, started = echoing(clock, 3600.0), time.monotonic()
    link.write(b"hello")
    assert link.read(600.0) == b""
    assert clock.now() == 600.0
    assert time.monotonic() - started < 1
    assert link.read(7200.0) == b"hello"
    assert clock.now() == 3600.0


def test_a_read_without_waiting_moves_no_time() -> None:
    clock = SimulatedClock()
    link = echoing(clock, 0.25)
    link.write(b"hello")
    assert link.read(0.0) == b""
    assert clock.now() == 0.0


def test_what_comes_unasked_comes_in_order_at_its_time() -> None:
    clock = SimulatedClock()
    link = ticking(clock)
    heard = [(link.read(10.0), clock.now()) for _ in range(3)]
    assert heard == [(b"1;", 1.0), (b"2;", 2.0), (b"3;", 3.0)]


def test_sleep_lets_all_that_is_due_be_sent() -> None:
    clock = SimulatedClock()
    link = ticking(clock)
    clock.sleep(4.5)
    assert (link.read(0.0), clock.now()) == (b"1;2;3;4;", 4.5)


def test_a_wait_for_one_wire_keeps_the_others_going() -> None:
    clock = SimulatedClock()
    ticks, echo = ticking(clock), echoing(clock, 2.5)
    echo.write(b"x")
    assert (echo.read(10.0), clock.now()) == (b"x", 2.5)
    assert (ticks.read(0.0), clock.now()) == (b"1;2;", 2.5)


def test_a_line_that_never_falls_silent_is_given_up() -> None:
    clock = SimulatedClock()
    link = ticking(clock)
    assert link.discard(quiet_s=10.0) > 0
    assert clock.now() <= 2.0


def test_a_server_holds_what_the_kernel_does_not_take() -> None:
    clock = SimulatedClock()
    block = bytes(range(256)) * (1 << 16)  # 16 MB, far more than a socket buffer

    def answer(connection: Connection, now_s: float) -> None:
        connection.inbox.clear()
        connection.send(block, now_s)

    port = Port(LISTEN, answer)
    clock.attach(Server([port], {}, {}))
    link = open_link(port.url, clock)
    link.write(b"?")
    clock.sleep(1.0)
    received = b""
    while len(received) < len(block):
        received += link.read(1.0)
    assert received == block
    assert clock.now() == 1.0


@pytest.mark.parametrize("room", [4096, 20_000])
def test_a_kernel_with_little_room_gives_a_short_answer_in_parts(monkeypatch: pytest.MonkeyPatch, room: int) -> None:
    def connect(address: tuple[str, int], timeout_s: float) -> socket.socket:
        client = socket.socket()
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
        client.settimeout(timeout_s)
        client.connect(address)
        return client

    monkeypatch.setattr(clock_module, "FULL_S", 0.01)
    monkeypatch.setattr(socket, "create_connection", connect)
    clock = SimulatedClock()
    block = bytes(range(256)) * 120  # less than one read takes, more than the kernel holds

    def answer(connection: Connection, now_s: float) -> None:
        connection.inbox.clear()
        connection.send(block, now_s)

    port = Port(LISTEN, answer)
    clock.attach(Server([port], {}, {}))
    link = open_link(port.url, clock)
    link.write(b"?")
    received = b""
    while len(received) < len(block):
        received += link.read(1.0)
    assert received == block
    assert clock.now() == 0.0


def test_bytes_that_nobody_takes_are_an_error_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock_module, "STUCK_S", 0.0)
    clock = SimulatedClock()
    port = Port(LISTEN)  # listening, but not attached to the clock
    link = open_link(port.url, clock)
    link.write(b"hello")
    with pytest.raises(ClockStuck, match="Attach it"):
        link.read(1.0)


def test_the_same_calls_give_the_same_instants() -> None:
    def history() -> list[tuple[bytes, float]]:
        clock = SimulatedClock()
        ticks, echo = ticking(clock, 50), echoing(clock, 0.7)
        heard = []
        for k in range(20):
            echo.write(b"%d" % k)
            heard.append((echo.read(1.0), clock.now()))
            heard.append((ticks.read(0.1), clock.now()))
        return heard

    assert history() == history()


def test_the_same_server_serves_in_real_time() -> None:
    ended = threading.Event()
    port = Port(LISTEN, lambda connection, now_s: connection.send(b"yes", now_s))
    server = Server([port], {}, {})
    thread = threading.Thread(target=serve_forever, args=([server], ended.is_set))
    thread.start()
    try:
        link = open_link(port.url, WallClock())
        link.write(b"there?")
        assert link.read(5.0) == b"yes"
    finally:
        ended.set()
        thread.join()
        server.close()


def test_wall_time_starts_where_it_is_told() -> None:
    clock = WallClock(100.0)
    before = clock.now()
    clock.sleep(0.0)
    assert 100.0 <= before <= clock.now() < 101.0
