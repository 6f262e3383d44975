"""Decoders of what comes on a wire: answers to the drivers, and requests to the simulated instruments."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from pymodbus.framer import FramerRTU
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest

from drivers.dpg2 import driver as dpg2
from drivers.errors import DriverError
from drivers.labjack_t7 import twin as t7
from drivers.labjack_t7.stream import Packets, RangeCalibration, packet_type
from drivers.pi_e727 import driver as pi_e727
from drivers.pi_e727 import parameters as e727
from drivers.pi_e727.twin import Controller
from drivers.transport.address import Url
from drivers.transport.faults import Faults
from drivers.transport.gcs import Gcs
from drivers.transport.gcs_server import commands
from drivers.transport.link import Link
from drivers.transport.modbus import Bus
from drivers.transport.modbus_server import ILLEGAL_ADDRESS, Refusal, Responder
from drivers.world.config import WorldConfig
from drivers.world.world import World
from tests.fuzz.target import Target


class Said:
    """A wire on which one answer comes, in two pieces, and then nothing; time is what was waited."""

    until = Link.until

    def __init__(self, url: str, data: bytes) -> None:
        self.url, self.clock, self._now_s = url, self, 0.0
        self._data = [data[: len(data) // 2], data[len(data) // 2 :]]

    def now(self) -> float:
        return self._now_s

    def sleep(self, seconds: float) -> None:
        self._now_s += seconds

    def discard(self, quiet_s: float = 0.0) -> int:
        return 0

    def write(self, data: bytes) -> None:
        """Nobody hears it."""

    def read(self, timeout_s: float) -> bytes:
        if self._data:
            return self._data.pop(0)
        self._now_s += timeout_s
        return b""


class Words:
    """A Modbus unit that has a few registers and bits."""

    functions = frozenset({1, 2, 3, 4, 5, 6, 16, 23})
    thinking_s = 0.0
    faults = Faults()

    def read_words(self, address: int, count: int, now_s: float) -> list[int]:
        if address + count > 256:
            raise Refusal(ILLEGAL_ADDRESS)
        return [0] * count

    def read_bits(self, address: int, count: int) -> list[bool]:
        return [False] * count

    def write_words(self, address: int, values: Sequence[int], now_s: float) -> None:
        assert all(0 <= value < 65536 for value in values)

    def write_bit(self, address: int, on: bool, now_s: float) -> None:
        assert on in (False, True)


class Client:
    """A connection to a simulated instrument."""

    def __init__(self, data: bytes) -> None:
        self.inbox = bytearray(data)

    def send(self, data: bytes, due_s: float) -> None:
        assert data
        assert math.isfinite(due_s)


def modbus_answer(url: str) -> Callable[[bytes], object]:
    def take(data: bytes) -> object:
        bus: Any = Bus(Said(url, data))
        return bus.ask(ReadHoldingRegistersRequest(address=0x80, count=2), 1, "alpha: reading", retries=0).registers

    return take


def modbus_request(url: str) -> Callable[[bytes], object]:
    responder = Responder({1: Words()}, Url.parse(url))
    return lambda data: responder.answer(Client(data), 0.0)


def sealed(take: Callable[[bytes], object]) -> Callable[[bytes], object]:
    """The same with a checksum that is right: what is behind it is reached."""
    return lambda data: take(with_crc(data))


def gcs_answer(data: bytes) -> object:
    def gcs() -> Gcs:
        return Gcs(Said("tcp://h:1", data), "positioner", e727.explain)

    for ask in (lambda: gcs().values("POS?"), lambda: gcs().number("POS? 1"), lambda: gcs().rows("DRR?")):
        with suppress(DriverError):
            ask()
    return gcs().error()


def new_world() -> World:
    return World(WorldConfig.from_mapping({"preset": "adxl203"}), 1)


@cache
def world() -> World:
    return new_world()


@cache
def controller() -> Controller:
    """Its time stands still, so its world is its own: the time of the other twins grows."""
    return Controller(new_world(), pi_e727.Settings())


def gcs_request(data: bytes) -> object:
    return [controller().answer(command, 0.0) for command in commands(bytearray(data))]


def level_answer(data: bytes) -> object:
    link: Any = Said("serial:/dev/null", data)
    return dpg2.Level(link, dpg2.Settings(readings=1), "level").read()


def packets(data: bytes) -> object:
    stream = Packets(4, "adc")
    return [stream.codes(data[:20]), stream.codes(data[20:])]


def calibration(data: bytes) -> object:
    words = struct.unpack(">82H", data[:164].ljust(164, b"\0"))
    with np.errstate(all="ignore"):
        found = RangeCalibration.from_flash(words, 10.0)
        return found.table() if found.plausible else None


def stream_seed() -> bytes:
    sent = np.zeros(3, packet_type(4))
    sent["transaction"], sent["length"] = [0, 1, 2], 10 + 8
    sent["unit"], sent["function"], sent["kind"] = 1, 76, 16
    return sent.tobytes()


RTU, TCP = "rtu+tcp://h:1", "tcp://h:1"
ANSWERS = [bytes.fromhex(frame) for frame in ("010304000000FA", "018302", "01060080000101")]
REQUESTS = [
    bytes.fromhex(frame)
    for frame in (
        "010300800002", "01100058000204000000FA", "01050814FF00", "010F0000000801FF", "01170000000100000001020001",
        "012B0E0100",
    )
]  # fmt: skip


def with_crc(frame: bytes) -> bytes:
    return frame + FramerRTU.compute_CRC(frame).to_bytes(2, "big")


def with_head(frame: bytes) -> bytes:
    return bytes.fromhex("00010000") + len(frame).to_bytes(2, "big") + frame


SEALED, HEADED = [with_crc(frame) for frame in REQUESTS], [with_head(frame) for frame in REQUESTS]
GCS_ANSWERS = [b"1=10.5 \n2=3\n", b"0\n", b"# NDATA = 2 \n# END_HEADER \n1.5 \n2.5\n"]
GCS_REQUESTS = [
    b"MOV 1 10.0\nERR?\n", b"WAV 2 X SIN_P 2000 20 10 2000 0 1000\n", b"SPA? 1 234881536\n\x05\x18",
    b"WGO 1 1\nDRR? 1 10 1\n", b"SVO 1 1 2 1\nPOS?\n", b"DRC 1 1 2\nWTR 1 2 0\nWSL 1 1\n",
]  # fmt: skip
LEVEL = [b"X=+01.234\r\nY=-00.007\r\n", b"sX=+++++++\r\nY=-00.007\r\n"]
URLS = [b"tcp://h:502", b"serial:/dev/x?baud=9600&parity=E"]
SAID = (DriverError,)
WIRES: dict[str, Target] = {
    "modbus-rtu-answer": Target(modbus_answer(RTU), SAID, [with_crc(frame) for frame in ANSWERS], 240),
    "modbus-tcp-answer": Target(modbus_answer(TCP), SAID, [with_head(frame) for frame in ANSWERS], 200),
    "modbus-rtu-request": Target(modbus_request(RTU), (), SEALED, 120),
    "modbus-tcp-request": Target(modbus_request(TCP), (), HEADED, 100),
    "modbus-sealed-answer": Target(sealed(modbus_answer(RTU)), SAID, ANSWERS, 100),
    "modbus-sealed-request": Target(sealed(modbus_request(RTU)), (), REQUESTS, 60),
    "gcs-answer": Target(gcs_answer, SAID, GCS_ANSWERS, 80),
    "gcs-request": Target(gcs_request, (), GCS_REQUESTS, 2),
    "level-answer": Target(level_answer, SAID, LEVEL, 60),
    "t7-stream": Target(packets, SAID, [stream_seed()], 60),
    "t7-calibration": Target(calibration, (), [t7.FLASH_BYTES], 2),
    "url": Target(lambda data: Url.parse(data.decode("latin-1")), SAID, URLS, 8),
}
