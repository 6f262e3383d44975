"""The simulated AZ drives of one bus. Speed and acceleration are the drive's, the mechanics the world's."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from drivers.oriental_az import registers as az
from drivers.oriental_az.driver import Settings
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.modbus import Register
from drivers.transport.modbus_server import MODBUS_FAULTS, modbus_port
from drivers.transport.server import Server, Twin
from drivers.world.stage import Trajectory, at_rest

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

LISTEN = "pty:"
HOMING_DEG_S = 20.0
HOMING_DEG_S2 = 40.0
IN_POSITION_DEG = 0.018  # the width of IN-POS around the command, +-
ENDLESS_DEG = 1e7  # days at any speed
THINKING_S = 0.003  # transmission waiting time of the drive
FAULTS = {
    **MODBUS_FAULTS,
    "alarm": Kind("stops with the alarm of this code, once", 0x30),
    "restart": Kind("loses power for a moment: stops and loses its position, once"),
    "stuck": Kind("does not turn, and reports that it is in position"),
    "e-stop": Kind("its stop input is on: it brakes and does not start"),
    "busy": Kind("always reports that it is moving"),
    "lies": Kind("reports a position with this error", 1.0, "deg"),
}
TRIGGERS = dict(zip(range(-7, 0), (r.address for r in az.DIRECT[:-1]), strict=True))  # trigger -> starting item


class Drive(Twin):
    """One unit of the bus, turning the world's `axis`. Wakes without coordinates: it must be homed."""

    functions = frozenset({3, 6, 16, 23})
    thinking_s = THINKING_S

    def __init__(self, world: AnyWorld, axis: str, settings: Settings) -> None:
        self.faults = Faults()
        self._world, self._axis = world, axis
        self._steps_per_deg = settings.steps_per_turn / 360
        self._plan = at_rest(world.motor_angle_deg(axis))
        self._words: dict[int, int] = {}
        self._alarm = 0
        self._referenced = self._homing = self._was_limited = False
        self._timeout = settings.communication_timeout
        self._heard_s = 0.0

    def advance(self, now_s: float) -> None:
        """Apply faults. Between exchanges a drive only follows its plan.

        The world's time is not touched: the converter may still be sampling.
        """
        timeout_s = self._value(self._timeout)
        if timeout_s and now_s > self._heard_s + timeout_s and not self._alarm:
            self._fail(az.COMMUNICATION_TIMEOUT, self._heard_s + timeout_s)
        if self._was_limited and now_s >= self._plan.end_s:
            self._fail(az.SOFTWARE_OVERTRAVEL, self._plan.end_s)
        if strike := self.faults.once("e-stop", now_s):
            self._follow(self._plan.stopped(max(strike.at_s, self._plan.start_s)))
        if strike := self.faults.once("alarm", now_s):
            self._fail(int(strike.size), strike.at_s)
        if strike := self.faults.once("restart", now_s):
            self._fail(0, strike.at_s)
            self._referenced = self._homing = False
            self._words.clear()

    def state(self) -> dict[str, Any]:
        return {
            "plan": asdict(self._plan),
            "referenced": self._referenced,
            "homing": self._homing,
            "beyond": self._was_limited,
            "heard_s": self._heard_s,
            "words": [[address, word] for address, word in self._words.items()],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from `state`, without the alarm: a person has reset it before the run continues."""
        self._plan = Trajectory(**state["plan"])
        self._alarm, self._referenced, self._homing = 0, state["referenced"], state["homing"]
        self._was_limited = state.get("beyond", False)  # states of before there were limits
        self._heard_s, self._words = state["heard_s"], dict(state["words"])

    def read_words(self, address: int, count: int, now_s: float) -> list[int]:
        self._catch_up(now_s)
        monitors = self._monitors(now_s)
        return [monitors.get(a, self._words.get(a, 0)) for a in range(address, address + count)]

    def write_words(self, address: int, values: Sequence[int], now_s: float) -> None:
        self._catch_up(now_s)
        inputs_before = self._words.get(az.INPUTS.address, 0)
        addresses = range(address, address + len(values))
        self._words.update(zip(addresses, values, strict=True))
        if az.INPUTS.address in addresses:
            self._inputs(self._words[az.INPUTS.address] & ~inputs_before, now_s)
        if az.RESET_ALARM.address in addresses and self._value(az.RESET_ALARM) == 1:
            self._reset()
        if self._has_trigger(addresses):
            self._start(now_s)

    def _catch_up(self, now_s: float) -> None:
        """Bring the world here; a homing that has run to its end sets the coordinates."""
        self.advance(now_s)
        self._heard_s = now_s
        self._world.advance(now_s)
        if self._homing and now_s >= self._plan.end_s:
            self._homing, self._referenced = False, self._plan.stop_s is None

    def _value(self, register: Register) -> float:
        return register.decode([self._words.get(register.address + i, 0) for i in range(register.count)])

    def _monitors(self, now_s: float) -> dict[int, int]:
        """The words that the drive itself sets, by address."""
        values = {
            az.OUTPUTS: self._outputs(now_s),
            az.ALARM: self._alarm,
            az.COMMAND_POSITION: self._plan.angle_deg(now_s) * self._steps_per_deg,
            az.FEEDBACK_POSITION: (self._angle_deg() + (self.faults.size("lies", now_s) or 0.0)) * self._steps_per_deg,
            az.FEEDBACK_SPEED: self._plan.rate_deg_s(now_s) * self._steps_per_deg,
            az.DRIVER_TEMPERATURE: 35.0,
            az.MOTOR_TEMPERATURE: 40.0,
        }
        return {r.address + i: word for r, value in values.items() for i, word in enumerate(r.encode(value))}

    def _outputs(self, now_s: float) -> int:
        is_moving = now_s < self._plan.end_s or self.faults.size("busy", now_s) is not None
        in_position = abs(self._world.motor_angle_deg(self._axis) - self._plan.angle_deg(now_s)) <= IN_POSITION_DEG
        return (
            az.HOME_END * self._referenced
            | az.READY * (not is_moving and not self._alarm and not self._is_stop_on(now_s))
            | az.ALARM_ON * (self._alarm != 0)
            | az.MOVE * is_moving
            | az.IN_POSITION * (in_position and not is_moving)
        )

    def _inputs(self, rising: int, now_s: float) -> None:
        if rising & az.STOP:
            self._follow(self._plan.stopped(now_s))
        elif rising & az.ZHOME and not self._alarm and not self._is_stop_on(now_s):
            self._homing, self._referenced = True, False
            self._turn(Trajectory(now_s, self._angle_deg(), 0.0, HOMING_DEG_S, HOMING_DEG_S2))
        elif rising & az.ALARM_RESET:
            self._reset()

    def _reset(self) -> None:
        if self._alarm not in az.RESETTABLE_BY_POWER_ONLY:
            self._alarm = 0

    def _has_trigger(self, addresses: range) -> bool:
        trigger = int(self._value(az.TRIGGER))
        if trigger == az.TRIGGER_ALL:
            return az.TRIGGER.address in addresses
        return TRIGGERS.get(trigger) in addresses

    def _start(self, now_s: float) -> None:
        """Begin the move of the direct data. A move that is not allowed sets the drive's alarm."""
        if self._alarm or self._is_stop_on(now_s) or self._words.get(az.INPUTS.address, 0) & az.STOP:
            return
        kind = int(self._value(az.TYPE))
        speed, rate = (self._value(r) / self._steps_per_deg for r in (az.SPEED, az.ACCELERATION))
        origins: dict[int, Callable[[], float]] = {
            az.ABSOLUTE: lambda: 0.0,
            az.FROM_COMMAND: lambda: self._plan.angle_deg(now_s),
            az.FROM_FEEDBACK: self._angle_deg,
        }
        if kind == az.CONTINUOUS and speed != 0 and rate > 0:
            target_deg = self._angle_deg() + math.copysign(ENDLESS_DEG, speed)
            self._turn(Trajectory(now_s, self._angle_deg(), target_deg, abs(speed), rate))
        elif kind not in origins or speed <= 0 or rate <= 0:
            self._fail(az.BAD_OPERATION_DATA, now_s)
        elif kind == az.ABSOLUTE and not self._referenced:
            self._fail(az.COORDINATES_NOT_SET, now_s)
        else:
            target = origins[kind]() + self._value(az.POSITION) / self._steps_per_deg
            limited_deg = self._limit_deg(target)
            self._turn(Trajectory(now_s, self._angle_deg(), limited_deg, speed, rate))
            self._was_limited = limited_deg != target

    def _limit_deg(self, target_deg: float) -> float:
        """The target, or the drive's limit before it. Limits apply after coordinates and an action are set."""
        if not self._referenced or self._value(az.OVERTRAVEL) != az.BRAKE_AND_ALARM:
            return target_deg
        low, high = (self._value(limit) / self._steps_per_deg for limit in (az.LOW_LIMIT, az.HIGH_LIMIT))
        return min(max(target_deg, low), high)

    def _is_stop_on(self, now_s: float) -> bool:
        """Whether the stop input is on."""
        return self.faults.size("e-stop", now_s) is not None

    def _fail(self, code: int, at_s: float) -> None:
        self._alarm = code
        self._follow(self._plan.stopped(max(at_s, self._plan.start_s)))

    def _turn(self, trajectory: Trajectory) -> None:
        if self.faults.size("stuck", trajectory.start_s) is None:
            self._follow(trajectory)

    def _follow(self, plan: Trajectory) -> None:
        self._plan, self._was_limited = plan, False
        self._world.move_stage(self._axis, plan)

    def _angle_deg(self) -> float:
        return self._world.motor_angle_deg(self._axis)


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """One bus with a drive for each role: role -> (unit id, settings). The role is the world's axis."""
    drives = {role: Drive(world, role, settings) for role, (_, settings) in roles.items()}
    port = modbus_port(listen, {roles[role][0]: drive for role, drive in drives.items()})
    return Server([port], drives, {role: Address(port.url, unit) for role, (unit, _) in roles.items()})
