"""The simulated flight controller: heartbeat, and the message of its settings once it is requested."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from drivers.digital.frames import Frames, Ints
from drivers.digital.settings import OUTPUTS
from drivers.digital.twin import FRAME_FAULTS, Floats, FramedTwin, common_faults, serve_sensors
from drivers.mavlink_imu import messages as mav
from drivers.mavlink_imu.driver import END, NO_TEMPERATURE, UPDATE_BITS, WARM, Settings
from drivers.transport.faults import Kind
from drivers.transport.server import Connection, Port, Server

if TYPE_CHECKING:
    from drivers.world.world import World

LISTEN = "tcp://127.0.0.1:0"
SYSTEM, COMPONENT, QUADROTOR, PX4 = 1, 1, 2, 12
FASTEST_HZ = 4000.0
ANSWER_S = 0.001
FAULTS = common_faults("message") | FRAME_FAULTS | {"no-heartbeat": Kind("sends no heartbeat")}


class Autopilot(FramedTwin):
    """A flight controller. It sends its heartbeat from power-on, and samples when they are requested."""

    carrier = "message"

    def __init__(self, world: World, settings: Settings, port: Port) -> None:
        super().__init__(world, settings, port)
        self._settings, self._message = settings, mav.IMU[settings.message]
        self._columns = [OUTPUTS.index(name) for name in settings.outputs]
        self._beat_s, self._sequence = 1.0, 0
        self._heard: dict[str, Frames] = {}

    def due_s(self) -> float:
        return min(self._beat_s, super().due_s())

    def state(self) -> dict[str, Any]:
        own_state = {"sending": self._sending, "beat_s": self._beat_s, "sequence": self._sequence}
        return super().state() | own_state

    def restore(self, state: Mapping[str, Any]) -> None:
        super().restore(state)
        self._sending, self._beat_s, self._sequence = state["sending"], state["beat_s"], state["sequence"]

    def _power_on(self, now_s: float) -> None:
        self._sending, self._sequence = False, 0
        self._begin_at(now_s, self._settings.rate_hz)

    def _sample(self, now_s: float, listeners: Sequence[Connection]) -> None:
        """Send samples and heartbeats in their order."""
        while self._beat_s <= now_s:
            super()._sample(self._beat_s, listeners)
            self._beat(self._beat_s, listeners)
            self._beat_s += 1.0
        super()._sample(now_s, listeners)

    def _beat(self, now_s: float, listeners: Sequence[Connection]) -> None:
        if self.faults and self.faults.size("no-heartbeat", now_s) is not None:
            return
        data = self._frames(
            mav.HEARTBEAT, mav.fields(mav.HEARTBEAT, type=QUADROTOR, autopilot=PX4, status=3, version=3)
        )
        for connection in listeners:
            connection.send(self._with_faults(data[0], now_s), now_s)

    def _answer(self, connection: Connection, now_s: float) -> None:
        """Act on the commands that have arrived."""
        messages = self._heard.setdefault(connection.key, Frames(mav.Mavlink())).take(bytes(connection.inbox))
        connection.inbox.clear()
        heads = mav.heads(messages)
        commands = np.flatnonzero((heads.number == mav.COMMAND_LONG.number) & messages.known)
        for command in mav.contents(messages, heads, mav.COMMAND_LONG, commands):
            if command["system"] not in (0, SYSTEM):
                continue
            acknowledgement = mav.fields(
                mav.COMMAND_ACK, command=command["command"], result=self._result(command, now_s)
            )
            for data in self._frames(mav.COMMAND_ACK, acknowledgement):
                connection.send(self._with_faults(data, now_s), now_s + ANSWER_S)

    def _result(self, command: Any, now_s: float) -> int:
        """Set the interval of the message: the result of a command. 0 is the usual one, -1 stops it."""
        if self.faults and (refusal_code := self.faults.size("refuses", now_s)) is not None:
            return int(refusal_code)
        number, interval_us = command["parameters"][:2].tolist()
        if command["command"] != mav.SET_MESSAGE_INTERVAL or number != self._message.number:
            return 3
        rate_hz = 1e6 / interval_us if interval_us > 0 else self._settings.rate_hz
        if rate_hz > FASTEST_HZ:
            return 2
        if not math.isclose(rate_hz, 1 / self._clock.period_s, rel_tol=1e-6) or not self._sending:
            self._change_rate(now_s, rate_hz)
        self._sending = interval_us >= 0 and not (self.faults and self.faults.size("mute", now_s) is not None)
        return 0

    def _messages(self, values: Floats, ticks: NDArray[np.int64]) -> list[bytes]:
        content = np.zeros(len(values), dtype=self._message.dtype)
        numbers = np.zeros((len(values), len(OUTPUTS)))
        numbers[:, self._columns] = values / self._settings.factor
        if self._message is not mav.HIGHRES_IMU:
            numbers = np.clip(np.rint(numbers), -END, END)
        for k, sensor in enumerate("agm"):
            content[sensor] = numbers[:, 3 * k : 3 * k + 3]
        content["time"] = np.rint(self._sensor_s(ticks) / self._settings.time_unit_s)
        temperature_c = self._world.die_c()
        if self._message is mav.HIGHRES_IMU:
            content["temperature"], content["pressure"][:, 0] = temperature_c, 1013.25
            content["updated"] = sum(UPDATE_BITS[name] for name in self._settings.outputs) | 1 << 9 | WARM
        else:
            content["temperature"] = round(100 * temperature_c) or NO_TEMPERATURE + 1
        if "id" in (self._message.dtype.names or ()):
            content["id"] = self._settings.imu
        return self._frames(self._message, content)

    def _frames(self, message: mav.Message, content: NDArray[np.void]) -> list[bytes]:
        sequences: Ints = self._sequence + np.arange(len(content))
        self._sequence = (self._sequence + len(content)) % 256
        return mav.frames(message, content, sequences, SYSTEM, COMPONENT)


def serve(world: World, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """A flight controller for each role."""
    return serve_sensors(Autopilot, world, roles, listen)
