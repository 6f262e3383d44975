"""The T7 driver's requests, and a record out of packets that are written out byte by byte."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from drivers.clock import SimulatedClock
from drivers.errors import LimitError, LinkTimeout, OverRange, Refused, StreamError
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7.driver import T7, Settings
from drivers.transport import Address, Links
from drivers.transport.server import Port, Server, Twin

TCP = "tcp://127.0.0.1:0"
SLOPE = 0.00031580578  # nominal, as FLOAT32 39 A5 92 BC
CALIBRATION = "39 A5 92 BC B9 A5 92 BC 47 02 F3 00 C1 29 64 2D" + " 00" * 148
CONNECT = [
    ("00 01 00 00 00 0B 01 10 13 7E 00 02 04 00 00 00 00", "00 01 00 00 00 03 01 90 04"),  # no stream to stop
    ("00 02 00 00 00 0B 01 10 9C 46 00 02 04 41 20 00 00", "00 02 00 00 00 06 01 10 9C 46 00 02"),  # AIN3: 10 V
    ("00 03 00 00 00 06 01 06 A0 2B 00 C7", "00 03 00 00 00 06 01 06 A0 2B 00 C7"),  # AIN3: single-ended
    ("00 04 00 00 00 0B 01 10 F1 72 00 02 04 00 3C 40 00", "00 04 00 00 00 06 01 10 F1 72 00 02"),  # flash
    ("00 05 00 00 00 06 01 03 F1 74 00 52", "00 05 00 00 00 A7 01 03 A4 " + CALIBRATION),
]
STREAM = (
    "00 06 00 00 00 2F 01 10 0F A2 00 14 28 "
    "44 7A 00 00 00 00 00 01 00 00 00 04 00 00 00 00 00 00 00 00 "  # 1000 Hz, 1 channel, 4 in a packet
    "00 00 80 00 00 00 00 00 00 00 00 01 00 00 00 00 00 00 00 00"  # 32768 bytes, to the stream port, endless
)
CONFIGURE = [
    (STREAM, "00 06 00 00 00 06 01 10 0F A2 00 14"),
    ("00 07 00 00 00 0B 01 10 10 04 00 02 04 00 00 00 06", "00 07 00 00 00 06 01 10 10 04 00 02"),  # AIN3 is 6
]
ENABLE = ("00 08 00 00 00 0B 01 10 13 7E 00 02 04 00 00 00 01", "00 08 00 00 00 06 01 10 13 7E 00 02")
RATE = ("00 09 00 00 00 06 01 03 11 8E 00 02", "00 09 00 00 00 07 01 03 04 44 7A 00 00")
DISABLE = ("00 0A 00 00 00 0B 01 10 13 7E 00 02 04 00 00 00 00", "00 0A 00 00 00 06 01 10 13 7E 00 02")
ACQUIRE = [*CONFIGURE, ENABLE, RATE, DISABLE]
HEADER = "00 00 00 00 00 12 01 4C 10 00 00 00 00 00 00 00 "
PACKET = HEADER + "82 F3 FF FE 00 01 92 93"
Converters = Callable[..., T7]


class Burst(Twin):
    """Sends `data` on its port at `at_s`."""

    def __init__(self, port: Port, data: bytes, at_s: float) -> None:
        self._port, self._data, self._at_s = port, data, at_s

    def advance(self, now_s: float) -> None:
        if now_s >= self._at_s:
            for connection in self._port.connections.values():
                connection.send(self._data, now_s)
            self._at_s = float("inf")

    def due_s(self) -> float:
        return self._at_s


@pytest.fixture
def converter(script: Callable[..., Address], links: Links, clock: SimulatedClock) -> Iterator[Converters]:
    """A T7 with one channel on AIN3; `packets` come 0.1 s after the start."""
    port = Port(TCP)

    def connect(exchanges: list[tuple[str, str]], packets: str = "") -> T7:
        modbus = script([*CONNECT, *exchanges], TCP)
        clock.attach(Server([port], {"burst": Burst(port, bytes.fromhex(packets), 0.1)}, {}))
        address = Address(modbus.url, 1, port.url)
        return labjack_t7.connect(address, links, Settings(channels={"vx": 3}), "adc")

    yield connect
    port.close()


def test_a_record_is_volts_by_the_devices_own_calibration(converter: Converters) -> None:
    samples = converter(ACQUIRE, PACKET).acquire(0.004)
    expected = [0.0, (65534 - 33523) * SLOPE, (1 - 33523) * SLOPE, (0x9293 - 33523) * SLOPE]
    np.testing.assert_allclose(samples.volts, np.reshape(expected, (4, 1)), rtol=1e-6)
    assert (samples.channels, samples.rate_hz) == (("vx",), 1000.0)


def test_scans_beyond_the_duration_are_cut_off(converter: Converters) -> None:
    longer = PACKET + "00 01" + HEADER[5:] + "00 00 00 00 00 00 00 00"
    assert converter(ACQUIRE, longer).acquire(0.004).volts.shape == (4, 1)


@pytest.mark.parametrize("end", ["FF FF", "00 00"])
def test_a_sample_at_an_end_of_the_range_is_no_number(converter: Converters, end: str) -> None:
    with pytest.raises(OverRange, match=r"adc: vx \(AIN3\) was beyond its range of 10 V in 1 of 4 samples. Check"):
        converter(ACQUIRE, f"{HEADER}82 F3 {end} 00 01 92 93").acquire(0.004)


def test_lost_scans_are_an_error_and_the_stream_is_stopped(converter: Converters) -> None:
    packet = "00 00 00 00 00 12 01 4C 10 00 04 00 0B 7D 00 2A 82 F3 82 F3 82 F3 82 F3"
    with pytest.raises(StreamError, match=r"adc: its buffer ran over and it skipped 42 scans \(status 2941"):
        converter(ACQUIRE, packet).acquire(0.004)


def test_a_silent_stream_is_a_time_out_and_the_stream_is_stopped(converter: Converters, clock: SimulatedClock) -> None:
    with pytest.raises(LinkTimeout, match="adc: the stream stopped after 10 of 24 bytes"):
        converter(ACQUIRE, PACKET[:29]).acquire(0.004)
    assert clock.now() < 2.5


def test_a_refusal_is_explained_by_the_device(converter: Converters) -> None:
    refused = [
        *CONFIGURE,
        (ENABLE[0], "00 08 00 00 00 03 01 90 04"),
        ("00 09 00 00 00 06 01 03 D6 D8 00 02", "00 09 00 00 00 07 01 03 04 00 00 0A 2D"),
    ]
    with pytest.raises(Refused, match=r"writing register 0x137E .*; device error 2605: a stream is running already"):
        converter(refused).acquire(0.004)


def test_without_a_line_for_it_the_power_is_not_switched(converter: Converters) -> None:
    with pytest.raises(LimitError, match="Set power_dio"):
        converter([]).power(True)


def test_the_converter_identifies_itself(converter: Converters) -> None:
    exchanges = [
        ("00 06 00 00 00 06 01 03 EA 60 00 02", "00 06 00 00 00 07 01 03 04 40 E0 00 00"),
        ("00 07 00 00 00 06 01 03 EA 7C 00 02", "00 07 00 00 00 07 01 03 04 1C 03 A1 80"),
        ("00 08 00 00 00 06 01 03 EA 64 00 02", "00 08 00 00 00 07 01 03 04 3F 80 00 00"),
    ]
    identity = converter(exchanges).identify()
    assert (identity.model, identity.serial, identity.firmware) == ("LabJack T7", "470000000", "1.0000")
