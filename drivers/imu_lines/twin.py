"""The simulated digital sensor: the outputs of the world's sensor as lines of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from drivers.digital.settings import FIELDS, FORCES, RATES, TEMPERATURE, VOLTAGES
from drivers.digital.twin import DigitalTwin, Floats, common_faults, serve_sensors
from drivers.imu_lines.driver import WRAP, Settings
from drivers.imu_lines.lines import TIME, checksum
from drivers.transport.server import Port, Server

if TYPE_CHECKING:
    from drivers.world.world import World

LISTEN = "pty:?baud=115200"
FAULTS = common_faults("line")
DECIMALS = {"g": 6, "m/s^2": 5, "deg/s": 5, "rad/s": 7, "uT": 4, "gauss": 6, "count": 0}
VOLTAGE = 6


class Talker(DigitalTwin):
    """One sensor with its own line. It sends from power-on."""

    carrier = "line"

    def __init__(self, world: World, settings: Settings, port: Port) -> None:
        super().__init__(world, settings, port)
        self._settings = settings

    def _messages(self, values: Floats, ticks: NDArray[np.int64]) -> list[bytes]:
        rows = (dict(zip(self._names, row, strict=True)) for row in values.tolist())
        times, warm = map(self._time, ticks.tolist()), {TEMPERATURE: self._world.die_c()}
        return [line_of(row | warm | {TIME: time}, self._settings) for row, time in zip(rows, times, strict=True)]

    def _time(self, tick: int) -> float:
        """The sensor's time of a sample, which counts to 2^32 and begins again."""
        return round(tick / self._settings.rate_hz / self._settings.time_unit_s) % WRAP

    def _spoilt(self, message: bytes, now_s: float) -> bytes:
        """Garble the message as at another baud rate: some bytes still look like an end of line."""
        garbled = super()._spoilt(message, now_s)
        return garbled if garbled.endswith(b"\n") or not garbled else garbled[:-1] + b"\n"


def decimals(settings: Settings) -> dict[str, int]:
    """The decimals of each output in the line."""
    force, rate, field = (DECIMALS[unit] for unit in settings.kinds)
    by_output = dict.fromkeys(VOLTAGES, VOLTAGE) | dict.fromkeys(FORCES, force)
    return by_output | dict.fromkeys(RATES, rate) | dict.fromkeys(FIELDS, field)


def line_of(values: Mapping[str, float], settings: Settings) -> bytes:
    """The text of one sample."""
    digits = decimals(settings) | {TIME: 0, TEMPERATURE: 2}
    texts = {column: f"{values[name]:.{digits[name]}f}" for name, column in settings.columns.items()}
    if settings.format == "named":
        return (" ".join(f"{name}:{text}" for name, text in texts.items()) + "\r\n").encode()
    if settings.format == "teleplot":
        return "".join(f">{name}:{text}\n" for name, text in texts.items()).encode()
    last = max(column for column in texts if isinstance(column, int))
    text = ",".join(texts.get(k, "0") for k in range(1, last + 1))
    if settings.format == "nmea":
        text = f"PIMU,{text}"
        text = f"${text}*{checksum(text):02X}"
    return f"{text}\r\n".encode()


def serve(world: World, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """A sensor for each role."""
    return serve_sensors(Talker, world, roles, listen)
