"""The simulated CN7500: a set point and a run bit for the world's oven, and its thermocouple."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from drivers.omega_cn7500.driver import CONTROL_METHOD, PROCESS_VALUE, RUN_BIT, SET_POINT, Settings
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.modbus_server import ILLEGAL_ADDRESS, MODBUS_FAULTS, Refusal, modbus_port
from drivers.transport.server import Server, Twin

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

LISTEN = "pty:?baud=9600"
FAULTS = {
    **MODBUS_FAULTS,
    "lies": Kind("reports this much more", 100.0, "K"),
    "stale": Kind("reports and controls with an old temperature"),
    "no-temperature": Kind("reports a fault code instead of a temperature", 0x8003),
    "runaway": Kind("heats with full power while it is on"),
    "restart": Kind("loses power for a moment: off, with its first set point, once"),
}
POWER_ON_STATE = (25.0, False)
FULL_C = 1000.0  # a set point that takes all power
THINKING_S = 0.005


class Controller(Twin):
    """One unit. Wakes stopped, with a set point of 25 C."""

    functions = frozenset({2, 3, 5, 6})
    thinking_s = THINKING_S

    def __init__(self, world: AnyWorld) -> None:
        self.faults = Faults()
        self._world = world
        self._set_point_c, self._running = POWER_ON_STATE

    def advance(self, now_s: float) -> None:
        """Apply faults. The oven is part of the world, and registers change by commands only."""
        if self.faults.once("restart", now_s):
            self._set_point_c, self._running = POWER_ON_STATE
        if self.faults:
            self._world.oven_set(self._goal_c(now_s), self._running)

    def state(self) -> dict[str, Any]:
        return {"set_point_c": self._set_point_c, "running": self._running}

    def restore(self, state: Mapping[str, Any]) -> None:
        self._set_point_c, self._running = state["set_point_c"], state["running"]

    def read_bits(self, address: int, count: int) -> Sequence[bool]:
        if (address, count) != (RUN_BIT, 1):
            raise Refusal(ILLEGAL_ADDRESS)
        return [self._running]

    def write_bit(self, address: int, on: bool, now_s: float) -> None:
        if address != RUN_BIT:
            raise Refusal(ILLEGAL_ADDRESS)
        self._control(self._set_point_c, on, now_s)

    def read_words(self, address: int, count: int, now_s: float) -> list[int]:
        self._world.advance(now_s)
        words = {
            PROCESS_VALUE.address: self._displayed_words(now_s),
            SET_POINT.address: SET_POINT.encode(self._set_point_c),
            CONTROL_METHOD.address: [0],
        }
        addresses = range(address, address + count)
        if not set(addresses) <= set(words):
            raise Refusal(ILLEGAL_ADDRESS)
        return [words[a][0] for a in addresses]

    def write_words(self, address: int, values: Sequence[int], now_s: float) -> None:
        if address == SET_POINT.address:
            self._control(SET_POINT.decode(values), self._running, now_s)
        elif (address, values[0]) != (CONTROL_METHOD.address, 0):
            raise Refusal(ILLEGAL_ADDRESS)

    def _control(self, set_point_c: float, running: bool, now_s: float) -> None:
        self._set_point_c, self._running = set_point_c, running
        self._world.advance(now_s)
        self._world.oven_set(self._goal_c(now_s), running)

    def _displayed_words(self, now_s: float) -> list[int]:
        if (code := self.faults.size("no-temperature", now_s)) is not None:
            return [int(code)]
        return PROCESS_VALUE.encode(self._temperature_c(now_s) + (self.faults.size("lies", now_s) or 0.0))

    def _temperature_c(self, now_s: float) -> float:
        """The temperature that the controller measures."""
        return float(self.faults.held("stale", now_s, self._world.thermometer_c()))

    def _goal_c(self, now_s: float) -> float:
        """The temperature that the heater works towards: without a fault the set point."""
        if self.faults.size("runaway", now_s) is not None:
            return FULL_C
        if self.faults.size("stale", now_s) is not None:
            return math.copysign(FULL_C, self._set_point_c - self._temperature_c(now_s))
        return self._set_point_c


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """One bus with a controller for each role: role -> (unit id, settings)."""
    controllers = {role: Controller(world) for role in roles}
    port = modbus_port(listen, {roles[role][0]: controller for role, controller in controllers.items()})
    return Server([port], controllers, {role: Address(port.url, unit) for role, (unit, _) in roles.items()})
