"""The simulated digital sensor: the outputs of the world's sensor as lines of text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.imu_lines.driver import FIELDS, FORCES, RATES, VOLTAGES, Settings
from drivers.imu_lines.lines import checksum
from drivers.imu_lines.reception import TIME, WRAP
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.server import Port, Server, Twin
from drivers.world.digital import Trim, trims

LISTEN = "pty:?baud=115200"
FAULTS = {
    "lost-line": Kind("does not send its lines"),
    "doubled-line": Kind("sends every line twice"),
    "wrong-baud": Kind("sends bytes as of another baud rate"),
    "stuck-axis": Kind("repeats the value of its first axis"),
    "clock-drift": Kind("its clock gains on the true time", 50.0, "ppm", -1e5),
}
# unit -> (factor from g, deg/s or uT; decimals)
FORCE = {"g": (1.0, 6), "m/s^2": (9.80665, 5), "count": (16384.0, 0)}
RATE = {"deg/s": (1.0, 5), "rad/s": (math.radians(1.0), 7), "count": (131.0, 0)}
FIELD = {"uT": (1.0, 4), "gauss": (1e-2, 6), "count": (10.0, 0)}
VOLTAGE = (1.0, 6)


class World(Protocol):
    """What a sensor knows of physics."""

    trims: Mapping[str, Trim]

    def sensed(self, outputs: Sequence[str], start_s: float, interval_s: float, n: int) -> NDArray[np.float64]: ...


class Talker(Twin):
    """One sensor on a line of its own. It sends from power-on; what finds no listener is lost."""

    def __init__(self, world: World, settings: Settings, port: Port) -> None:
        self.faults = Faults()
        self._world, self._settings, self._port, self._count = world, settings, port, 1
        self._clock = Clock(1 / settings.rate_hz)
        self._held: float | None = None

    def advance(self, now_s: float) -> None:
        """Take all samples that are due by `now_s`, and send them."""
        self._clock.run(1e-6 * (self.faults.size("clock-drift", now_s) or 0.0) if self.faults else 0.0, self._count)
        due = self._clock.ticks(now_s) + 1 - self._count
        if due <= 0:
            return
        start_s, interval_s, first = self._clock.true_s(self._count), self._clock.interval_s, self._count
        self._count += due
        if listeners := [c for c in self._port.connections.values() if not c.is_behind(now_s)]:
            names = list(self._settings.wired)
            factors = [formats(self._settings)[name][0] for name in names]
            for k, row in enumerate(self._world.sensed(names, start_s, interval_s, due) * factors):
                at_s = start_s + k * interval_s
                data = self._spoilt(dict(zip(names, row.tolist(), strict=True)), first + k, at_s)
                for connection in listeners:
                    connection.send(data, at_s)

    def due_s(self) -> float:
        return self._clock.true_s(self._count)

    def _time(self, count: int) -> float:
        """The sensor's time of a sample, which counts to 2^32 and begins again."""
        return round(count / self._settings.rate_hz / self._settings.time_unit_s) % WRAP

    def state(self) -> dict[str, Any]:
        return {"count": self._count, "clock": asdict(self._clock)}

    def restore(self, state: Mapping[str, Any]) -> None:
        self._count = state["count"]
        self._clock = Clock(**state["clock"])

    def _spoilt(self, values: dict[str, float], count: int, at_s: float) -> bytes:
        """The line of a sample, with the faults of the moment; `count` is its number by the sensor's clock."""
        if self.faults and self.faults.size("stuck-axis", at_s) is not None:
            name = next(iter(values))
            self._held = values[name] if self._held is None else self._held
            values[name] = self._held
        line = line_of(values | {TIME: self._time(count)}, self._settings)
        if not self.faults:
            return line
        if self.faults.size("lost-line", at_s) is not None:
            return b""
        if self.faults.size("wrong-baud", at_s) is not None:
            return bytes(byte ^ 0xF8 for byte in line[:-1]) + b"\n"
        return 2 * line if self.faults.size("doubled-line", at_s) is not None else line


@dataclass
class Clock:
    """The sensor's clock: its tick `tick` is at `tick_s` of the true time, and it gains `gain` from there on."""

    period_s: float  # of a tick, nominal
    tick: int = 0
    tick_s: float = 0.0
    gain: float = 0.0

    def run(self, gain: float, tick: int) -> None:
        """Gain this much from `tick` on."""
        if gain != self.gain:
            self.tick, self.tick_s, self.gain = tick, self.true_s(tick), gain

    @property
    def interval_s(self) -> float:
        """True time from tick to tick."""
        return self.period_s / (1 + self.gain)

    def true_s(self, tick: int) -> float:
        """The true time of a tick."""
        return self.tick_s + (tick - self.tick) * self.interval_s

    def ticks(self, now_s: float) -> int:
        """The number of the last tick by then."""
        return self.tick + int(np.floor((now_s - self.tick_s) / self.interval_s + 1e-6))


def formats(settings: Settings) -> dict[str, tuple[float, int]]:
    """For each output the factor from g, deg/s, uT or V to its unit, and the decimals in the line."""
    of = dict.fromkeys(VOLTAGES, VOLTAGE) | dict.fromkeys(FORCES, FORCE[settings.unit])
    return of | dict.fromkeys(RATES, RATE[settings.gyro_unit]) | dict.fromkeys(FIELDS, FIELD[settings.field_unit])


def line_of(values: Mapping[str, float], settings: Settings) -> bytes:
    """The text of one sample."""
    digits = {name: decimals for name, (_, decimals) in formats(settings).items()} | {TIME: 0}
    shown = {column: f"{values[name]:.{digits[name]}f}" for name, column in settings.columns.items()}
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
    """A line with a sensor for each role: role -> (unit id, which such a sensor has not, settings).

    Raises UnknownInput for a column that the simulated sensor does not have.
    """
    for _, settings in roles.values():
        trims(list(settings.wired), world.trims)
    ports = {role: Port(listen) for role in roles}
    twins = {role: Talker(world, roles[role][1], port) for role, port in ports.items()}
    return Server(list(ports.values()), twins, {role: Address(port.url) for role, port in ports.items()})
