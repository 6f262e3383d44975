"""The simulated CN7500: a set point and a run bit for the world's oven, and its thermocouple."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from drivers.links.address import Address
from drivers.links.modbus_server import ILLEGAL_ADDRESS, Refusal, modbus_port
from drivers.links.server import Server
from drivers.omega_cn7500 import CONTROL_METHOD, PROCESS_VALUE, RUN_BIT, SET_POINT, Settings

LISTEN = "pty:?baud=9600"
THINKING_S = 0.005


class World(Protocol):
    """What a temperature controller knows of physics."""

    def advance(self, t_s: float) -> None: ...

    def oven_set(self, set_point_c: float, running: bool) -> None: ...

    def thermometer_c(self) -> float: ...


class Controller:
    """One unit. Wakes stopped, with a set point of 25 C."""

    functions = frozenset({2, 3, 5, 6})
    thinking_s = THINKING_S

    def __init__(self, world: World) -> None:
        self._world = world
        self._set_point_c, self._running = 25.0, False

    def advance(self, now_s: float) -> None:
        """The oven is the world's; the controller's registers do not change by themselves."""

    def due_s(self) -> float:
        return math.inf

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
            PROCESS_VALUE.address: PROCESS_VALUE.encode(self._world.thermometer_c()),
            SET_POINT.address: SET_POINT.encode(self._set_point_c),
            CONTROL_METHOD.address: [0],
        }
        wanted = range(address, address + count)
        if not set(wanted) <= set(words):
            raise Refusal(ILLEGAL_ADDRESS)
        return [words[a][0] for a in wanted]

    def write_words(self, address: int, values: Sequence[int], now_s: float) -> None:
        if address == SET_POINT.address:
            self._control(SET_POINT.decode(values), self._running, now_s)
        elif (address, values[0]) != (CONTROL_METHOD.address, 0):
            raise Refusal(ILLEGAL_ADDRESS)

    def _control(self, set_point_c: float, running: bool, now_s: float) -> None:
        self._set_point_c, self._running = set_point_c, running
        self._world.advance(now_s)
        self._world.oven_set(set_point_c, running)


def serve(world: World, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """One bus with a controller for each role: role -> (unit id, settings)."""
    controllers = {role: Controller(world) for role in roles}
    port = modbus_port(listen, {roles[role][0]: controller for role, controller in controllers.items()})
    return Server([port], controllers, {role: Address(port.url, unit) for role, (unit, _) in roles.items()})
