"""Oriental Motor AZ drive (AZD) turning a hollow rotary stage (DGII), by Modbus RTU.

Safe by design: limits are checked before anything is sent, arrival is measured and not assumed, an alarm
is never cleared silently, and a stop can always be sent. Source: AZ function manual, see oriental_az_table.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from drivers import oriental_az_table as az
from drivers.errors import Interlocked, LimitError, NotSettled, StageAlarm, StageLost
from drivers.instrument import Check, Identity
from drivers.links import Address, Links
from drivers.links.modbus import Unit
from drivers.links.register import Register
from drivers.oriental_az_table import Alarm

POLL_S = 0.02
PATIENCE_S = 2.0  # beyond the expected end of a move
HOMING_S = 120.0  # a full turn at a drive's slowest usual homing speed
STOPPING_S = 10.0
READY_S = 0.5  # for a drive to be ready again after a move [M]
BEATS = 4  # in a communication time-out, so that one lost answer is no silence
WARM_C = 85.0  # the drive's own alarm limit [M]


@dataclass(frozen=True)
class Settings:
    """One stage: gear and resolution, limits of the motor angle and speed, how it moves, when it counts as settled.

    With a `communication_timeout_s`, the drive stops by itself (alarm 85) when its controller falls silent for so long
    in the middle of a move; 0 is off. It is off unless the bench file sets it, since the address of the drive's
    parameter "Communication timeout (Modbus)", which counts ms, is from memory [M]: look it up first.

    With `own_limits`, `limits_deg` are written into the drive as its software limits and read back, before the first
    move: it brakes there by itself, whoever sent it. Off unless the bench file sets it, for the same reason.

    Raises ValueError for what no stage can be.
    """

    steps_per_turn: int = 18000  # 1.2 arcmin a step [M]
    limits_deg: tuple[float, float] = (-400.0, 400.0)
    speed_deg_s: float = 30.0
    speed_limit_deg_s: float = 1200.0  # 200 r/min of a DGII's table [M]; less for what stands on it
    acceleration_deg_s2: float = 60.0
    settle_deg: float = 0.05
    current_percent: float = 100.0
    communication_timeout_s: float = 0.0
    communication_timeout_register: int = 0x138A  # [M]
    own_limits: bool = False

    def __post_init__(self) -> None:
        positive = ("steps_per_turn", "speed_deg_s", "acceleration_deg_s2", "settle_deg", "current_percent")
        if wrong := [name for name in positive if not getattr(self, name) > 0]:
            raise ValueError(f"{', '.join(wrong)} must be positive")
        if not self.limits_deg[0] < self.limits_deg[1]:
            raise ValueError("limits_deg must be the lower limit, then the upper one")
        if self.speed_deg_s > self.speed_limit_deg_s:
            raise ValueError(f"speed_deg_s must be at most speed_limit_deg_s, {self.speed_limit_deg_s:g}")
        if self.communication_timeout_s and not 0.5 <= self.communication_timeout_s <= 10:
            raise ValueError("communication_timeout_s must be 0 for none, or 0.5 to 10")

    @property
    def communication_timeout(self) -> Register:
        """The drive's own parameter."""
        return Register(self.communication_timeout_register, "uint32", "communication time-out", "s", 0.001)

    def move_s(self, distance_deg: float) -> float:
        """How long a move takes: a trapezoid of speed, or a triangle when the way is short."""
        speed, acceleration = self.speed_deg_s, self.acceleration_deg_s2
        if distance_deg < speed**2 / acceleration:
            return 2 * math.sqrt(distance_deg / acceleration)
        return distance_deg / speed + speed / acceleration


