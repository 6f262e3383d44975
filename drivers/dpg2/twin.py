"""The simulated DPG2: it sends readings of the world's level without requests until it is stopped."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from drivers.dpg2.driver import ONE_READING, STOP, VERSION, Settings
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.server import Connection, Port, Server, Twin

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

LISTEN = "pty:?baud=9600"
FAULTS = {
    "lies": Kind("reports this much more along x", 1.0, "deg"),
    "stale": Kind("repeats its last reading"),
    "out-of-range": Kind("reports that it is out of range"),
    "deaf": Kind("continues to send after the command to stop"),
    "restart": Kind("loses power for a moment: sends without a request, once"),
}
INTERVAL_S = 0.1  # from one pair of lines to the next [M]
THINKING_S = 0.002  # [M]
START = b"S"
IDENTITY = b"DPL2 V1.8.0\r\nSN:123456789\r\n"


class Inclinometer(Twin):
    """One level on a line of its own. It sends from power-on; bytes into an open or a full line are lost."""

    def __init__(self, world: AnyWorld, settings: Settings, port: Port) -> None:
        self.faults = Faults()
        self._world, self._range_deg, self._port = world, settings.range_deg, port
        self._running, self._next_s = True, 0.0
        port.answer = self._answer

    def advance(self, now_s: float) -> None:
        """Apply the fault `restart`. The level is read only when a line is sent: the converter may still sample."""
        if strike := self.faults.once("restart", now_s):
            self._running, self._next_s = True, max(strike.at_s, self._next_s)

    def speak(self, now_s: float) -> None:
        """Send the lines that are due by `now_s`."""
        while self._running and self._next_s <= now_s:
            if listeners := [c for c in self._port.connections.values() if self._has_sent_all(c)]:
                lines = self._reading_lines(self._next_s)
                for connection in listeners:
                    self._send_lines(connection, lines, self._next_s)
            self._next_s += INTERVAL_S

    def due_s(self) -> float:
        return self._next_s if self._running else math.inf

    def state(self) -> dict[str, Any]:
        return {"running": self._running, "next_s": self._next_s}

    def restore(self, state: Mapping[str, Any]) -> None:
        self._running, self._next_s = state["running"], state["next_s"]

    def _answer(self, connection: Connection, now_s: float) -> None:
        """Act on each letter. Only a few are commands, and only two of them while it sends readings."""
        for letter in bytes(connection.inbox):
            self._obey(bytes([letter]), connection, now_s)
        connection.inbox.clear()

    def _obey(self, letter: bytes, connection: Connection, now_s: float) -> None:
        began_s = now_s + self._port.timing.character_s + THINKING_S
        if letter == STOP:
            self._running = self.faults.size("deaf", now_s) is not None
            self._send_lines(connection, [STOP], began_s)
        elif letter == START:
            self._running, self._next_s = True, began_s
        elif letter == ONE_READING and not self._running:
            self._send_lines(connection, self._reading_lines(now_s), began_s)
        elif letter == VERSION and not self._running:
            self._send_lines(connection, IDENTITY.splitlines(keepends=True), began_s)

    def _reading_lines(self, t_s: float) -> list[bytes]:
        """Both lines at `t_s`, or at the present time of the world if that is later."""
        self._world.advance(max(t_s, self._world.now_s))
        x_deg, y_deg = self.faults.held("stale", t_s, list(self._world.level_deg()))
        x_deg += self.faults.size("lies", t_s) or 0.0
        if self.faults.size("out-of-range", t_s) is not None:
            x_deg = 2 * self._range_deg
        return [f"{axis}={self._display_text(deg)}\r\n".encode() for axis, deg in (("X", x_deg), ("Y", y_deg))]

    def _display_text(self, deg: float) -> str:
        return f"{deg:+07.3f}" if abs(deg) <= self._range_deg else 7 * "+-"[deg < 0]

    def _has_sent_all(self, connection: Connection) -> bool:
        """Whether all earlier bytes are sent."""
        connection.emit(self._next_s)
        return not connection.is_behind(self._next_s)

    def _send_lines(self, connection: Connection, lines: list[bytes], began_s: float) -> None:
        """Send each line at the time at which its last character would have arrived."""
        for line in lines:
            began_s += len(line) * self._port.timing.character_s
            connection.send(line, began_s)


class LevelServer(Server):
    """A server whose twins send after all other servers have reached the present time."""

    def __init__(self, ports: Mapping[str, Port], twins: Mapping[str, Inclinometer]) -> None:
        super().__init__(list(ports.values()), twins, {role: Address(port.url) for role, port in ports.items()})
        self._levels = twins

    def emit(self, now_s: float) -> None:
        for level in self._levels.values():
            level.speak(now_s)
        super().emit(now_s)


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> LevelServer:
    """A line with a level for each role: role -> (unit id, not used by such a level; settings)."""
    ports = {role: Port(listen) for role in roles}
    return LevelServer(ports, {role: Inclinometer(world, roles[role][1], port) for role, port in ports.items()})
