"""The base of simulated digital sensors: they send the outputs of the world's sensor at the rate of their own clock."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.digital.settings import FIELDS, FORCES, RATES, VOLTAGES, DigitalSettings
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.server import Connection, Port, Server, Twin

if TYPE_CHECKING:
    from drivers.world.world import World

Floats = NDArray[np.float64]
G_M_S2 = 9.80665
HELD = 1 << 16  # bytes
# unit -> factor from g, deg/s or uT
FORCE = {"g": 1.0, "m/s^2": G_M_S2, "count": 16384.0}
RATE = {"deg/s": 1.0, "rad/s": math.radians(1.0), "count": 131.0}
FIELD = {"uT": 1.0, "gauss": 1e-2, "count": 10.0}


def common_faults(carrier: str) -> dict[str, Kind]:
    """Faults that each such sensor can have; `carrier` is the word for what carries a sample, such as `line`."""
    return {
        f"lost-{carrier}": Kind(f"does not send its {carrier}s"),
        f"doubled-{carrier}": Kind(f"sends every {carrier} twice"),
        "wrong-baud": Kind("sends bytes as of another baud rate"),
        "stuck-axis": Kind("repeats the value of its first axis"),
        "clock-drift": Kind("its clock gains on the true time", 50.0, "ppm", -1e5),
    }


FRAME_FAULTS = {  # of a sensor that sends frames when they are requested
    "refuses": Kind("refuses every command with this result", 3),
    "mute": Kind("acknowledges a request, and sends no samples"),
    "wrong-checksum": Kind("every message has a wrong checksum"),
    "half-message": Kind("sends the first half of each message"),
    "restart": Kind("loses power for a moment: its time and its settings begin anew, once"),
}


S = TypeVar("S", bound=DigitalSettings)


@dataclass
class Clock:
    """The sensor's clock: tick number `tick` is at the true time `tick_s`; from there on its rate error is `gain`."""

    period_s: float  # of a tick, nominal
    tick: int = 0
    tick_s: float = 0.0
    gain: float = 0.0

    def run(self, gain: float, tick: int) -> None:
        """Set the rate error from `tick` on."""
        if gain != self.gain:
            self.tick, self.tick_s, self.gain = tick, self.true_s(tick), gain

    @property
    def interval_s(self) -> float:
        """True time between two ticks, s."""
        return self.period_s / (1 + self.gain)

    def true_s(self, tick: int) -> float:
        """True time of a tick, s."""
        return self.tick_s + (tick - self.tick) * self.interval_s

    def local_s(self, now_s: float) -> float:
        """Time by this clock since its tick 0, s."""
        return self.period_s * (self.tick + (now_s - self.tick_s) / self.interval_s)

    def ticks(self, now_s: float) -> int:
        """Number of the last tick at `now_s`."""
        return self.tick + int(np.floor((now_s - self.tick_s) / self.interval_s + 1e-6))


