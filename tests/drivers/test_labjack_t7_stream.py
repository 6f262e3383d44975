"""The continuous stream: one record of the device, however it is cut; nothing lost in silence, no waiting for ever."""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.clock import SimulatedClock
from drivers.errors import LimitError, LinkTimeout, StreamError
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7 import registers as t7
from drivers.labjack_t7 import stream as labjack_t7_reception
from drivers.labjack_t7.stream import Packets, Reception
from drivers.transport.link import Link, open_link
from drivers.transport.server import Port, Server, Twin
from drivers.world.config import WorldConfig
from drivers.world.world import World
from tests.drivers.digital import connected

FOUR = labjack_t7.Settings(channels={"vx": 0, "vy": 1, "supply": 2, "thermistor": 3})


@pytest.fixture
def converter() -> Iterator[Callable[..., tuple[World, labjack_t7.T7]]]:
    """Makes a converter in front of a whole simulated rig, always of the same seed."""
    with ExitStack() as opened:

        def make(settings: labjack_t7.Settings = FOUR) -> tuple[World, labjack_t7.T7]:
            world = World(WorldConfig.adxl203(), seed=4)
            return world, opened.enter_context(connected("labjack_t7", world, settings, "adc"))[0]

        yield make


@pytest.mark.parametrize("block_s", [0.1, 1.7, 60.0])
def test_samples_and_times_do_not_depend_on_the_blocks(converter: Any, block_s: float) -> None:
    (whole,) = converter()[1].stream(90.0, 90.0)
    blocks = list(converter()[1].stream(90.0, block_s))
    assert np.array_equal(np.concatenate([b.volts for b in blocks]), whole.volts)
    scans = np.cumsum([0, *[len(b.volts) for b in blocks]])
    assert scans[-1] == 90_000
    assert {len(b.volts) for b in blocks[:-1]} <= {round(1000 * block_s)}
    assert [b.start_s for b in blocks] == [whole.start_s + scan / whole.rate_hz for scan in scans[:-1]]


def test_a_record_is_a_stream_of_one_block(converter: Any) -> None:
    (block,) = converter()[1].stream(2.0, 60.0)
    record = converter()[1].acquire(2.0)
    assert np.array_equal(block.volts, record.volts)
    assert block.start_s == record.start_s


def test_a_stream_that_is_closed_early_is_stopped(bench: Any) -> None:
    with closing(bench.adc.stream(3600.0, 1.0)) as blocks:
        next(blocks)
    assert bench.clock.now() < 2.0
    supply_v = bench.adc._unit.read(t7.ain(bench.adc.settings.channels["supply"]))
    assert supply_v == pytest.approx(5.0, abs=1e-3)  # refused while a stream runs
    assert bench.adc.acquire(0.5).volts.shape == (500, 3)


def test_what_is_done_between_blocks_makes_no_gap(bench: Any) -> None:
    """A minute passes, and other instruments are asked: it waits in the network's buffers and in the twin's."""
    blocks = []
    for block in bench.adc.stream(200.0, 20.0):
        bench.clock.sleep(30.0)
        bench.oven.temperature_c()
        blocks.append(block)
    volts = np.concatenate([block.volts for block in blocks])
    np.testing.assert_allclose(volts[:, 0], 0.01 * (blocks[0].start_s + 1e-3 * np.arange(200_000)), atol=3.2e-4)


@pytest.mark.parametrize(("duration_s", "late_s"), [(5.0, 0.0), (60.0, 0.0), (4.999, 0.002), (0.001, 0.0)])
def test_a_dwell_ends_with_its_last_scan(bench: Any, duration_s: float, late_s: float) -> None:
    """As far as its length has divisors; the exchanges that start and stop the stream take 5 ms."""
    began = bench.clock.now()
    bench.adc.acquire(duration_s)
    assert bench.clock.now() - began < duration_s + late_s + 0.005


