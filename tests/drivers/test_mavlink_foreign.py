"""pymavlink, the usual client of flight controllers, on the simulated one. In real time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest
from pymavlink import mavutil

from drivers.clock import serve_forever
from drivers.mavlink_imu import driver as mavlink_imu
from drivers.mavlink_imu import twin
from drivers.transport.address import Url
from drivers.transport.server import Server
from tests.drivers.digital import Ramp
from tests.drivers.test_datagrams import free_port

UNSUPPORTED, DENIED = 3, 2
Serve = Callable[..., Any]


@pytest.fixture
def serve(monkeypatch: pytest.MonkeyPatch) -> Iterator[Serve]:
    """Serve a flight controller in real time until the test ends, and connect pymavlink to it."""
    monkeypatch.setenv("MAVLINK20", "1")
    ended, threads, closing = threading.Event(), [], []

    def start(listen: str, **keys: Any) -> Any:
        server: Server = twin.serve(Ramp(), {"adc": (1, mavlink_imu.Settings(**keys))}, listen)
        threads.append(threading.Thread(target=serve_forever, args=([server], ended.is_set)))
        threads[-1].start()
        url = Url.parse(server.addresses["adc"].url)
        client = mavutil.mavlink_connection(f"{url.scheme}:{url.host}:{url.port}", source_system=255)
        closing.extend([client, server])
        return client

    yield start
    ended.set()
    for thread in threads:
        thread.join()
    for one in closing:
        one.close()


def request(client: Any, number: int, interval_us: float) -> int:
    """Request a message; the result in the acknowledgement."""
    client.mav.command_long_send(1, 1, 511, 0, number, interval_us, 0, 0, 0, 0, 0)
    answer = client.recv_match(type="COMMAND_ACK", blocking=True, timeout=5)
    assert answer is not None
    assert answer.command == 511
    return int(answer.result)


@pytest.mark.slow
@pytest.mark.sockets
@pytest.mark.parametrize("link", ["tcp", "udpin", "udpout"])
def test_pymavlink_meets_the_autopilot_and_gets_the_rate_that_it_requests(serve: Serve, link: str) -> None:
    listen = {"tcp": "tcp://127.0.0.1:0", "udpin": "udpin://127.0.0.1:0"}.get(link, f"udpout://127.0.0.1:{free_port()}")
    client = serve(listen)
    if link == "udpin":  # the autopilot sends to who has sent to it
        client.mav.heartbeat_send(6, 8, 0, 0, 3)
    beat = client.wait_heartbeat(timeout=5)
    assert (beat.autopilot, beat.type, client.target_system) == (12, 2, 1)
    assert request(client, 105, 5000) == 0
    samples = [client.recv_match(type="HIGHRES_IMU", blocking=True, timeout=5) for _ in range(100)]
    assert all(sample is not None for sample in samples)
    times = [sample.time_usec for sample in samples]
    assert {after - before for before, after in pairwise(times)} == {5000}
    last = samples[-1]
    assert last.zacc == pytest.approx(9.80665, abs=0.2)
    assert last.ygyro == pytest.approx(-0.698, abs=1e-3)
    assert last.xmag == pytest.approx(0.2, abs=1e-3)
    assert last.temperature == pytest.approx(24.5)
    assert last.fields_updated & 0x1FF == 0x1FF
    assert client.mav_loss == 0
    assert client.mav.total_receive_errors == 0


@pytest.mark.sockets
def test_pymavlink_is_refused_what_the_autopilot_does_not_send(serve: Serve) -> None:
    client = serve("tcp://127.0.0.1:0", message="SCALED_IMU", outputs=("ax", "gz"))
    client.wait_heartbeat(timeout=5)
    assert request(client, 105, 5000) == UNSUPPORTED
    assert request(client, 26, 10) == DENIED
    assert request(client, 26, 20_000) == 0
    sample = client.recv_match(type="SCALED_IMU", blocking=True, timeout=5)
    assert (sample.xacc, sample.yacc, sample.temperature) == (pytest.approx(101, abs=3), 0, 2450)
    assert sample.zgyro == pytest.approx(262, abs=2)