class DigitalTwin(Twin):
    """One sensor with its own line. It samples from power-on; samples without a listener are lost.

    `carrier` is the word in the names of its faults.
    """

    carrier: str

    def __init__(self, world: World, settings: DigitalSettings, port: Port) -> None:
        self.faults = Faults()
        self._world, self._port, self._count = world, port, 1
        self._names = list(settings.wired)
        self._factors = factors(settings)
        self._clock, self._zero_s = Clock(1 / settings.rate_hz), 0.0  # the sensor's time of tick 0
        self._stuck_value: float | None = None

    @abstractmethod
    def _messages(self, values: Floats, ticks: NDArray[np.int64]) -> list[bytes]:
        """The line or message of each sample: values (n, outputs) in the units of the settings, and their ticks."""

    def advance(self, now_s: float) -> None:
        """Take all samples that are due by `now_s`, and send them."""
        self._sample(now_s, [c for c in self._port.connections.values() if not c.is_behind(now_s)])

    def _sample(self, now_s: float, listeners: Sequence[Connection]) -> None:
        """Take all samples that are due by `now_s`, and send them to `listeners`."""
        self._clock.run(1e-6 * (self.faults.size("clock-drift", now_s) or 0.0) if self.faults else 0.0, self._count)
        due = self._clock.ticks(now_s) + 1 - self._count
        if due <= 0:
            return
        start_s, interval_s, first = self._clock.true_s(self._count), self._clock.interval_s, self._count
        self._count += due
        if listeners:
            values = self._world.sensed(self._names, start_s, interval_s, due) * self._factors
            at_s: Floats = np.minimum(start_s + interval_s * np.arange(due, dtype=np.float64), now_s)
            ticks = np.arange(first, first + due)
            self._send(values, ticks, at_s, listeners)

    def due_s(self) -> float:
        return self._clock.true_s(self._count)

    def state(self) -> dict[str, Any]:
        return {"count": self._count, "clock": asdict(self._clock), "zero_s": self._zero_s}

    def restore(self, state: Mapping[str, Any]) -> None:
        self._count, self._zero_s = state["count"], state["zero_s"]
        self._clock = Clock(**state["clock"])

    def _begin_at(self, now_s: float, rate_hz: float) -> None:
        """Restart: the sensor's time is 0."""
        self._clock, self._zero_s, self._count = Clock(1 / rate_hz, 0, now_s, self._clock.gain), 0.0, 1

    def _change_rate(self, now_s: float, rate_hz: float) -> None:
        """Change the sample rate; the sensor's time continues."""
        time_s = self._zero_s + self._clock.local_s(now_s)
        self._begin_at(now_s, rate_hz)
        self._zero_s = time_s

    def _sensor_s(self, ticks: NDArray[np.int64]) -> Floats:
        """The times of samples by the sensor's clock, s."""
        return np.asarray(self._zero_s + self._clock.period_s * ticks)

    def _send(self, values: Floats, ticks: NDArray[np.int64], at_s: Floats, listeners: Sequence[Connection]) -> None:
        """Send samples: together, or one by one while there are faults."""
        if not self.faults:
            pieces = [(float(at_s[-1]), b"".join(self._messages(values, ticks)))]
        else:
            for row, now_s in zip(values, at_s.tolist(), strict=True):
                self._spoil(row, now_s)
            messages = self._messages(values, ticks)
            pieces = [(t, self._spoilt(m, t)) for t, m in zip(at_s.tolist(), messages, strict=True)]
        for connection in listeners:
            for now_s, data in pieces:
                connection.send(data, now_s)

    def _spoil(self, row: Floats, now_s: float) -> None:
        """Apply the present faults to the values of a sample."""
        if self.faults.size("stuck-axis", now_s) is not None:
            self._stuck_value = float(row[0]) if self._stuck_value is None else self._stuck_value
            row[0] = self._stuck_value

    def _spoilt(self, message: bytes, now_s: float) -> bytes:
        """Apply the present faults to a line or message."""
        if self.faults.size(f"lost-{self.carrier}", now_s) is not None:
            return b""
        if self.faults.size("wrong-baud", now_s) is not None:
            return bytes(byte ^ 0xF8 for byte in message)
        return 2 * message if self.faults.size(f"doubled-{self.carrier}", now_s) is not None else message


class FramedTwin(DigitalTwin):
    """A sensor that sends frames of bytes when they are requested."""

    def __init__(self, world: World, settings: DigitalSettings, port: Port) -> None:
        super().__init__(world, settings, port)
        self._sending = False
        port.answer = self._answer

    @abstractmethod
    def _answer(self, connection: Connection, now_s: float) -> None:
        """Act on the bytes that have arrived."""

    @abstractmethod
    def _power_on(self, now_s: float) -> None:
        """Restart with the settings of power-on."""

    def advance(self, now_s: float) -> None:
        if self.faults and self.faults.once("restart", now_s):
            self._power_on(now_s)
        super().advance(now_s)

    def due_s(self) -> float:
        return super().due_s() if self._sending else math.inf

    def _sample(self, now_s: float, listeners: Sequence[Connection]) -> None:
        if self._sending:
            super()._sample(now_s, listeners)

    def _spoilt(self, message: bytes, now_s: float) -> bytes:
        return self._with_faults(super()._spoilt(message, now_s), now_s)

    def _with_faults(self, message: bytes, now_s: float) -> bytes:
        """A message; by the present faults its checksum is wrong, or half of it is missing."""
        if not self.faults or not message:
            return message
        if self.faults.size("half-message", now_s) is not None:
            return message[: len(message) // 2]
        is_corrupted = self.faults.size("wrong-checksum", now_s) is not None
        return message[:-1] + bytes([message[-1] ^ 0x55]) if is_corrupted else message


def serve_sensors(
    sensor: Callable[[World, S, Port], DigitalTwin], world: World, roles: Mapping[str, tuple[int, S]], listen: str
) -> Server:
    """A link with a sensor for each role: role -> (unit id, not used by such a sensor; settings)."""
    ports = {role: Port(listen, capacity=HELD) for role in roles}
    twins = {role: sensor(world, roles[role][1], port) for role, port in ports.items()}
    return Server(list(ports.values()), twins, {role: Address(port.url) for role, port in ports.items()})


def factors(settings: DigitalSettings) -> Floats:
    """The factor from g, deg/s, uT or V to the unit of each output, shape (outputs,)."""
    force, rate, field = settings.kinds
    by_output = dict.fromkeys(VOLTAGES, 1.0) | dict.fromkeys(FORCES, FORCE[force])
    by_output |= dict.fromkeys(RATES, RATE[rate]) | dict.fromkeys(FIELDS, FIELD[field])
    return np.array([by_output[name] for name in settings.wired])
