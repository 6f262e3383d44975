"""Oriental Motor AZ drive (AZD) turning a hollow rotary stage (DGII), by Modbus RTU.

Safe by design: limits are checked before anything is sent, arrival is measured and not assumed, an alarm
is never cleared silently, and a stop can always be sent. Source: AZ function manual, see `registers`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from drivers.errors import Interlocked, NotSettled, StageAlarm, StageLost
from drivers.instrument import Alarm, Check, Identity
from drivers.motor_stage import LEAD_S, MotorStage, Turn, move_s
from drivers.oriental_az import registers as az
from drivers.oriental_az.registers import Settings
from drivers.transport import Address, Links
from drivers.transport.modbus import Unit

__all__ = ["RotaryStage", "Settings", "connect"]

POLL_S = 0.02
PATIENCE_S = 2.0  # beyond the expected end of a move
HOMING_S = 120.0  # a full turn at a drive's slowest usual homing speed
STOPPING_S = 10.0
READY_S = 0.5  # for a drive to be ready again after a move [M]
BEATS = 4  # in a communication time-out, so that one lost answer is no silence
OFF_RATE = 0.01  # of a constant rate; a step a second of rounding comes on top
UNWATCHED_S = 1.0  # between two looks at a turn of a drive that does not watch over its controller
WARM_C = 85.0  # the drive's own alarm limit [M]


class RotaryStage(MotorStage):
    """A stage on an AZ drive."""

    settings: Settings

    def __init__(self, unit: Unit, links: Links, settings: Settings) -> None:
        self.name = unit.name
        self.settings = settings
        self._unit, self._clock = unit, links.clock
        self._holds_target = False  # no command since power-on, homing or a stop
        self._expected_end_s = 0.0
        self._limited = not settings.own_limits  # whether the drive has its limits, where it is to have them

    def identify(self) -> Identity:
        """A general name, after an exchange: the drive has no register with its name."""
        self._unit.read(az.OUTPUTS)
        return Identity("Oriental Motor AZ")

    def self_test(self) -> list[Check]:
        """Alarm, line, coordinates, temperatures. A stage that is not homed yet passes, with a remark."""
        alarm, error = self.alarm(), int(self._unit.read(az.COMMUNICATION_ERROR))
        driver_c, motor_c = self._unit.read_block(az.DRIVER_TEMPERATURE, az.MOTOR_TEMPERATURE)
        referenced = self.referenced()
        return [
            Check("alarm", alarm is None, f"{alarm.code:02X} {alarm.text}. {alarm.words}" if alarm else "none"),
            Check("communication", error == 0, f"error {error:02X}" if error else "no error"),
            Check("coordinates", True, "set" if referenced else "not set: home first"),
            Check("temperature", max(driver_c, motor_c) < WARM_C, f"drive {driver_c:.1f} C, motor {motor_c:.1f} C"),
            *self._parameters(),
        ]

    def _parameters(self) -> Iterator[Check]:
        """Check that the parameters that the driver is to write have plausible values.

        A wrong address would change another parameter of the drive.
        """
        if timeout_s := self.settings.communication_timeout_s:
            register = self.settings.communication_timeout
            found_s = self._unit.read(register)
            advice = "compare the address with the drive's manual: it is not confirmed for AZ drives"
            yield Check("time-out", found_s in (0.0, timeout_s), f"{found_s:g} s in {register}; {advice}")
        if self.settings.own_limits:
            action, high, low = self._unit.read_block(*az.OWN_LIMITS)
            is_action = action in az.ACTIONS and low <= high
            yield Check("own limits", is_action, f"action {action:g}, {low:g} .. {high:g} steps in {az.OVERTRAVEL}")

    def angle_deg(self) -> float:
        """Motor angle measured by the drive, in deg."""
        return self._unit.read(az.FEEDBACK_POSITION) / self.settings.steps_per_turn * 360

    def referenced(self) -> bool:
        """Whether the zero of the angle is known to the drive."""
        return bool(self._outputs() & az.HOME_END)

    def alarm(self) -> Alarm | None:
        """The present alarm, in words."""
        return az.alarm_of(int(self._unit.read(az.ALARM)))

    def reset_alarm(self) -> None:
        """Clear the alarm, once a person has removed its cause. Raises StageAlarm if it stays."""
        self._unit.write(az.RESET_ALARM, 0)
        self._unit.write(az.RESET_ALARM, 1)
        self._require_no_alarm(self.alarm())

    def wait(self) -> None:
        """Return when the move that was started has ended where it should.

        Raises StageAlarm, StageLost, Interlocked, NotSettled.
        """
        self._wait_until(self._expected_end_s)
        outputs = self._poll_until(az.IN_POSITION, PATIENCE_S, "is still moving, or not in position,")
        self._require_coordinates(outputs)
        self._require_ready(outputs)
        self._watch(False)
        self._require_at_target("Remove what blocks the stage, check the load's balance, then repeat the move")

    def require_steady(self) -> None:
        """Compare the drive's status and the encoder's angle with the last command; a stage without one passes.

        Raises StageAlarm, StageLost, Interlocked, or NotSettled for a stage that moves or is off by more than
        `settle_deg`: the tolerance of every arrival, less than the 5 arcmin to which a pose's angle is known.
        """
        outputs = self._status()
        self._require_coordinates(outputs)
        if not _is_at_rest(outputs, az.IN_POSITION):
            remedy = "Find out what moves it: the load's balance, a hand, the drive's current; then resume the run"
            raise NotSettled(f"{self.name}: moved although no move was commanded", remedy)
        self._require_ready(outputs)
        if not self._holds_target:
            return
        self._require_at_target(
            "Find out what moves it: another program, a hand, the load; then `rig resume` measures this pose again"
        )

    def look(self) -> None:
        """Check the stage while the program waits for another one. Raises StageAlarm."""
        self._status()

    def halt(self) -> None:
        """Start braking and return at once. `stop` must follow."""
        self._unit.write(az.INPUTS, az.STOP, retries=0)  # the other drives wait for their commands

    def stop(self) -> None:
        """Brake, and wait for the standstill. A stage with an alarm counts as stopped if it does not move."""
        self._holds_target = False
        self._unit.write(az.INPUTS, az.STOP)
        try:
            self._poll_until(0, STOPPING_S, "has not stopped", self._outputs)
        finally:
            self._unit.write(az.INPUTS, 0)
        self._watch(False)

    def release(self) -> bool:
        """Switch the line's stop input off if it is on; returns whether it was. The stage does not move by that.

        A stop whose answers were lost, or a program that crashed in it, leaves the input on, and the drive then
        accepts moves without making them. The emergency stop has a contact of its own and is not affected.
        """
        is_on = bool(int(self._unit.read(az.INPUTS)) & az.STOP)
        if is_on:
            self._unit.write(az.INPUTS, 0)
        return is_on

    def home(self) -> None:
        """Seek the zero of the angle; needed once after power-on. Raises StageAlarm, NotSettled."""
        self._require_no_alarm(self.alarm())
        self._holds_target = False
        self._watch(True)
        self._unit.write(az.INPUTS, az.ZHOME)
        self._unit.write(az.INPUTS, 0)
        self._poll_until(az.HOME_END, HOMING_S, "did not find its home position")
        self._watch(False)

    def _require_at_target(self, remedy: str) -> None:
        """Raises NotSettled if the encoder's angle is not the target of the last move."""
        angle_deg = self.angle_deg()
        if abs(angle_deg - self._target_deg) > self.settings.settle_deg:
            raise self._away_from_target(angle_deg, remedy)

    def _require_coordinates(self, outputs: int) -> None:
        if not outputs & az.HOME_END:
            raise StageLost(
                f"{self.name}: the position is unknown, so no move is allowed",
                "Find out whether it was without power or was stopped while homing; it is homed when the run resumes",
            )

    def _require_movable(self) -> int:
        """The outputs of a drive that can move; raises the reason if it cannot. Writes the limits to the drive."""
        outputs = self._status()
        self._require_coordinates(outputs)
        self._require_ready(outputs)
        self._limit()
        return outputs

    def _require_ready(self, outputs: int) -> None:
        """Raises Interlocked for a drive at rest without an alarm that is not ready to move."""
        deadline = self._clock.now() + READY_S
        while not outputs & az.READY:
            if self._clock.now() >= deadline:
                raise Interlocked(
                    f"{self.name}: is at rest without an alarm and is not ready to move: its stop input is on, "
                    "or its motor is without current",
                    "Release the emergency stop and close the guards; when nobody is near the rig, resume the run",
                )
            self._clock.sleep(POLL_S)
            outputs = self._status()

    def _limit(self) -> None:
        """Write the limits to the drive, once, and read them back. Raises Interlocked if they differ."""
        if self._limited:
            return
        low, high = (round(deg * self.settings.steps_per_turn / 360) for deg in self.settings.limits_deg)
        limits = (az.BRAKE_AND_ALARM, high, low)
        self._unit.write_block(*zip(az.OWN_LIMITS, limits, strict=True))
        if (stored := self._unit.read_block(*az.OWN_LIMITS)) != list(limits):
            limits_text = ", ".join(
                f"{value:g} in {register}" for register, value in zip(az.OWN_LIMITS, stored, strict=True)
            )
            raise Interlocked(
                f"{self.name}: has not accepted its limits of {low} .. {high} steps: it shows {limits_text}",
                "Compare the addresses with the drive's manual, or take own_limits out of the bench file",
            )
        self._limited = True

    def _require_no_alarm(self, alarm: Alarm | None) -> None:
        if alarm is not None:
            raise StageAlarm(
                f"{self.name}: has stopped with alarm {alarm.code:02X}, {alarm.text}",
                alarm.words,
                alarm.code,
            )

    def _start(self, angle_deg: float, speed_deg_s: float) -> float | None:
        outputs = self._require_movable()
        distance_deg = abs(angle_deg - self.angle_deg())
        self._target_deg, self._expected_end_s = angle_deg, self._clock.now()
        self._holds_target = True
        if _is_at_rest(outputs, az.IN_POSITION) and distance_deg < 180 / self.settings.steps_per_turn:
            return None
        self._watch(True)
        begun_s = self._operate(az.ABSOLUTE, angle_deg, speed_deg_s)
        self._expected_end_s = begun_s + move_s(distance_deg, speed_deg_s, self.settings.acceleration_deg_s2)
        return begun_s

    def _begin_turn(self, rate_deg_s: float, start_deg: float, end_deg: float) -> Turn:  # noqa: ARG002
        if self.settings.endless:
            self._require_movable()
            self._watch(True)
            begun_s = self._operate(az.CONTINUOUS, 0.0, rate_deg_s)
        else:
            begun_s = self._start(end_deg, abs(rate_deg_s)) or self._clock.now()
        self._wait_until(begun_s + abs(rate_deg_s) / self.settings.acceleration_deg_s2 + LEAD_S)
        return Turn(rate_deg_s, min(self._beat_s, UNWATCHED_S), lambda: self._require_turning(rate_deg_s))

    def _end_turn(self) -> None:
        if self.settings.endless:
            self.stop()
        else:
            self.wait()

    def _operate(self, kind: int, angle_deg: float, speed_deg_s: float) -> float:
        """Write the direct operation, with speeds in steps per second. Returns the time at which it began."""
        per_deg = self.settings.steps_per_turn / 360
        rate, percent = self.settings.acceleration_deg_s2 * per_deg, self.settings.current_percent
        values = (0, kind, angle_deg * per_deg, speed_deg_s * per_deg, rate, rate, percent, az.TRIGGER_ALL)
        asked_s = self._clock.now()
        self._unit.write_block(*zip(az.DIRECT, values, strict=True))
        return (asked_s + self._clock.now()) / 2  # it starts when it has the request, and then answers

    def _require_turning(self, rate_deg_s: float) -> None:
        self._require_coordinates(self._status())
        per_deg = self.settings.steps_per_turn / 360
        speed = self._unit.read(az.FEEDBACK_SPEED) / per_deg
        if abs(speed - rate_deg_s) > OFF_RATE * abs(rate_deg_s) + 1 / per_deg:
            raise NotSettled(
                f"{self.name}: turns at {speed:.3f} deg/s instead of {rate_deg_s:.3f} deg/s",
                "Remove what blocks the stage, check the load's balance, then resume the run",
            )

    def _watch(self, on: bool) -> None:
        """Switch the drive's communication timeout on or off; at rest it is off, as nothing is sent then."""
        if self.settings.communication_timeout_s:
            self._unit.write(self.settings.communication_timeout, on * self.settings.communication_timeout_s)

    @property
    def _beat_s(self) -> float:
        """Largest interval between messages to a drive with a communication timeout, s."""
        return self.settings.communication_timeout_s / BEATS or math.inf

    def _wait_until(self, end_s: float) -> None:
        """Wait for a move until `end_s`, and send messages meanwhile, because of the communication timeout."""
        while (left_s := end_s - self._clock.now()) > self._beat_s:
            self._clock.sleep(self._beat_s)
            self._status()
        self._clock.sleep(left_s)

    def _outputs(self) -> int:
        return int(self._unit.read(az.OUTPUTS))

    def _status(self) -> int:
        """The outputs, and the alarm in the same exchange. Raises StageAlarm."""
        outputs, code = map(int, self._unit.read_block(az.OUTPUTS, az.ALARM))
        self._require_no_alarm(az.alarm_of(code))
        return outputs

    def _poll_until(
        self, outputs_on: int, timeout_s: float, complaint: str, outputs: Callable[[], int] | None = None
    ) -> int:
        """Wait for a standstill with `outputs_on`. Reads by `outputs`, or by `_status`, which raises StageAlarm."""
        deadline = self._clock.now() + timeout_s
        while True:
            if _is_at_rest(current := (outputs or self._status)(), outputs_on):
                return current
            if self._clock.now() >= deadline:
                remedy = "Look at the stage: is it blocked? Then home it and repeat"
                raise NotSettled(f"{self.name}: {complaint} after {timeout_s:g} s", remedy)
            self._clock.sleep(POLL_S)


def _is_at_rest(outputs: int, outputs_on: int) -> bool:
    """Whether the drive is at rest with `outputs_on`."""
    return not outputs & az.MOVE and outputs & outputs_on == outputs_on


def connect(address: Address, links: Links, settings: Settings, name: str) -> RotaryStage:
    """The stage at `address`. Raises LinkRefused when its wire cannot be opened; sends nothing."""
    return RotaryStage(links.unit(address, name), links, settings)
