"""The simulated SCPI scanner: lines on a socket, a timer, a memory of readings and a queue of errors."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from drivers.scpi_meter.driver import Settings
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.server import Connection, Port, Server, Twin

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

__all__ = ["FAULTS", "LISTEN", "Scanner", "serve"]

LISTEN = "tcp://127.0.0.1:0"
FAULTS = {
    "overload": Kind("shows an overload at its first input"),
    "error": Kind("has this error in its queue, once", -222, "code"),
    "stall": Kind("measures nothing after the start of a record"),
}
WHO = "SIMULATED,SCPI scanner,1234567,1.0"
THINKING_S = 0.002
OVERLOAD_V = 9.9e37
BEYOND = 1.2  # of its range, up to which it measures
MOST_RANGE_V = 300.0
SHORTEST_S, LONGEST_S = 1e-6, 1e6  # between two scans
MOST_SCANS = 10**9
MOST_ERRORS = 10
TEXTS = {
    -104: "Data type error",
    -113: "Undefined header",
    -222: "Data out of range",
    -350: "Queue overflow",
}
LIST = re.compile(r"\(@([\d,]+)\)")


class Scanner(Twin):
    """The instrument behind its line. An input that is wired to nothing reads 0 V."""

    def __init__(self, world: AnyWorld, settings: Settings) -> None:
        self.faults = Faults()
        self._world, self._wiring = world, {number: name for name, number in settings.wired.items()}
        self._errors: deque[int] = deque()
        self._range_v, self._numbers, self._rate_hz, self._count = MOST_RANGE_V, [0], 1.0, 1
        self._start_s, self._sent_count, self._remaining_count = 0.0, 0, 0
        self._memory: deque[float] = deque()

    def advance(self, now_s: float) -> None:
        """Take all scans that have begun by `now_s`."""
        if strike := self.faults.once("error", now_s):
            self._fail(int(strike.size))
        due = math.floor((now_s - self._start_s) * self._rate_hz + 1e-6) + 1 if self._remaining_count else 0
        new = min(due - self._sent_count, self._remaining_count)
        if new > 0 and self.faults.size("stall", now_s) is None:
            start_s = self._start_s + self._sent_count / self._rate_hz
            self._memory.extend(self._scans(start_s, 1 / self._rate_hz, new, now_s).ravel())
            self._sent_count, self._remaining_count = self._sent_count + new, self._remaining_count - new

    def answer(self, command: str, now_s: float) -> str | None:
        """Obey a line; the answer to a question."""
        head, _, arguments = command.strip().partition(" ")
        obey = self._commands.get(head.upper())
        if obey is None:
            self._fail(-113)
            return None
        try:
            return obey(arguments, now_s)
        except ValueError:  # not a number
            self._fail(-104)
            return None

    @property
    def _commands(self) -> dict[str, Callable[[str, float], str | None]]:
        return {
            "*IDN?": lambda _arguments, _now_s: WHO,
            "*RST": lambda _arguments, _now_s: self._reset(),
            "*CLS": lambda _arguments, _now_s: self._errors.clear(),
            "SYST:ERR?": lambda _arguments, _now_s: self._error(),
            "ABOR": lambda _arguments, _now_s: self._stop(),
            "CONF:VOLT:DC": lambda arguments, _now_s: self._configure(arguments),
            "VOLT:DC:NPLC": lambda _arguments, _now_s: None,
            "ROUT:SCAN": lambda arguments, _now_s: self._list(arguments),
            "TRIG:SOUR": lambda _arguments, _now_s: None,
            "SAMP:SOUR": lambda _arguments, _now_s: None,
            "TRIG:TIM": lambda arguments, _now_s: self._set_rate(arguments),
            "SAMP:TIM": lambda arguments, _now_s: self._set_rate(arguments),
            "TRIG:COUN": lambda arguments, _now_s: self._set_count(arguments),
            "SAMP:COUN": lambda arguments, _now_s: self._set_count(arguments),
            "INIT": lambda _arguments, now_s: self._begin(now_s),
            "READ?": lambda _arguments, now_s: _numbers_text(self._scans(now_s, 0.0, 1, now_s).ravel()),
            "DATA:POIN?": lambda _arguments, _now_s: str(len(self._memory)),
            "DATA:REM?": lambda arguments, _now_s: self._remove(arguments),
        }

    def _reset(self) -> None:
        self._range_v, self._numbers, self._rate_hz, self._count = MOST_RANGE_V, [0], 1.0, 1
        self._memory.clear()
        self._stop()

    def _stop(self) -> None:
        self._start_s, self._sent_count, self._remaining_count = 0.0, 0, 0

    def _configure(self, arguments: str) -> None:
        self._stop()
        range_v = float(arguments.partition(",")[0])
        if not 0 < range_v <= MOST_RANGE_V:
            self._fail(-222)
            return
        self._range_v = range_v
        self._list(arguments)

    def _list(self, arguments: str) -> None:
        self._numbers = sorted(int(k) for k in match[1].split(",")) if (match := LIST.search(arguments)) else [0]

    def _set_rate(self, arguments: str) -> None:
        interval_s = float(arguments)
        if not SHORTEST_S <= interval_s <= LONGEST_S:
            self._fail(-222)
            return
        self._rate_hz = 1 / interval_s

    def _set_count(self, arguments: str) -> None:
        count = int(arguments)
        if not 1 <= count <= MOST_SCANS:
            self._fail(-222)
            return
        self._count = count

    def _begin(self, now_s: float) -> None:
        self._memory.clear()
        self._start_s, self._sent_count, self._remaining_count = now_s, 0, self._count
        self.advance(now_s)

    def _remove(self, arguments: str) -> str | None:
        if not 0 <= (count := int(arguments)) <= len(self._memory):
            self._fail(-222)
            return None
        return _numbers_text([self._memory.popleft() for _ in range(count)])

    def _scans(self, start_s: float, interval_s: float, n: int, now_s: float) -> NDArray[np.float64]:
        """Displayed volts of `n` scans, shape (n, inputs)."""
        volts = np.zeros((n, len(self._numbers)))
        if wired := [k for k, number in enumerate(self._numbers) if number in self._wiring]:
            if not interval_s:
                self._world.advance(start_s)
            names = [self._wiring[self._numbers[k]] for k in wired]
            volts[:, wired] = self._world.adc_volts(names, start_s, interval_s, n)
        if self.faults.size("overload", now_s) is not None:
            volts[:, 0] = math.inf
        return np.where(np.abs(volts) > BEYOND * self._range_v, np.copysign(OVERLOAD_V, volts), volts)

    def _fail(self, code: int) -> None:
        self._errors.append(code if len(self._errors) < MOST_ERRORS - 1 else -350)
        while len(self._errors) > MOST_ERRORS:
            self._errors.pop()

    def _error(self) -> str:
        code = self._errors.popleft() if self._errors else 0
        return f'{code:+d},"{TEXTS.get(code, "Device error") if code else "No error"}"'


def _numbers_text(values: Sequence[float] | NDArray[np.float64]) -> str:
    return ",".join(f"{value:+.9E}" for value in values)


def _port(listen: str, scanner: Scanner) -> Port:
    port = Port(listen)

    def answer(connection: Connection, now_s: float) -> None:
        while (end := connection.inbox.find(b"\n") + 1) > 0:
            command = connection.inbox[:end].decode("latin-1")
            del connection.inbox[:end]
            if (text := scanner.answer(command, now_s)) is not None:
                data = text.encode("ascii") + b"\n"
                connection.send(data, now_s + THINKING_S + port.timing.line_s(len(data)))

    port.answer = answer
    return port


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """One instrument: role -> (unit id, which it has not, settings). Its channels are the world's inputs."""
    ((role, (_, settings)),) = roles.items()
    scanner = Scanner(world, settings)
    port = _port(listen, scanner)
    return Server([port], {role: scanner}, {role: Address(port.url)})
