"""The simulated E-727's axes: servo, moves, travel. The plan is the controller's, the motion the world's."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from drivers.pi_e727 import parameters as e727
from drivers.transport.faults import Faults
from drivers.transport.gcs_server import OUT_OF_RANGE, Refusal, groups, number, one_of, parse_integer, table
from drivers.world.kernel import Floats
from drivers.world.positioner import Command, hold_command

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

TRAVEL_UM = (0.0, 100.0)  # of the P-611.3S in closed loop
CYCLE_S = 50e-6  # of the servo
VELOCITY_UM_S = 1000.0  # of the command's ramp to a new place [M]

Handler = Callable[[Sequence[str], float], str | None]


class Axes:
    """Axes by the controller's identifier. They wake with the servo off, wherever they are."""

    def __init__(self, world: AnyWorld, names: Mapping[str, str]) -> None:
        self.faults = Faults()
        self._world = world
        self._names = {axis: name for name, axis in names.items()}
        self.ids = list(self._names)
        self._commands = {axis: hold_command(float(self.measured_um(axis, 0.0)[0])) for axis in self.ids}
        self._settled_s = dict.fromkeys(self.ids, 0.0)
        self._servo = dict.fromkeys(self.ids, False)
        self._velocity_um_s = dict.fromkeys(self.ids, VELOCITY_UM_S)

    def handlers(self) -> dict[str, Handler]:
        return {
            "SVO": self._set_servo,
            "SVO?": lambda a, _: table((axis, int(self._servo[axis])) for axis in self.asked(a)),
            "VEL": self._set_velocity,
            "VEL?": lambda a, _: table((axis, f"{self._velocity_um_s[axis]:.6f}") for axis in self.asked(a)),
            "MOV?": lambda a, now_s: table((axis, f"{self.commanded_um(axis, now_s):.6f}") for axis in self.asked(a)),
            "POS?": lambda a, now_s: table((axis, f"{self.shown_um(axis, now_s):.6f}") for axis in self.asked(a)),
            "ONT?": lambda a, now_s: table((axis, int(self._is_on_target(axis, now_s))) for axis in self.asked(a)),
            "TMN?": lambda a, _: table((axis, f"{TRAVEL_UM[0]:.6f}") for axis in self.asked(a)),
            "TMX?": lambda a, _: table((axis, f"{TRAVEL_UM[1]:.6f}") for axis in self.asked(a)),
        }

    def state(self) -> dict[str, Any]:
        return {
            "commands": {axis: asdict(command) for axis, command in self._commands.items()},
            "settled_s": dict(self._settled_s),
            "servo": dict(self._servo),
            "velocity_um_s": dict(self._velocity_um_s),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        self._commands = {axis: Command(**command) for axis, command in state["commands"].items()}
        self._settled_s, self._servo = dict(state["settled_s"]), dict(state["servo"])
        self._velocity_um_s = dict(state["velocity_um_s"])

    def asked(self, arguments: Sequence[str]) -> list[str]:
        """The axes in a query; all axes without a name."""
        return [one_of(axis, self.ids, e727.BAD_AXIS) for axis in arguments] or self.ids

    def targets(self, arguments: Sequence[str]) -> dict[str, float]:
        """Targets by axis. Nothing moves unless all are within their limits."""
        positions = {one_of(axis, self.ids, e727.BAD_AXIS): number(text) for axis, text in groups(arguments, 2)}
        for axis, um in positions.items():
            self.require(axis, um, um)
        return positions

    def require(self, axis: str, low_um: float, high_um: float) -> None:
        """Refuse a motion between two places, unless the servo is on and both are within the travel."""
        if not self._servo[axis]:
            raise Refusal(e727.NOT_REFERENCED)
        if not TRAVEL_UM[0] <= low_um <= high_um <= TRAVEL_UM[1]:
            raise Refusal(e727.OUTSIDE)

    def go(self, axis: str, um: float, now_s: float) -> None:
        """Ramp the command from where it is to `um`."""
        if self.faults.size("stuck", now_s) is not None:
            return
        present_um, velocity = self.commanded_um(axis, now_s), self._velocity_um_s[axis]
        rate = velocity if um > present_um else -velocity
        self.follow(axis, Command(now_s, present_um, rate, end_s=now_s + (um - present_um) / rate), now_s)

    def follow(self, axis: str, command: Command, now_s: float) -> None:
        """Hand a command to the world."""
        self._world.advance(now_s)
        self._commands[axis] = command
        self._settled_s[axis] = self._world.move_positioner(self._names[axis], command)

    def halt(self, axis: str, now_s: float) -> None:
        """Command the place where the axis is now."""
        self.follow(axis, hold_command(float(self.measured_um(axis, now_s)[0]), now_s), now_s)

    def restart(self, at_s: float) -> None:
        """Servo off, and every axis where it is. The world's time is not touched: the converter may be sampling."""
        self._servo, self._velocity_um_s = dict.fromkeys(self.ids, False), dict.fromkeys(self.ids, VELOCITY_UM_S)
        for axis, name in self._names.items():
            self._commands[axis] = hold_command(float(self.measured_um(axis, at_s)[0]), at_s)
            self._settled_s[axis] = self._world.move_positioner(name, self._commands[axis])

    def commanded_um(self, axis: str, t_s: float) -> float:
        return self._commands[axis].um(t_s)

    def measured_um(self, axis: str, times_s: ArrayLike) -> Floats:
        return self._world.positioner_um(self._names[axis], times_s)

    def moving(self, axis: str, now_s: float) -> bool:
        """Whether an axis has not settled yet."""
        return now_s < self._settled_s[axis] or self.faults.size("busy", now_s) is not None

    def shown_um(self, axis: str, now_s: float) -> float:
        """The position that the controller reports."""
        return float(self.measured_um(axis, now_s)[0]) + (self.faults.size("lies", now_s) or 0.0)

    def _is_on_target(self, axis: str, now_s: float) -> bool:
        return self._servo[axis] and not self.moving(axis, now_s)

    def _set_servo(self, arguments: Sequence[str], now_s: float) -> None:
        states = {one_of(axis, self.ids, e727.BAD_AXIS): parse_integer(on, 0, 1) for axis, on in groups(arguments, 2)}
        for axis, on in states.items():
            if bool(on) != self._servo[axis]:
                self._servo[axis] = bool(on)
                self.halt(axis, now_s)

    def _set_velocity(self, arguments: Sequence[str], _now_s: float) -> None:
        values = {one_of(axis, self.ids, e727.BAD_AXIS): number(text) for axis, text in groups(arguments, 2)}
        if not all(0 < value < math.inf for value in values.values()):
            raise Refusal(OUT_OF_RANGE)
        self._velocity_um_s.update(values)
