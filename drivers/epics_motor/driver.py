"""Any motor record of EPICS as a rotary stage: the rig turns the motor of an IOC.

The driver writes the fields VAL, VELO, ACCL, STOP, and HOMF or HOMR if the bench file asks for homing; no others. It
moves a motor only if the record is in the mode Go, and VAL moves it (SET is Use) and does not redefine its position.
Limits are checked before anything is written: those of the bench file, and the record's own. Arrival is measured.

Source: EPICS motor record documentation (epics-modules/motor), field descriptions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from drivers.epics_motor import fields as mr
from drivers.epics_motor.fields import Settings
from drivers.errors import Interlocked, LimitError, NotSettled, StageAlarm, StageLost
from drivers.instrument import Check, Identity
from drivers.motor_stage import LEAD_S, MotorStage, Turn
from drivers.transport import Address, Links
from drivers.transport.channel_access import FieldReading, Records

__all__ = ["MotorRecord", "Settings", "connect"]

POLL_S = 0.05
BEGIN_S = 1.0  # until DMOV shows a move that was asked for
PATIENCE_S = 10.0  # beyond the expected end of a move: an IOC polls its controller, and may retry
STOPPING_S = 10.0
HOMING_S = 300.0
LATE_S = 0.5  # of the position that a record shows in a turn
OFF_RATE = 0.02
WATCH_S = 1.0
CLOSE = 1e-6  # relative, of speeds that are equal
STATE = (mr.READBACK, mr.DONE, mr.STATUS, mr.MODE, mr.SET, mr.HIGH_SWITCH, mr.LOW_SWITCH)


class MotorRecord(MotorStage):
    """A motor record as a stage."""

    settings: Settings

    def __init__(self, records: Records, links: Links, settings: Settings, name: str) -> None:
        """Raises LinkRefused for a missing record, LimitError if its units are not those of an angle."""
        self.name, self.settings = name, settings
        self._records, self._clock = records, links.clock
        self._expected_end_s = 0.0
        self._deg = 1.0
        self._records.read(*mr.FIELDS)
        self._deg = self._deg_per_unit()

    def identify(self) -> Identity:
        """The name of the record: it has no field for the maker of the motor."""
        self._records.read(mr.READBACK)
        return Identity(f"EPICS motor {self._records.beginning}")

    def self_test(self) -> list[Check]:
        """Alarm, mode, limits and position."""
        state = self._read(*STATE, mr.LOW_LIMIT, mr.HIGH_LIMIT)
        try:
            self._require_no_alarm(state)
            alarm = Check("alarm", True, "none")
        except StageAlarm as error:
            alarm = Check("alarm", False, error.what)
        mode, use = mr.MODES[int(state[mr.MODE].value)], not state[mr.SET].value
        low, high = self._record_limits_deg(state)
        limits_text = f"{low:g} .. {high:g} deg" if math.isfinite(high) else "none"
        return [
            alarm,
            Check("mode", mode == "Go" and use, f"{mode}, {'Use' if use else 'Set'}"),
            Check("limits of the record", True, limits_text),
            Check("position", True, f"{self._angle_deg(state):.4f} deg"),
        ]

    def angle_deg(self) -> float:
        """The readback position, deg."""
        return self._angle_deg(self._read(mr.READBACK))

    def referenced(self) -> bool:
        """Whether the zero of the angle is known. Without `home` in the bench file, the zero of the IOC is used."""
        (status,) = self._records.read(mr.STATUS)
        return self.settings.home == "none" or bool(int(status.value) & mr.HOMED)

    def home(self) -> None:
        """Seek the zero of the angle. Raises StageAlarm, StageLost, NotSettled."""
        self._require_movable(self._read(*STATE))
        self._target_deg = math.nan
        if self.settings.home == "none":
            return
        self._records.written(mr.HOME[self.settings.home], 1.0)
        self._wait_until_done(HOMING_S, "did not find its home position")
        if not self.referenced():
            raise StageLost(
                f"{self.name}: has sought its home and is not homed (MSTA)",
                "Check the home switch and `home` in the bench file, then resume the run",
            )

    def wait(self) -> None:
        """Wait until the started move has ended at its target. Raises StageAlarm, NotSettled."""
        if math.isnan(self._target_deg):
            return
        begun_s = self._clock.now()
        self._clock.sleep(self._expected_end_s - begun_s)
        state = self._wait_until_done(PATIENCE_S, "is still moving")
        while not self._is_at_target(state) and self._clock.now() < begun_s + BEGIN_S:
            self._clock.sleep(POLL_S)  # the record may not have begun yet
            state = self._wait_until_done(PATIENCE_S, "is still moving")
        self._require_movable(state)
        self._require_at_target(state, "Remove what blocks the stage, check the load's balance, then resume the run")

    def require_steady(self) -> None:
        """Compare the record with the last command; a stage without one passes. Raises StageAlarm, NotSettled."""
        state = self._read(*STATE, mr.TARGET)
        self._require_movable(state)
        if not state[mr.DONE].value:
            raise NotSettled(
                f"{self.name}: moved although no move was commanded",
                "Find out what moves it: another client, a hand; then resume the run",
            )
        if not math.isnan(self._target_deg):
            self._require_at_target(
                state, "Find out what moves it: another client, a hand; `rig resume` measures this pose again"
            )

    def look(self) -> None:
        """Check the stage while the program waits for another one. Raises StageAlarm, Interlocked."""
        self._require_no_alarm(state := self._read(*STATE))
        self._require_mode(state)

    def halt(self) -> None:
        """Start braking and return at once. `stop` must follow."""
        self._target_deg = math.nan
        self._records.write(mr.STOP, 1.0)

    def stop(self) -> None:
        """Brake, and wait for the standstill. A stage with an alarm counts as stopped if it does not move."""
        self.halt()
        deadline = self._clock.now() + STOPPING_S
        while not self._read(mr.DONE)[mr.DONE].value:
            if self._clock.now() > deadline:
                raise NotSettled(f"{self.name}: has not stopped (DMOV is 0)", "Switch off its power")
            self._clock.sleep(POLL_S)

    def _start(self, angle_deg: float, speed_deg_s: float) -> float | None:
        state = self._read(*STATE, mr.TARGET, mr.LOW_LIMIT, mr.HIGH_LIMIT, mr.SPEED, mr.ACCELERATION_TIME)
        self._require_movable(state)
        low, high = self._record_limits_deg(state)
        if not low <= angle_deg <= high:
            raise LimitError(
                f"{self.name}: {angle_deg:g} deg is outside the record's own limits, {low:g} .. {high:g} deg "
                "(LLM, HLM); nothing was sent",
                "Ask for an angle within them, or let the IOC's manager change LLM and HLM after checking the cables",
            )
        distance_deg = abs(angle_deg - self._angle_deg(state))
        self._target_deg, self._expected_end_s = angle_deg, self._clock.now()
        if state[mr.TARGET].value == angle_deg / self._deg and self._is_at_target(state):
            return None
        ramp_s = speed_deg_s / self.settings.acceleration_deg_s2
        self._set(state, mr.SPEED, abs(speed_deg_s / self._deg))
        self._set(state, mr.ACCELERATION_TIME, ramp_s)
        self._records.written(mr.TARGET, angle_deg / self._deg)
        begun_s, self._expected_end_s = self._expected_end_s, self._expected_end_s + distance_deg / speed_deg_s + ramp_s
        return begun_s

    def _begin_turn(self, rate_deg_s: float, start_deg: float, end_deg: float) -> Turn:
        self._start(end_deg, abs(rate_deg_s))
        ramp_s = abs(rate_deg_s) / self.settings.acceleration_deg_s2
        self._clock.sleep(ramp_s + LEAD_S)
        at_s, at_deg = self._clock.now(), start_deg + rate_deg_s * (ramp_s / 2 + LEAD_S)
        return Turn(rate_deg_s, WATCH_S, lambda: self._require_turning(rate_deg_s, at_deg, at_s))

    def _set(self, state: Mapping[str, FieldReading], field: str, value: float) -> None:
        """Write a field if its value differs, and read it back, because the record has its own limits."""
        if math.isclose(state[field].value, value, rel_tol=CLOSE):
            return
        if not math.isclose(read_back := self._records.written(field, value), value, rel_tol=CLOSE):
            raise Interlocked(
                f"{self.name}: the record has not accepted {value:g} in {field.strip('.')}; it is {read_back:g}",
                "Compare speed_deg_s and acceleration_deg_s2 in the bench file with the record's VBAS and VMAX",
            )

    def _wait_until_done(self, timeout_s: float, failure: str) -> dict[str, FieldReading]:
        """Wait until DMOV is 1, and return the state. Raises StageAlarm; NotSettled after the time."""
        deadline = self._clock.now() + timeout_s
        while not (state := self._read(*STATE))[mr.DONE].value:
            self._require_no_alarm(state)
            if self._clock.now() > deadline:
                raise NotSettled(
                    f"{self.name}: {failure} {timeout_s:.0f} s after the end was due (DMOV is 0)",
                    "Remove what blocks the stage; compare speed_deg_s in the bench file with the motor's",
                )
            self._clock.sleep(POLL_S)
        return state

    def _read(self, *names: str) -> dict[str, FieldReading]:
        return dict(zip(names, self._records.read(*names), strict=True))

    def _angle_deg(self, state: Mapping[str, FieldReading]) -> float:
        return state[mr.READBACK].value * self._deg

    def _record_limits_deg(self, state: Mapping[str, FieldReading]) -> tuple[float, float]:
        """The record's limits; none where both are equal."""
        low, high = sorted(state[limit].value * self._deg for limit in (mr.LOW_LIMIT, mr.HIGH_LIMIT))
        return (low, high) if low < high else (-math.inf, math.inf)

    def _is_at_target(self, state: Mapping[str, FieldReading]) -> bool:
        settled = abs(self._angle_deg(state) - self._target_deg) <= self.settings.settle_deg
        return bool(state[mr.DONE].value) and settled

    def _require_at_target(self, state: Mapping[str, FieldReading], remedy: str) -> None:
        """Raises NotSettled where the readback is not at the target of the last move."""
        if self._is_at_target(state):
            return
        cause = " (its own limits have stopped it, LVIO)" if self._records.read(mr.LIMIT_VIOLATION)[0].value else ""
        raise self._away_from_target(self._angle_deg(state), remedy, cause)

    def _require_movable(self, state: Mapping[str, FieldReading]) -> None:
        self._require_no_alarm(state)
        self._require_mode(state)

    def _require_mode(self, state: Mapping[str, FieldReading]) -> None:
        """Raises Interlocked for a record that does not move its motor."""
        if (mode := int(state[mr.MODE].value)) != mr.GO:
            raise Interlocked(
                f"{self.name}: the record is in the mode {mr.MODES[mode]} (SPMG), and does not move",
                "Find out who has stopped it; when nobody is near the rig, set SPMG to Go, then resume the run",
            )
        if state[mr.SET].value:
            raise Interlocked(
                f"{self.name}: the record is in the mode Set (SET): a target would redefine its position",
                "Set it to Use, then resume the run",
            )

    def _require_no_alarm(self, state: Mapping[str, FieldReading]) -> None:
        """Raises StageAlarm for an alarm of the record, or a fault in its status word."""
        status = int(state[mr.STATUS].value)
        for mask, (fault, remedy) in mr.FAULTY.items():
            if status & mask:
                raise StageAlarm(
                    f"{self.name}: {fault} (MSTA is {status:#x})", f"{remedy}; then resume the run", status
                )
        for switch in (mr.HIGH_SWITCH, mr.LOW_SWITCH):
            if state[switch].value:
                raise StageAlarm(
                    f"{self.name}: is at its {'high' if switch == mr.HIGH_SWITCH else 'low'} limit switch "
                    f"({switch.strip('.')})",
                    "Move it away from the switch, and check limits_deg in the bench file",
                    status,
                )
        if (reading := state[mr.READBACK]).is_worse_than(self.settings.highest_severity):
            raise StageAlarm(
                f"{self.name}: {self._records.beginning} has the alarm {reading.alarm}",
                "Find its cause in the IOC; set highest_severity in the bench file if the rig shall go on with it",
                status,
            )

    def _require_turning(self, rate_deg_s: float, at_deg: float, at_s: float) -> None:
        """Raises NotSettled if the readback is off the path of a turn that was at `at_deg` at `at_s`."""
        self._require_movable(state := self._read(*STATE))
        travelled_deg = rate_deg_s * (self._clock.now() - at_s)
        off_deg = self._angle_deg(state) - (at_deg + travelled_deg)
        allowed_deg = LATE_S * abs(rate_deg_s) + OFF_RATE * abs(travelled_deg) + self.settings.settle_deg
        if abs(off_deg) > allowed_deg:
            raise NotSettled(
                f"{self.name}: is {off_deg:+.3f} deg from where a turn at {rate_deg_s:g} deg/s should be",
                "Remove what blocks the stage; compare acceleration_deg_s2 in the bench file with the motor's",
            )

    def _deg_per_unit(self) -> float:
        if self.settings.deg_per_unit is not None:
            return self.settings.deg_per_unit
        units = self._records.units(mr.TARGET)
        if units.lower() not in mr.UNITS_DEG:
            raise LimitError(
                f"{self.name}: the units of {self._records.beginning} are {units!r} (EGU), which is not an angle",
                "Name a rotary motor in the bench file, or set deg_per_unit there",
            )
        return mr.UNITS_DEG[units.lower()]


def connect(address: Address, links: Links, settings: Settings, name: str) -> MotorRecord:
    """The motor record at `address`, ca:NAME or ca://host:port/NAME. Raises LinkRefused; writes nothing."""
    return MotorRecord(links.records(address, name, "", settings.timeout_s), links, settings, name)
