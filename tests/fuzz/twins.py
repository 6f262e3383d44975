"""Requests to the simulated instruments themselves, by any client: registers, SCPI lines, letters, messages."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np

from drivers.dpg2 import driver as dpg2
from drivers.dpg2.twin import Inclinometer
from drivers.labjack_t7 import driver as t7
from drivers.labjack_t7 import registers as t7_registers
from drivers.labjack_t7.twin import Converter
from drivers.mavlink_imu import driver as mavlink
from drivers.mavlink_imu import messages as mav
from drivers.mavlink_imu.twin import Autopilot
from drivers.omega_cn7500.twin import Controller as Oven
from drivers.oriental_az import driver as oriental
from drivers.oriental_az import registers as az
from drivers.oriental_az.twin import Drive
from drivers.scpi_meter import driver as scpi
from drivers.scpi_meter.twin import Scanner
from drivers.transport.address import Url
from drivers.transport.modbus_server import Responder
from drivers.xsens_mti import driver as xsens
from drivers.xsens_mti import messages as xbus
from drivers.xsens_mti.twin import MotionTracker
from tests.fuzz.target import Target
from tests.fuzz.wires import RTU, Client, with_crc, world

__all__ = ["TWINS"]

LATER_S = 0.01  # after a request, when the instrument acts on its own
PIECE = 12  # bytes of a request at a time
OUTPUTS = ("ax", "ay", "az")


class Port:
    """The line of a simulated instrument, without a socket, with one client."""

    def __init__(self) -> None:
        self.timing, self.answer = Url.parse("pty:?baud=115200"), None
        self.client = Listener()
        self.connections = {0: self.client}

    def hang_up(self) -> None:
        """The client stays."""


class Listener(Client):
    """A client that hears everything at once."""

    key = "client"

    def __init__(self) -> None:
        super().__init__(b"")

    def send(self, data: bytes, due_s: float) -> None:
        """Nothing is sent where an instrument has no answer."""
        if data:
            super().send(data, due_s)

    def emit(self, now_s: float) -> None:
        """It has been sent."""

    def is_behind(self, now_s: float) -> bool:
        return False


clock_s = itertools.count(1).__next__  # the world's time only grows


def requests(make: Callable[[], Any]) -> Callable[[bytes], object]:
    """Modbus requests to one unit, each with a checksum that is right, then the time passes."""

    def take(data: bytes) -> object:
        twin, now_s = make(), float(clock_s())
        responder = Responder({1: twin}, Url.parse(RTU))
        for first in range(0, min(len(data), 8 * PIECE), PIECE):
            responder.answer(Client(with_crc(b"\x01" + data[first : first + PIECE])), now_s)
        twin.advance(now_s + LATER_S)
        return twin.state()

    return take


def letters(make: Callable[[Port], Any]) -> Callable[[bytes], object]:
    """Bytes to an instrument that answers by itself, in two pieces."""

    def take(data: bytes) -> object:
        port, now_s = Port(), float(clock_s())
        twin: Any = make(port)
        if hasattr(twin, "speak"):
            twin.restore({"running": True, "next_s": now_s})  # else it sends all lines since power-on
        heard = twin._answer
        for piece in (data[: len(data) // 2], data[len(data) // 2 :]):
            port.client.inbox += piece
            heard(port.client, now_s)
        if hasattr(twin, "speak"):
            twin.speak(now_s + LATER_S)
        return twin.state()

    return take


@cache
def scanner_settings() -> scpi.Settings:
    return scpi.Settings(channels={"vx": 101, "vy": 102})


def scpi_lines(data: bytes) -> object:
    scanner, now_s = Scanner(world(), scanner_settings()), float(clock_s())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        answers = [scanner.answer(line, now_s) for line in data.decode("latin-1").split("\n")]
        scanner.advance(now_s + LATER_S)
    return [answer.encode("ascii") for answer in answers if answer is not None]


def written(address: int, *values: int) -> bytes:
    """A request to write words, without unit and checksum, as long as a piece."""
    words = b"".join(value.to_bytes(2, "big") for value in values)
    head = b"\x10" + address.to_bytes(2, "big") + len(values).to_bytes(2, "big") + bytes([len(words)])
    return (head + words).ljust(PIECE, b"\0")


def one(address: int, value: int, function: int = 6) -> bytes:
    """A request of one word, as long as a piece."""
    return (bytes([function]) + address.to_bytes(2, "big") + value.to_bytes(2, "big")).ljust(PIECE, b"\0")


def read(address: int, count: int) -> bytes:
    return one(address, count, 3)


DRIVE = [read(az.DIRECT[0].address, 2) + one(az.DIRECT[-1].address + 1, 1), written(az.DIRECT[0].address, 0, 100)]
OVEN = [one(0x1001, 400) + one(0x0814, 0xFF00, 5) + read(0x1000, 2)]
CONVERTER = [
    written(t7_registers.SCAN_RATE.address, 0x447A, 0) + written(t7_registers.NUM_ADDRESSES.address, 0, 2)
    + written(t7_registers.SAMPLES_PER_PACKET.address, 0, 16) + written(t7_registers.ENABLE.address, 0, 1),
    read(0, 4) + read(t7_registers.FLASH, 8),
]  # fmt: skip
SCPI = [
    b"*IDN?\n*RST\nCONF:VOLT:DC 10,(@101,102)\nVOLT:DC:NPLC 0.02\nTRIG:SOUR TIM\nTRIG:TIM 0.1\nTRIG:COUN 4\nINIT\n",
    b"ROUT:SCAN (@101,102)\nREAD?\nDATA:POIN?\nDATA:REM? 2\nSYST:ERR?\nABOR\n*CLS\n",
]
COMMANDS: Sequence[tuple[float, ...]] = ((105.0, 10_000.0), (105.0, -1.0), (27.0, 2_500.0))
MAVLINK = [
    mav.frames(
        mav.COMMAND_LONG,
        mav.fields(mav.COMMAND_LONG, parameters=[*numbers, 0, 0, 0, 0, 0], command=511, system=1, component=1),
        np.array([0]), 255, 190, mav.V2,
    )[0]
    for numbers in COMMANDS
]  # fmt: skip
XBUS = [
    xbus.message(xbus.GO_TO_CONFIG) + xbus.message(xbus.OUTPUT_CONFIGURATION, xbus.configuration({0x4020: 100})),
    xbus.message(xbus.DEVICE_ID) + xbus.message(xbus.PRODUCT_CODE) + xbus.message(xbus.GO_TO_MEASUREMENT),
]


def sensor(twin: Any, settings: Any) -> Callable[[Port], Any]:
    return lambda port: twin(world(), settings, port)


TWINS: dict[str, Target] = {
    "drive-request": Target(requests(lambda: Drive(world(), "alpha", oriental.Settings())), (), DRIVE, 8),
    "oven-request": Target(requests(lambda: Oven(world())), (), OVEN, 8),
    "converter-request": Target(requests(lambda: Converter(world(), t7.Settings(), Port())), (), CONVERTER, 4),
    "scpi-request": Target(scpi_lines, (), SCPI, 8),
    "level-request": Target(letters(lambda port: Inclinometer(world(), dpg2.Settings(), port)), (), [b"sRGV?"], 8),
    "mavlink-request": Target(letters(sensor(Autopilot, mavlink.Settings(outputs=OUTPUTS))), (), MAVLINK, 4),
    "xbus-request": Target(letters(sensor(MotionTracker, xsens.Settings(outputs=OUTPUTS))), (), XBUS, 8),
}
