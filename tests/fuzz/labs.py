"""Decoders of a laboratory's instruments: lines of a digital sensor, SCPI answers, EPICS Channel Access."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from drivers.errors import DriverError
from drivers.imu_lines import lines as imu
from drivers.mavlink_imu import driver as mavlink
from drivers.mavlink_imu import messages as mav
from drivers.scpi_meter.driver import Meter, Settings
from drivers.transport.channel_access import Circuit
from drivers.transport.channel_access_server import Field, Session
from drivers.xsens_mti import driver as xsens
from drivers.xsens_mti import messages as xbus
from tests.fuzz.target import Target

__all__ = ["LABS"]

TIMEOUT_S = 1.0


class Clock:
    """Time is what was waited."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def now(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += max(seconds, 0.0)


def line_samples(style: str, columns: dict[str, int | str]) -> Callable[[bytes], object]:
    """Lines of one style, in two pieces."""

    def take(data: bytes) -> object:
        assembly, half = imu.Assembly(style, columns), len(data) // 2
        samples = [*assembly.take(data[:half]), *assembly.take(data[half:])]
        assert all(math.isfinite(value) for sample in samples for value in sample.values())
        return assembly.damaged

    return take


def framed_samples(make: Callable[[], Any]) -> Callable[[bytes], object]:
    """Samples of a decoder of frames, in two pieces."""

    def take(data: bytes) -> object:
        decoder, half = make(), len(data) // 2
        batches = [decoder.take(data[:half]), decoder.take(data[half:])]
        assert all(len(batch.values) == len(batch.missing) for batch in batches)
        assert len(decoder.stream.remainder) < 4096
        return decoder.damaged

    return take


class Answers:
    """A wire of text: each question gets the next line."""

    def __init__(self, data: bytes) -> None:
        self.clock, self._lines = Clock(), data.decode("latin-1").encode("ascii", "replace").decode().split("\n")

    def write(self, command: str) -> None:
        """Nobody hears it."""

    def query(self, command: str, timeout_s: float) -> str:
        if not self._lines:
            self.clock.sleep(timeout_s)
            return "0"
        return self._lines.pop(0).strip()


def scpi_answers(timer: bool) -> Callable[[bytes], object]:
    """A whole record of two scans, by what the instrument says."""

    def take(data: bytes) -> object:
        heard: Any = Answers(data)
        meter = Meter(heard, heard, Settings(timer=timer, timeout_s=0.1), "adc")
        with suppress(DriverError):
            meter.identify()
        return [block.volts.shape for block in meter.stream(0.4, 0.4)]

    return take


class Host:
    """Records of a twin, with one name."""

    def has(self, name: str) -> bool:
        return name == "a:VAL"

    def field(self, name: str, now_s: float) -> Field:
        return Field(2.5, now_s, 1, 3, "V")

    def put(self, name: str, value: float, now_s: float) -> None:
        assert name == "a:VAL"


class Server:
    """A link to a simulated server; `said` has each of its answers."""

    url = "tcp://h:1"

    def __init__(self, answers: Callable[[bytes], bytes]) -> None:
        self.clock, self.said, self.heard, self._answers, self._waiting = Clock(), [], [], answers, b""

    def write(self, data: bytes) -> None:
        self.heard.append(data)
        self.said.append(self._answers(data))
        self._waiting += self.said[-1]

    def read(self, timeout_s: float) -> bytes:
        data, self._waiting = self._waiting, b""
        if not data:
            self.clock.sleep(timeout_s)
        return data

    def hang_up(self) -> None:
        """There is nobody."""


def talk(link: Any) -> object:
    """Open a record, read it and its units, write it."""
    circuit = Circuit(link, ("h", 1))
    readings = circuit.read(["a:VAL"], "adc", TIMEOUT_S)
    assert all(reading.alarm is not None for reading in readings)
    circuit.write("a:VAL", 1.0, "adc", TIMEOUT_S)
    return circuit.units("a:VAL", "adc", TIMEOUT_S)


def record_server() -> Server:
    session = Session([Host()])
    return Server(lambda data: session.answers(data, 0.0))


def ca_answer(data: bytes) -> object:
    """What a server says, cut into as many pieces as it was asked; each comes after its question."""
    lengths = [len(piece) for piece in SAID]
    pieces = [data[sum(lengths[:k]) : sum(lengths[: k + 1])] for k in range(len(lengths))]
    return talk(Server(lambda _: pieces.pop(0) if pieces else b""))


def ca_request(data: bytes) -> object:
    return Session([Host()]).answers(data, 0.0)


REAL = record_server()
talk(REAL)
SAID, HEARD = REAL.said, REAL.heard
TEXTS = {
    "csv": (b"# imu\n1,0.0123,-0.004,1.002\n2,0.0124,-0.004,1.001\n3;0.1;0.2;1e0\n", {"ax": 2, "ay": 3, "az": 4}),
    "named": (b"\nax:0.0123 ay:-0.004 az:1.002\nax=1 ay=2 az=.5\n", {"ax": "ax", "ay": "ay", "az": "az"}),
    "teleplot": (b"\n>ax:1627551892437:0.0123\n>ay:-0.004\xc2\xa7g\n>az:1.002|np\n", {"ax": "ax", "ay": "ay"}),
    "nmea": (b"\n$PIMU,0.0123,-0.004,1.002*2A\n$PIMU,0.0123,-0.004,1.002*2B\n", {"ax": 1, "ay": 2, "az": 3}),
}
MAVLINK = b"".join(
    mav.frames(message, mav.fields(message, time=7, temperature=20), np.array([k]), 1, 1, version)[0]
    for k, (message, version) in enumerate([(mav.HIGHRES_IMU, mav.V2), (mav.IMU["SCALED_IMU"], mav.V1)])
)
XBUS = b"".join(
    xbus.data_messages([(xbus.COUNTER, np.arange(2, dtype=">u2")), (xbus.ACCELERATION, np.ones((2, 3), dtype=">f4"))])
)
SCPI = b'Keysight,34461A,MY1,A.02\nKeysight,34461A,MY1,A.02\n0,"No error"\n0\n4\n+1.5E+00,2.5,1.5,2.5\n0,"No error"\n'
OVERLOAD = b'a,b\na,b\n0\n0\n4\n+9.9E37,1,2,3\n-230,"Data stale"\n0\n'
READ = b'Keysight,34461A,MY1,A.02\nKeysight,34461A,MY1,A.02\n0,"No error"\n1.5,2.5\n1.5,2.5\n0,"No error"\n'
SAID_SO = (DriverError,)
LABS: dict[str, Target] = {
    **{
        f"imu-lines-{style}": Target(line_samples(style, dict(columns)), (), [text], 60)
        for style, (text, columns) in TEXTS.items()
    },
    "mavlink": Target(framed_samples(lambda: mavlink.SampleDecoder(mavlink.Settings(), (1, 1))), (), [MAVLINK], 40),
    "xbus": Target(framed_samples(lambda: xsens.SampleDecoder(xsens.Settings())), (), [XBUS], 40),
    "scpi-timer": Target(scpi_answers(timer=True), SAID_SO, [SCPI, OVERLOAD], 40),
    "scpi-read": Target(scpi_answers(timer=False), SAID_SO, [READ], 40),
    "channel-access-answer": Target(ca_answer, SAID_SO, [b"".join(SAID)], 20),
    "channel-access-request": Target(ca_request, (ValueError,), [b"".join(HEARD)], 20),
}