def test_transaction_numbers_turn_over_within_a_long_stream(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(t7, "MOST_SAMPLES_PER_PACKET", 3)  # one scan a packet: over 65536 in 66 s
    scans = [len(block.volts) for block in bench.adc.stream(70.0, 30.0)]
    assert scans == [30_000, 30_000, 10_000]


class Device(Twin):
    """Sends `data`, once, a second from now on."""

    def __init__(self, data: bytes) -> None:
        self.port, self._data = Port("tcp://127.0.0.1:0"), data

    def advance(self, now_s: float) -> None:
        for connection in self.port.connections.values():
            connection.send(self._data, 1.0)
            self._data = b""

    def due_s(self) -> float:
        return 1.0 if self._data else float("inf")


@pytest.fixture
def device() -> Iterator[Callable[[bytes], Link]]:
    """A link to a device that sends these bytes."""
    opened: list[Any] = []

    def start(data: bytes) -> Link:
        clock, twin = SimulatedClock(), Device(data)
        server = Server([twin.port], {"device": twin}, {})
        clock.attach(server)
        opened.extend([open_link(server.url, clock), server])
        return opened[-2]

    yield start
    for one in opened:
        one.close()


def packet(number: int, status: int = 0) -> bytes:
    """Two scans of two channels: 0, 1 and 2, 3."""
    header = struct.pack(">HHHBBBBHHH", number % 65536, 0, 18, 1, 76, 16, 0, 0, status, 5)
    return header + struct.pack(">4H", 0, 1, 2, 3)


def reception(link: Link) -> Reception:
    return Reception(link, "adc", start_s=0.0, rate_hz=2.0, channels=2, per_packet=2)


def test_scans_are_cut_out_of_packets(device: Callable[[bytes], Link]) -> None:
    stream = reception(device(packet(0) + packet(1)))
    assert stream.take(1).tolist() == [[0, 1]]
    assert stream.take(3).tolist() == [[2, 3], [0, 1], [2, 3]]


def test_a_packet_missing_between_two_blocks_is_noticed(device: Callable[[bytes], Link]) -> None:
    stream = reception(device(packet(0) + packet(2)))
    stream.take(2)
    with pytest.raises(StreamError, match="adc: packets are missing after packet 0"):
        stream.take(2)


def test_scans_skipped_in_a_later_block_are_noticed(device: Callable[[bytes], Link]) -> None:
    stream = reception(device(packet(0) + packet(1, status=2941)))
    stream.take(2)
    with pytest.raises(StreamError, match=r"adc: its buffer ran over and it skipped 5 scans \(status 2941 in packet 1"):
        stream.take(1)


def test_a_device_that_falls_silent_is_given_up_a_second_after_its_bytes_were_due(
    device: Callable[[bytes], Link],
) -> None:
    link = device(packet(0) + packet(1)[:7])
    stream = reception(link)
    stream.take(2)
    with pytest.raises(LinkTimeout, match="stopped after 31 of 48 bytes"):
        stream.take(2)
    assert link.clock.now() == pytest.approx(2.0 + labjack_t7_reception.PATIENCE_S, abs=1e-3)


@settings(derandomize=True, deadline=None)
@given(st.lists(st.integers(0, 60), max_size=12), st.integers(0, 8))
def test_packets_may_be_fed_in_any_pieces(cuts: list[int], count: int) -> None:
    data, packets = b"".join(packet(65534 + k) for k in range(count)), Packets(4, "adc", 65534)
    edges = [0, *sorted(min(cut * 4, len(data)) for cut in cuts), len(data)]
    codes = [packets.codes(data[a:b]) for a, b in pairwise(edges)]
    assert np.concatenate(codes).tolist() == [0, 1, 2, 3] * count


ASKED = dataclasses.replace(FOUR, on_request={"gx": 7, "gz": 9})


def test_what_is_on_request_is_sampled_for_who_asks_for_it_alone(converter: Any) -> None:
    adc = converter(ASKED)[1]
    assert adc.acquire(0.1).channels == ("vx", "vy", "supply", "thermistor")
    asked = adc.only("gz", "vx").acquire(0.1)
    assert asked.channels == ("vx", "gz")
    assert asked.volts[:, 1].mean() == pytest.approx(2.5, abs=0.01)
    assert adc.acquire(0.1).channels == ("vx", "vy", "supply", "thermistor")


def test_of_a_batch_the_outputs_of_every_sensor_are_meant() -> None:
    batch = dataclasses.replace(FOUR, channels={"a1.vx": 0, "a2.vx": 1}, on_request={"a1.mx": 2, "a2.mx": 3, "mxy": 4})
    assert batch.only("adc", ("mx",)).channels == {"a1.mx": 2, "a2.mx": 3}
    with pytest.raises(LimitError, match=r"adc: no input is wired to my, mz; there are a1.vx, .*\. Name the inputs"):
        batch.only("adc", ("mx", "my", "mz"))


def test_a_record_can_be_watched_and_is_the_same(converter: Any) -> None:
    whole, seen = converter()[1].acquire(2.0), []
    watched = converter()[1].acquire_watched(2.0, lambda: seen.append(1), 0.3)
    assert np.array_equal(watched.volts, whole.volts)
    assert len(seen) == 7


def test_what_a_watch_finds_ends_the_record_and_the_stream(converter: Any) -> None:
    adc = converter()[1]

    def look() -> None:
        raise LimitError("seen", "Look")

    with pytest.raises(LimitError):
        adc.acquire_watched(60.0, look, 1.0)
    assert len(adc.acquire(0.5).volts) == 500
