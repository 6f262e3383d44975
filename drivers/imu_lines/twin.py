"""The simulated digital sensor: the analog sensor of the world, read and divided by its nominal gain inside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.imu_lines.driver import TIME, Settings
from drivers.imu_lines.lines import checksum
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.server import Port, Server, Twin

LISTEN = "pty:?baud=115200"
FAULTS = {
    "lost-line": Kind("does not send its lines"),
    "doubled-line": Kind("sends every line twice"),
    "wrong-baud": Kind("sends bytes as of another baud rate"),
    "stuck-axis": Kind("repeats the value of its first axis"),
}
ZERO_V, V_PER_G = 1.65, 0.8  # nominal, of the analog part
PER_G = {"g": 1.0, "m/s^2": 9.80665, "count": 16384.0}  # the output at 1 g
DIGITS = {"g": 6, "m/s^2": 5, "count": 0}


class World(Protocol):
    """What a sensor knows of physics."""

    def adc_volts(self, inputs: Sequence[str], start_s: float, interval_s: float, n: int) -> NDArray[np.float64]: ...


class Talker(Twin):
    """One sensor on a line of its own. It sends from power-on; what finds no listener is lost."""

    def __init__(self, world: World, settings: Settings, port: Port) -> None:
        self.faults = Faults()
        self._world, self._settings, self._port, self._count = world, settings, port, 1
        self._held: float | None = None

    def advance(self, now_s: float) -> None:
        """Take all samples that are due by `now_s`, and send them."""
        rate_hz = self._settings.rate_hz
        due = int(np.floor(now_s * rate_hz + 1e-6)) + 1 - self._count
        if due <= 0:
            return
        start_s, first = self._count / rate_hz, self._count
        self._count += due
        if listeners := [c for c in self._port.connections.values() if not c.is_behind(now_s)]:
            names = [name for name in self._settings.columns if name != TIME]
            volts = self._world.adc_volts(names, start_s, 1 / rate_hz, due)
            for k, row in enumerate((volts - ZERO_V) / V_PER_G * PER_G[self._settings.unit]):
                at_s = (first + k) / rate_hz
                data = self._spoilt(dict(zip(names, row.tolist(), strict=True)), at_s)
                for connection in listeners:
                    connection.send(data, at_s)

    def due_s(self) -> float:
        return self._count / self._settings.rate_hz

    def state(self) -> dict[str, Any]:
        return {"count": self._count}

    def restore(self, state: Mapping[str, Any]) -> None:
        self._count = state["count"]

    def _spoilt(self, values: dict[str, float], at_s: float) -> bytes:
        """The line of a sample, with the faults of the moment."""
        if self.faults and self.faults.size("stuck-axis", at_s) is not None:
            name = next(iter(values))
            self._held = values[name] if self._held is None else self._held
            values[name] = self._held
        line = line_of(values | {TIME: round(at_s / self._settings.time_unit_s)}, self._settings)
        if not self.faults:
            return line
        if self.faults.size("lost-line", at_s) is not None:
            return b""
        if self.faults.size("wrong-baud", at_s) is not None:
            return bytes(byte ^ 0xF8 for byte in line[:-1]) + b"\n"
        return 2 * line if self.faults.size("doubled-line", at_s) is not None else line


def line_of(values: Mapping[str, float], settings: Settings) -> bytes:
    """The text of one sample."""
    digits = DIGITS[settings.unit]
    shown = {
        column: f"{values[name]:.0f}" if name == TIME else f"{values[name]:.{digits}f}"
        for name, column in settings.columns.items()
    }
    if settings.format == "named":
        return (" ".join(f"{name}:{text}" for name, text in shown.items()) + "\r\n").encode()
    if settings.format == "teleplot":
        return "".join(f">{name}:{text}\n" for name, text in shown.items()).encode()
    last = max(column for column in shown if isinstance(column, int))
    text = ",".join(shown.get(k, "0") for k in range(1, last + 1))
    if settings.format == "nmea":
        text = f"PIMU,{text}"
        text = f"${text}*{checksum(text):02X}"
    return f"{text}\r\n".encode()


def serve(world: World, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """A line with a sensor for each role: role -> (unit id, which such a sensor has not, settings)."""
    ports = {role: Port(listen) for role in roles}
    twins = {role: Talker(world, roles[role][1], port) for role, port in ports.items()}
    return Server(list(ports.values()), twins, {role: Address(port.url) for role, port in ports.items()})
