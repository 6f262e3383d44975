"""The simulated motion tracker: it sends MTData2 from power-on, and can be configured."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from drivers.digital.frames import Frames
from drivers.digital.settings import FIELDS
from drivers.digital.twin import FRAME_FAULTS, Floats, FramedTwin, common_faults, serve_sensors
from drivers.transport.faults import Kind
from drivers.transport.server import Connection, Port, Server
from drivers.xsens_mti import messages as xbus
from drivers.xsens_mti.driver import TICK_S, TRIADS, Settings

if TYPE_CHECKING:
    from drivers.world.world import World

LISTEN = "pty:?baud=921600"
SERIAL, PRODUCT, FIRMWARE = 0x0370_03F8, b"MTi-30-2A8G4        ", bytes([1, 8, 2])
ANSWER_S = 0.001
EARTH_UT = 50.0  # field of one unit
FASTEST_HZ = {xbus.ACCELERATION: 400, xbus.RATE: 400, xbus.FIELD: 100, xbus.ACCELERATION_HR: 1000, xbus.RATE_HR: 1000}
POWER_ON_STATE = dict.fromkeys((xbus.ACCELERATION, xbus.RATE, xbus.FIELD), 100)
FAULTS = (
    common_faults("message")
    | FRAME_FAULTS
    | {"refuses": Kind("refuses every command with this error", 33), "deaf": Kind("does not answer")}
    | {"clipping": Kind("its status word reports the first axis of each sensor at the end of its range")}
)


class MotionTracker(FramedTwin):
    """A tracker. It measures from power-on, with accelerometer, gyroscope and magnetometer at 100 Hz."""

    carrier = "message"

    def __init__(self, world: World, settings: Settings, port: Port) -> None:
        super().__init__(world, settings, port)
        self._outputs = list(settings.wired)
        self._factors[[name in FIELDS for name in self._outputs]] = 1 / EARTH_UT
        self._heard: dict[str, Frames] = {}
        self._power_on(0.0)

    def state(self) -> dict[str, Any]:
        rates = {str(kind): rate_hz for kind, rate_hz in self._rates.items()}
        return super().state() | {"sending": self._sending, "rates": rates, "first": self._first}

    def restore(self, state: Mapping[str, Any]) -> None:
        super().restore(state)
        self._sending, self._first = state["sending"], state["first"]
        self._rates = {int(kind): rate_hz for kind, rate_hz in state["rates"].items()}

    def _power_on(self, now_s: float) -> None:
        self._rates, self._sending, self._first = dict(POWER_ON_STATE), True, 0
        self._begin_at(now_s, float(max(self._rates.values())))

    def _answer(self, connection: Connection, now_s: float) -> None:
        """Act on the messages in the received bytes."""
        messages = self._heard.setdefault(connection.key, Frames(xbus.Xbus())).take(bytes(connection.inbox))
        connection.inbox.clear()
        for number, data in xbus.messages(messages):
            if self.faults and self.faults.size("deaf", now_s) is not None:
                continue
            connection.send(self._with_faults(self._reply(number, data, now_s), now_s), now_s + ANSWER_S)

    def _reply(self, number: int, data: bytes, now_s: float) -> bytes:
        if self.faults and (code := self.faults.size("refuses", now_s)) is not None:
            return xbus.message(xbus.ERROR, bytes([int(code)]))
        if number == xbus.GO_TO_CONFIG:
            self._sending = False
            return xbus.message(number + 1)
        if self._sending:
            return b""
        if number == xbus.GO_TO_MEASUREMENT:
            self._measure(now_s)
            return xbus.message(number + 1)
        if number == xbus.OUTPUT_CONFIGURATION:
            return self._configure(data)
        replies = {xbus.DEVICE_ID: struct.pack(">I", SERIAL), xbus.PRODUCT_CODE: PRODUCT, xbus.FIRMWARE: FIRMWARE}
        return xbus.message(number + 1, replies[number]) if number in replies else xbus.message(xbus.ERROR, b"\x04")

    def _measure(self, now_s: float) -> None:
        """Begin to send; the messages are counted from 0."""
        self._sending = not (self.faults and self.faults.size("mute", now_s) is not None)
        self._change_rate(now_s, float(max(self._rates.values(), default=100)))
        self._first = self._count

    def _configure(self, data: bytes) -> bytes:
        """Take over the rates that it has, the highest where more is wanted: its answer."""
        try:
            requested = xbus.pairs(data)
        except ValueError:
            return xbus.message(xbus.ERROR, b"\x21")
        granted = {kind: min(rate_hz, FASTEST_HZ.get(kind, rate_hz)) for kind, rate_hz in requested.items()}
        self._rates = {kind: rate_hz for kind, rate_hz in granted.items() if kind in FASTEST_HZ and rate_hz}
        return xbus.message(xbus.OUTPUT_CONFIGURATION + 1, xbus.configuration(granted))

    def _messages(self, values: Floats, ticks: NDArray[np.int64]) -> list[bytes]:
        time = np.rint(self._sensor_s(ticks) / TICK_S).astype(np.int64)
        warm = (time // round(1 / TICK_S)) > ((time - round(self._clock.period_s / TICK_S)) // round(1 / TICK_S))
        counter, status = ((ticks - self._first) % 65536).astype(">u2"), np.ones(len(ticks), dtype=np.int64)
        if self.faults:
            times_s = [self._clock.true_s(int(tick)) for tick in ticks]
            clipped = [self.faults.size("clipping", now_s) is not None for now_s in times_s]
            status |= np.where(clipped, 0b001001001 << xbus.CLIPPED, 0)
        columns: list[tuple[int, NDArray[Any]]] = [(xbus.COUNTER, counter), (xbus.TIME, (time % 2**32).astype(">u4"))]
        columns += [(kind, self._triad(values, TRIADS[kind])) for kind in self._rates]
        columns.append((xbus.STATUS, status.astype(">u4")))
        temperature = np.full(len(ticks), self._world.die_c(), dtype=">f4")
        packets = [b""] * len(ticks)
        for group, extra in ((~warm, []), (warm, [(xbus.TEMPERATURE, temperature)])):
            if group.any():
                messages = xbus.data_messages([(kind, column[group]) for kind, column in (*extra, *columns)])
                for place, data in zip(np.flatnonzero(group).tolist(), messages, strict=True):
                    packets[place] = data
        return packets

    def _triad(self, values: Floats, names: tuple[str, ...]) -> NDArray[Any]:
        """The three outputs of a sensor; one that the world does not have is 0."""
        triad = np.zeros((len(values), 3), dtype=">f4")
        for k, name in enumerate(names):
            if name in self._outputs:
                triad[:, k] = values[:, self._outputs.index(name)]
        return triad


def serve(world: World, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """A tracker for each role."""
    return serve_sensors(MotionTracker, world, roles, listen)