class RotaryStage:
    """A stage that is told angles in deg and stands at them."""

    def __init__(self, unit: Unit, links: Links, settings: Settings) -> None:
        self.name = unit.name
        self.settings = settings
        self._unit, self._clock = unit, links.clock
        self._target_deg = math.nan
        self._expected_end_s = 0.0
        self._limited = not settings.own_limits  # whether the drive has its limits, where it is to have them

    def identify(self) -> Identity:
        """The drive has no register that names it: that it answers is all there is to know."""
        self._unit.read(az.OUTPUTS)
        return Identity("Oriental Motor AZ")

    def self_test(self) -> list[Check]:
        """Alarm, line, coordinates, temperatures. A stage that is not homed yet is in order, and says so."""
        alarm, error = self.alarm(), int(self._unit.read(az.COMMUNICATION_ERROR))
        driver_c, motor_c = self._unit.read_block(az.DRIVER_TEMPERATURE, az.MOTOR_TEMPERATURE)
        referenced = self.referenced()
        return [
            Check("alarm", alarm is None, f"{alarm.code:02X} {alarm.text}" if alarm else "none"),
            Check("communication", error == 0, f"error {error:02X}" if error else "no error"),
            Check("coordinates", True, "set" if referenced else "not set: home first"),
            Check("temperature", max(driver_c, motor_c) < WARM_C, f"drive {driver_c:.1f} C, motor {motor_c:.1f} C"),
        ]

    def close(self) -> None:
        """Nothing to release: the wire belongs to the bench."""

    def angle_deg(self) -> float:
        """Motor angle measured by the drive, in deg."""
        return self._unit.read(az.FEEDBACK_POSITION) / self.settings.steps_per_turn * 360

    def referenced(self) -> bool:
        """Whether the drive knows where zero is."""
        return bool(self._outputs() & az.HOME_END)

    def alarm(self) -> Alarm | None:
        """The present alarm, in words."""
        return az.alarm_of(int(self._unit.read(az.ALARM)))

    def reset_alarm(self) -> None:
        """Clear the alarm, once a person has removed its cause. Raises StageAlarm if it stays."""
        self._unit.write(az.RESET_ALARM, 0)
        self._unit.write(az.RESET_ALARM, 1)
        self._require_no_alarm(self.alarm())

    def move_to(self, angle_deg: float) -> None:
        """Turn to `angle_deg` and return when it stands there.

        Raises LimitError before anything is sent, StageAlarm, StageLost, NotSettled, and the errors of the link.
        """
        if self.start(angle_deg):
            self.wait()

    def start(self, angle_deg: float) -> bool:
        """Start turning to `angle_deg` and return at once; False where it stands there already.

        With a communication time-out, `wait` must follow within it. Raises LimitError before anything is sent,
        StageAlarm, StageLost, Interlocked.
        """
        self._require_within_limits(angle_deg)
        outputs = self._status()
        self._require_coordinates(outputs)
        self._require_ready(outputs)
        self._limit()
        distance_deg = abs(angle_deg - self.angle_deg())
        self._target_deg, self._expected_end_s = angle_deg, self._clock.now()
        if _stands(outputs, az.IN_POSITION) and distance_deg < 180 / self.settings.steps_per_turn:
            return False
        self._watch(True)
        asked_s = self._clock.now()
        self._unit.write_block(*self._direct_operation(angle_deg))
        begun_s = (asked_s + self._clock.now()) / 2  # it starts when it has the request, and then answers
        self._expected_end_s = begun_s + self.settings.move_s(distance_deg)
        return True

    def wait(self) -> None:
        """Return when the move that was started has ended where it should.

        Raises StageAlarm, StageLost, Interlocked, NotSettled.
        """
        self._until_expected_end()
        outputs = self._poll_until(az.IN_POSITION, PATIENCE_S, "is still moving, or not in position,")
        self._require_coordinates(outputs)
        self._require_ready(outputs)
        self._watch(False)
        angle = self.angle_deg()
        if abs(angle - self._target_deg) > self.settings.settle_deg:
            raise NotSettled(
                f"{self.name}: stands at {angle:.3f} deg instead of {self._target_deg:.3f} deg, "
                f"more than {self.settings.settle_deg:g} deg away",
                "Free the stage of what holds it, check the load's balance, then repeat the move",
            )

    def require_steady(self) -> None:
        """Raises StageAlarm, StageLost, Interlocked or NotSettled where it does not stand in position any more."""
        outputs = self._status()
        self._require_coordinates(outputs)
        if not _stands(outputs, az.IN_POSITION):
            remedy = "Find out what moves it: the load's balance, a hand, the drive's current; then resume the run"
            raise NotSettled(f"{self.name}: has not stood still", remedy)
        self._require_ready(outputs)

    def look(self) -> None:
        """Raises StageAlarm: what others do not wait for, while they wait."""
        self._status()

    def halt(self) -> None:
        """Let it brake, whatever it is doing, and return at once; `stop` must follow."""
        self._unit.write(az.INPUTS, az.STOP, retries=0)  # others wait to be told

    def stop(self) -> None:
        """Brake to a standstill, whatever the stage is doing. An alarm is no reason to doubt a standstill."""
        self._unit.write(az.INPUTS, az.STOP)
        try:
            self._poll_until(0, STOPPING_S, "has not stopped", self._outputs)
        finally:
            self._unit.write(az.INPUTS, 0)
        self._watch(False)

    def home(self) -> None:
        """Seek the zero of the angle; needed once after power-on. Raises StageAlarm, NotSettled."""
        self._require_no_alarm(self.alarm())
        self._watch(True)
        self._unit.write(az.INPUTS, az.ZHOME)
        self._unit.write(az.INPUTS, 0)
        self._poll_until(az.HOME_END, HOMING_S, "has not found its home")
        self._watch(False)

    def _require_within_limits(self, angle_deg: float) -> None:
        low, high = self.settings.limits_deg
        if not low <= angle_deg <= high:  # NaN is outside as well
            raise LimitError(
                f"{self.name}: {angle_deg:g} deg is outside its limits {low:g} .. {high:g} deg; nothing was sent",
                "Ask for an angle within the limits, or change them in the bench file after looking at the cables",
            )

    def _require_coordinates(self, outputs: int) -> None:
        if not outputs & az.HOME_END:
            raise StageLost(
                f"{self.name}: does not know where it is, and is not sent anywhere",
                "Find out whether it was without power or was stopped while homing; it is homed when the run resumes",
            )

    def _require_ready(self, outputs: int) -> None:
        """A drive that stands without an alarm and yet is not ready is kept from moving."""
        deadline = self._clock.now() + READY_S
        while not outputs & az.READY:
            if self._clock.now() >= deadline:
                raise Interlocked(
                    f"{self.name}: stands without an alarm and is not ready to move: its stop input is on, "
                    "or its motor is without current",
                    "Pull out the emergency stop and close the guards; when nobody is near, resume the run",
                )
            self._clock.sleep(POLL_S)
            outputs = self._status()

    def _limit(self) -> None:
        """Have the drive keep the limits too, once; what it does not take is found when it is read back."""
        if self._limited:
            return
        low, high = (round(deg * self.settings.steps_per_turn / 360) for deg in self.settings.limits_deg)
        wanted = (az.BRAKE_AND_ALARM, high, low)
        self._unit.write_block(*zip(az.OWN_LIMITS, wanted, strict=True))
        if (found := self._unit.read_block(*az.OWN_LIMITS)) != list(wanted):
            told = ", ".join(f"{value:g} in {register}" for register, value in zip(az.OWN_LIMITS, found, strict=True))
            raise Interlocked(
                f"{self.name}: has not taken its own limits of {low} .. {high} steps: it shows {told}",
                "Compare the addresses with the drive's manual, or take own_limits out of the bench file",
            )
        self._limited = True

    def _require_no_alarm(self, alarm: Alarm | None) -> None:
        if alarm is not None:
            how = (
                "then reset the alarm, or switch the drive off and on"
                if alarm.resettable
                else "the alarm needs a power cycle"
            )
            raise StageAlarm(
                f"{self.name}: stands still with alarm {alarm.code:02X}, {alarm.text}",
                f"{alarm.remedy}; {how}",
                alarm.code,
            )

    def _direct_operation(self, angle_deg: float) -> list[tuple[Register, float]]:
        """The block that moves to an absolute angle; rates in steps per second, which are its counts."""
        per_deg = self.settings.steps_per_turn / 360
        rate = self.settings.acceleration_deg_s2 * per_deg
        speed = self.settings.speed_deg_s * per_deg
        percent = self.settings.current_percent
        values = (0, az.ABSOLUTE, angle_deg * per_deg, speed, rate, rate, percent, az.TRIGGER_ALL)
        return list(zip(az.DIRECT, values, strict=True))

    def _watch(self, on: bool) -> None:
        """Have the drive watch over its controller, or not: while it stands, nobody needs to talk to it."""
        if self.settings.communication_timeout_s:
            self._unit.write(self.settings.communication_timeout, on * self.settings.communication_timeout_s)

    def _until_expected_end(self) -> None:
        """Let the move take its time, and let the drive hear of its controller meanwhile if it watches over it."""
        beat_s = self.settings.communication_timeout_s / BEATS or math.inf
        while (left_s := self._expected_end_s - self._clock.now()) > beat_s:
            self._clock.sleep(beat_s)
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
        self, wanted: int, timeout_s: float, complaint: str, outputs: Callable[[], int] | None = None
    ) -> int:
        """The outputs at a standstill with the `wanted` ones on; an alarm ends it unless `outputs` passes over it."""
        deadline = self._clock.now() + timeout_s
        while True:
            if _stands(now := (outputs or self._status)(), wanted):
                return now
            if self._clock.now() >= deadline:
                remedy = "Look at the stage: is it blocked? Then home it and repeat"
                raise NotSettled(f"{self.name}: {complaint} after {timeout_s:g} s", remedy)
            self._clock.sleep(POLL_S)


def _stands(outputs: int, wanted: int) -> bool:
    """Whether it stands still with the `wanted` outputs on."""
    return not outputs & az.MOVE and outputs & wanted == wanted


def connect(address: Address, links: Links, settings: Settings, name: str) -> RotaryStage:
    """The stage at `address`. Raises LinkRefused when its wire cannot be opened; sends nothing."""
    return RotaryStage(links.unit(address, name), links, settings)
