"""The simulated IOC with motor records. Speed and acceleration are the record's, the mechanics the world's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from drivers.epics_motor import fields as mr
from drivers.epics_motor.driver import Settings
from drivers.transport.address import Address
from drivers.transport.channel_access_server import Field, records_port
from drivers.transport.faults import Faults, Kind
from drivers.transport.server import Server, Twin
from drivers.world.stage import Trajectory, at_rest

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

__all__ = ["FAULTS", "LISTEN", "serve"]

LISTEN = "tcp://127.0.0.1:0"
BEGINNING = "sim:"
COMM = 9  # EPICS: the status of a record whose device does not answer
HOMING_DEG_S = 20.0
FAULTS = {
    "severity": Kind("its record has an alarm of this severity: 1 minor, 2 major, 3 invalid", 3, least=1),
    "status": Kind("its status word (MSTA) has these bits, in addition", mr.PROBLEM, least=1),
    "limit-switch": Kind("its high limit switch is closed: it stops"),
    "stopped": Kind("someone sets SPMG to Stop: it brakes and does not start"),
    "stuck": Kind("does not turn, and reports that the move is done"),
    "busy": Kind("always reports that it is moving"),
}
BRAKES = ("stopped", "limit-switch")


class Motor(Twin):
    """A motor record that turns the world's `axis`; its units are deg."""

    def __init__(self, world: AnyWorld, axis: str, settings: Settings) -> None:
        self.faults = Faults()
        self._world, self._axis, self._name = world, axis, f"{BEGINNING}{axis}"
        low, high = settings.limits_deg
        self._plan = at_rest(world.motor_angle_deg(axis))
        self._homed = False
        self._fields = dict.fromkeys(mr.FIELDS, 0.0) | {
            mr.TARGET: world.motor_angle_deg(axis),
            mr.LOW_LIMIT: low if math.isfinite(low) else 0.0,
            mr.HIGH_LIMIT: high if math.isfinite(high) else 0.0,
            mr.SPEED: 1.0,
            mr.ACCELERATION_TIME: 0.2,
            mr.MODE: float(mr.GO),
        }

    def advance(self, now_s: float) -> None:
        """Brake after a fault. The world's time stays unchanged, because the converter may still be sampling."""
        for fault in BRAKES:
            if strike := self.faults.once(fault, now_s):
                self._brake(max(strike.at_s, self._plan.start_s))

    def state(self) -> dict[str, Any]:
        """The plan of the motion, and the written fields."""
        return {"plan": asdict(self._plan), "own": self._fields, "homed": self._homed}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from `state`."""
        self._plan, self._fields, self._homed = Trajectory(**state["plan"]), dict(state["own"]), state["homed"]

    def has(self, name: str) -> bool:
        return name.startswith(self._name) and self._field(name) in self._fields

    def field(self, name: str, now_s: float) -> Field:
        self.advance(now_s)
        self._world.advance(now_s)
        severity = int(self.faults.size("severity", now_s) or 0)
        return Field(self._value(self._field(name), now_s), now_s, severity, COMM * bool(severity), "deg")

    def put(self, name: str, value: float, now_s: float) -> None:
        field = self._field(name)
        self.advance(now_s)
        self._world.advance(now_s)
        if field == mr.TARGET:
            self._move(value, now_s)
        elif field == mr.STOP and value:
            self._brake(now_s)
        elif field in mr.HOME.values() and value:
            self._homed = True
            self._follow(Trajectory(now_s, self._angle_deg(), 0.0, HOMING_DEG_S, 2 * HOMING_DEG_S))
        elif field in (mr.SPEED, mr.ACCELERATION_TIME):
            self._fields[field] = value

    def _field(self, name: str) -> str:
        return name.removeprefix(self._name) or mr.TARGET

    def _value(self, field: str, now_s: float) -> float:
        is_moving = now_s < self._plan.end_s or self.faults.size("busy", now_s) is not None
        computed = {
            mr.READBACK: self._angle_deg(),
            mr.DONE: float(not is_moving),
            mr.HIGH_SWITCH: float(self.faults.size("limit-switch", now_s) is not None),
            mr.STATUS: float(int(self.faults.size("status", now_s) or 0) | mr.HOMED * (self._homed and not is_moving)),
        }
        if field == mr.MODE and self.faults.size("stopped", now_s) is not None:
            return 0.0
        return computed.get(field, self._fields[field])

    def _move(self, target_deg: float, now_s: float) -> None:
        """Begin a move. A move beyond the limits does not begin, and LVIO is set."""
        low, high = self._fields[mr.LOW_LIMIT], self._fields[mr.HIGH_LIMIT]
        self._fields[mr.LIMIT_VIOLATION] = float(low < high and not low <= target_deg <= high)
        is_blocked = any(self.faults.size(fault, now_s) is not None for fault in BRAKES)
        if self._fields[mr.LIMIT_VIOLATION] or is_blocked:
            return
        self._fields[mr.TARGET] = target_deg
        if self.faults.size("stuck", now_s) is None:
            speed = self._fields[mr.SPEED]
            self._follow(
                Trajectory(now_s, self._angle_deg(), target_deg, speed, speed / self._fields[mr.ACCELERATION_TIME])
            )

    def _brake(self, at_s: float) -> None:
        self._follow(self._plan.stopped(at_s))

    def _follow(self, plan: Trajectory) -> None:
        self._plan = plan
        self._world.move_stage(self._axis, plan)

    def _angle_deg(self) -> float:
        return self._world.motor_angle_deg(self._axis)


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """One IOC with a motor record for each role: role -> (unit id, settings). The role is the world's axis."""
    motors = {role: Motor(world, role, settings) for role, (_, settings) in roles.items()}
    port = records_port(listen, list(motors.values()))
    place = port.url.replace("tcp", "ca", 1)
    addresses = {role: Address(f"{place}/{BEGINNING}{role}", unit, port.url) for role, (unit, _) in roles.items()}
    return Server([port], motors, addresses)
