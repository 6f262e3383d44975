"""The simulated E-727 with a P-611.3S: its commands and its error; the parts behind them have files of their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from drivers.pi_e727 import parameters as e727
from drivers.pi_e727.driver import Settings
from drivers.pi_e727.twin_axes import CYCLE_S, Axes, Handler
from drivers.pi_e727.twin_waves import Recorder, Waves
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.gcs_server import (
    OUT_OF_RANGE,
    UNKNOWN_COMMAND,
    Refusal,
    gcs_port,
    groups,
    lines,
    one_of,
    parse_integer,
)
from drivers.transport.server import Server, Twin

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

LISTEN = "tcp://127.0.0.1:0"
FAULTS = {
    "restart": Kind("loses power for a moment: servo off, waves and recording lost, once"),
    "stuck": Kind("does not move, and reports that it is on target"),
    "busy": Kind("always reports that it is moving"),
    "lies": Kind("reports a position with this error", 1.0, "um"),
    "refuses": Kind("refuses every command with this error", 17),
}
IDENTITY = "(c)2015 Physik Instrumente (PI) GmbH & Co. KG, E-727, 0117055412, 13.21.00.09"
PARAMETERS = {  # identifier: (value, type, name), the same for every axis
    e727.CYCLE_TIME: (f"{CYCLE_S:.8e}", "FLOAT", "Servo Update Time"),
    0x16000200: (str(e727.RECORD_POINTS), "INT", "Maximum Number of Recorder Points"),
    0x16000201: (str(e727.RECORD_POINTS), "INT", "Recorder Points per Table"),
}


class Controller(Twin):
    """One controller. It stores one error and clears it when it is read."""

    def __init__(self, world: AnyWorld, settings: Settings) -> None:
        self._axes = Axes(world, settings.axes)
        self._power_on()

    @property
    def faults(self) -> Faults:
        return self._axes.faults

    @faults.setter
    def faults(self, faults: Faults) -> None:
        self._axes.faults = faults

    def _power_on(self) -> None:
        self._recorder = Recorder(self._axes)
        self._waves = Waves(self._axes, self._recorder)
        self._error = 0
        self._handlers: dict[str, Handler] = {
            **self._axes.handlers(),
            **self._waves.handlers(),
            **self._recorder.handlers(),
            "*IDN?": lambda _a, _: IDENTITY + "\n",
            "CSV?": lambda _a, _: "2.0\n",
            "ERR?": lambda _a, _: self._tell_error(),
            "SAI?": lambda _a, _: lines(self._axes.ids),
            "HLP?": lambda _a, _: lines(["The following commands are valid:", *sorted(self._handlers), "end of help"]),
            "SPA": lambda a, _: self._refuse_parameter(a),
            "SPA?": lambda a, _: self._parameters(a),
            "HPA?": lambda _a, _: lines(_describe_parameters()),
        }

    def answer(self, command: str, now_s: float) -> str | None:
        if command[0] < " ":
            return self._urgent(ord(command[0]), now_s)
        name, *arguments = command.split() or [""]
        try:
            if name.upper() not in self._handlers:
                raise Refusal(UNKNOWN_COMMAND)
            if (code := self.faults.size("refuses", now_s)) is not None and not name.endswith("?"):
                raise Refusal(int(code))
            return self._handlers[name.upper()](arguments, now_s)
        except Refusal as refusal:
            self._error = refusal.code
            return None

    def advance(self, now_s: float) -> None:
        if strike := self.faults.once("restart", now_s):
            self._axes.restart(strike.at_s)
            self._power_on()
        self._recorder.advance(now_s)

    def state(self) -> dict[str, Any]:
        return {
            "error": self._error,
            "axes": self._axes.state(),
            "waves": self._waves.state(),
            "recorder": self._recorder.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        self._error = state["error"]
        self._axes.restore(state["axes"])
        self._waves.restore(state["waves"])
        self._recorder.restore(state["recorder"])

    def _urgent(self, number: int, now_s: float) -> str | None:
        """Act on a command of one byte. Unknown commands are ignored."""
        questions: dict[int, Callable[[], str]] = {
            e727.MOVING: lambda: _hexadecimal(self._axes.moving(axis, now_s) for axis in self._axes.ids),
            e727.READY: lambda: e727.IS_READY,
            e727.WAVES: lambda: _hexadecimal(self._waves.running(now_s)),
        }
        if number == e727.STOP:
            self._stop(now_s)
        return f"{questions[number]()}\n" if number in questions else None

    def _stop(self, now_s: float) -> None:
        self._error = e727.STOPPED
        self._waves.halt(now_s)
        for axis in self._axes.ids:
            if self._axes.moving(axis, now_s):
                self._axes.halt(axis, now_s)

    def _tell_error(self) -> str:
        error, self._error = self._error, 0
        return f"{error}\n"

    def _parameters(self, arguments: Sequence[str]) -> str:
        """`SPA? item identifier ...`; an identifier is answered as it was sent."""
        return lines(f"{item} {text}={PARAMETERS[p][0]}" for item, text, p in self._identify(groups(arguments, 2)))

    def _refuse_parameter(self, arguments: Sequence[str]) -> None:
        """`SPA item identifier value`: none of the simulated parameters can be changed."""
        self._identify(groups(arguments, 3))
        raise Refusal(OUT_OF_RANGE)

    def _identify(self, requests: Sequence[Sequence[str]]) -> list[tuple[str, str, int]]:
        items = {"1", *self._axes.ids}  # the controller itself is item 1, for any names of its axes
        pairs = [(one_of(item, items, e727.BAD_AXIS), text) for item, text, *_ in requests]
        numbered = [(item, text, parse_integer(text, 0, math.inf)) for item, text in pairs]
        if any(parameter not in PARAMETERS for *_, parameter in numbered):
            raise Refusal(e727.UNKNOWN_PARAMETER)
        return numbered


def _describe_parameters() -> Iterable[str]:
    """Lines of HPA?: identifier, command level, number of items, type, group and name of each parameter."""
    return (f"0x{number:X}=\t0\t1\t{kind}\tSystem\t{name}" for number, (_, kind, name) in PARAMETERS.items())


def _hexadecimal(on: Iterable[bool]) -> str:
    """Hexadecimal; the first is the lowest bit."""
    return f"{sum(1 << k for k, flag in enumerate(on) if flag):X}"


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """One controller: role -> (unit id, settings). Its axes' names are the world's."""
    ((role, (unit, settings)),) = roles.items()
    controller = Controller(world, settings)
    port = gcs_port(listen, controller)
    return Server([port], {role: controller}, {role: Address(port.url, unit)})
