"""Oriental Motor AZ: the registers that the rig uses, the settings of a stage, and times and paths of its moves.

Source: AZ function manual, HM-60262; [M] from memory.

Parameters that the program writes on request were compared with public code, as the manual was not at hand. No address
below was seen in the manual of an AZ drive or tried on one:

0x0388, 0x038A   software limits: supported for AZ drives. heyannnn/Oriental_CvD_Controller_Murata reads them there as
                 parameters 01C4h and 01C5h (az_define.py; oriental_az.py, readLimit), and a Modbus address is twice the
                 number of the parameter: the alarm reset is 00C0h there and 0x0180 here. CVD drives have them at these
                 addresses (drivers/cvd_define.py of the same project).
0x0386           action at a software limit: supported in part. CVD and AR drives have it there, and its neighbours are
                 those of AZ drives: the limits above, and below the direction (EtherCAT object 41C2h: Glowbuzzer,
                 azd-ked.h).
0x138A           communication time-out: open. Public code for the maker's BLV-R drives writes it there, after their
                 manual HP-5141J; AR drives have it at 0x1200. It is off unless the bench file sets it.

`rig check` reads these parameters where the bench file uses them, and shows what it finds.

32-bit values, high word first. Default line: 115200 baud, 8 data bits, even parity. Functions 03, 06, 10h, 17h.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.errors import LimitError
from drivers.instrument import Alarm, require_positive
from drivers.motor_stage import MotorSettings
from drivers.transport.modbus import Register

# Direct data operation: written in one go; the trigger is last and starts the move.
DATA_NUMBER = Register(0x0058, "uint32", "operation data number")
TYPE = Register(0x005A, "uint32", "operation type")
POSITION = Register(0x005C, "int32", "target position", "step")
SPEED = Register(0x005E, "int32", "operating speed", "step/s")
ACCELERATION = Register(0x0060, "uint32", "acceleration rate", "step/s2")  # counts of 0.001 kHz/s
DECELERATION = Register(0x0062, "uint32", "deceleration rate", "step/s2")
CURRENT = Register(0x0064, "uint32", "operating current", "%", 0.1)
TRIGGER = Register(0x0066, "int32", "trigger of the direct data operation")
DIRECT = (DATA_NUMBER, TYPE, POSITION, SPEED, ACCELERATION, DECELERATION, CURRENT, TRIGGER)
ABSOLUTE, FROM_COMMAND, FROM_FEEDBACK = 1, 2, 3  # operation types
CONTINUOUS = 7  # endless turning until STOP; the sign of the speed is the direction
TRIGGER_ALL = 1

# Remote inputs and outputs: one bit each in the lower word.
INPUTS = Register(0x007D, "uint16", "driver input command")
START, ZHOME, STOP, ALARM_RESET = (1 << bit for bit in (3, 4, 5, 7))
OUTPUTS = Register(0x007F, "uint16", "driver output status")
HOME_END = 1 << 4  # [M] on while coordinates are set
READY, ALARM_ON = 1 << 5, 1 << 7
MOVE, IN_POSITION = (1 << bit for bit in (13, 14))

# The drive's own limits; steps.
OVERTRAVEL = Register(0x0386, "int32", "action at a software limit")
BRAKE_AND_ALARM = 3  # [M] brake, then alarm 67; -1 none, 0 and 1 stop or brake, 2 and 3 the same with the alarm
ACTIONS = range(-1, BRAKE_AND_ALARM + 1)
HIGH_LIMIT = Register(0x0388, "int32", "positive software limit", "step")
LOW_LIMIT = Register(0x038A, "int32", "negative software limit", "step")
OWN_LIMITS = (OVERTRAVEL, HIGH_LIMIT, LOW_LIMIT)

# Monitors.
ALARM = Register(0x0080, "uint32", "present alarm")
COMMUNICATION_ERROR = Register(0x00AC, "uint32", "present communication error")
COMMAND_POSITION = Register(0x00C6, "int32", "command position", "step")  # [M]
FEEDBACK_POSITION = Register(0x00CC, "int32", "feedback position", "step")
FEEDBACK_SPEED = Register(0x00D0, "int32", "feedback speed", "step/s")
DRIVER_TEMPERATURE = Register(0x00F8, "int32", "driver temperature", "C", 0.1)
MOTOR_TEMPERATURE = Register(0x00FA, "int32", "motor temperature", "C", 0.1)

# Maintenance: executed when 1 is written after 0.
RESET_ALARM = Register(0x0180, "uint32", "alarm reset")
RESETTABLE_BY_POWER_ONLY = frozenset({0x20, 0x28, 0x2A, 0x41, 0x42, 0x45, 0xF0})

COORDINATES_NOT_SET = 0x4A
COMMUNICATION_TIMEOUT = 0x85
SOFTWARE_OVERTRAVEL = 0x67
BAD_OPERATION_DATA = 0x70
_LIMITS = "Turn the stage by hand away from its limit, then home it"
_POWER = "Switch the drive's power off, wait a minute and switch it on; if it returns, have the drive serviced"
_WORDS: dict[int, tuple[str, str]] = {
    0x10: ("excessive position deviation", "Remove what blocks the stage, or lower speed and acceleration"),
    0x20: ("overcurrent", _POWER),
    0x28: ("encoder error", _POWER),
    0x2A: ("encoder communication error", "Check the encoder's cable with the power off"),
    0x30: ("overload", "Remove what blocks the stage, let the motor cool, or lower the acceleration"),
    0x41: ("memory error", _POWER),
    0x42: ("encoder error at power-on", _POWER),
    0x45: ("motor and drive do not match", "Connect the motor that belongs to this drive"),
    COORDINATES_NOT_SET: ("absolute move before the coordinates are set", "Home the stage, then repeat the move"),
    0x60: ("both limit sensors are on", "Check the limit sensors' wiring"),
    0x61: ("limit sensors are exchanged", "Check the limit sensors' wiring"),
    0x62: ("homing failed", "Check the home sensor and that the stage turns freely, then home again"),
    0x63: ("no home position found", "Check the home sensor, then home again"),
    0x64: ("home, timing or slit signal missing", "Check the home sensor, then home again"),
    0x66: ("hardware overtravel", _LIMITS),
    SOFTWARE_OVERTRAVEL: ("software overtravel", _LIMITS),
    BAD_OPERATION_DATA: ("bad operation data", "Check speed and acceleration in the bench file"),
    0x84: ("RS-485 communication error", "Check shielding, termination, baud rate and parity of the line"),
    COMMUNICATION_TIMEOUT: (
        "RS-485 communication time-out",
        "Find out why the controller fell silent",
    ),
    0xF0: ("processor error", _POWER),
}


def alarm_of(code: int) -> Alarm | None:
    """The alarm of a code; None for 0."""
    if code == 0:
        return None
    text, remedy = _WORDS.get(code, ("an alarm unknown to this program", "Look it up in the manual"))
    return Alarm(code, text, remedy, code not in RESETTABLE_BY_POWER_ONLY)


# Settings of a stage in a bench file; times and paths of its moves.


@dataclass(frozen=True)
class Settings(MotorSettings):
    """One stage: gear and resolution, limits of the motor angle and speed, how it moves, when it counts as settled.

    With a `communication_timeout_s`, the drive stops by itself (alarm 85) when its controller falls silent for so long
    in the middle of a move; 0 is off. It is off unless the bench file sets it, since the address of the drive's
    parameter "Communication timeout (Modbus)", which counts ms, is not confirmed for AZ drives (see above): look it
    up in HM-60262 first.

    With `own_limits`, `limits_deg` are written into the drive as its software limits and read back, before the first
    move: it brakes there by itself, whoever sent it. Off unless the bench file sets it.

    Raises ValueError for impossible values.
    """

    steps_per_turn: int = 18000  # 1.2 arcmin a step [M]
    limits_deg: tuple[float, float] = (-400.0, 400.0)
    speed_deg_s: float = 30.0
    speed_limit_deg_s: float = 1200.0  # 200 r/min of a DGII's table [M]; less with a load
    acceleration_deg_s2: float = 60.0
    settle_deg: float = 0.05
    current_percent: float = 100.0
    communication_timeout_s: float = 0.0
    communication_timeout_register: int = 0x138A  # [M]
    own_limits: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "steps_per_turn", "current_percent")
        if self.own_limits and not all(map(math.isfinite, self.limits_deg)):
            raise ValueError("with own_limits, give both numbers of limits_deg")
        if self.communication_timeout_s and not 0.5 <= self.communication_timeout_s <= 10:
            raise ValueError("communication_timeout_s must be 0 for none, or 0.5 to 10")

    @property
    def communication_timeout(self) -> Register:
        """The parameter of the drive for its communication timeout."""
        return Register(self.communication_timeout_register, "uint32", "communication time-out", "s", 0.001)

    def rate_deg_s(self, asked_deg_s: float) -> float:
        """The rate nearest to the requested one that is a whole number of steps a second."""
        per_deg = self.steps_per_turn / 360
        return round(asked_deg_s * per_deg) / per_deg

    def way_of_turn(self, name: str, rate_deg_s: float, first_deg: float, last_deg: float) -> tuple[float, float]:
        """Also raises LimitError for a stage without limits that would not stop if this program crashes."""
        if self.endless and not self.communication_timeout_s:
            raise LimitError(
                f"{name}: has no limits and would not stop if this program crashes; nothing was sent",
                "Set communication_timeout_s in the bench file, so that the drive stops by itself, or set limits_deg",
            )
        return super().way_of_turn(name, rate_deg_s, first_deg, last_deg)

    @property
    def endless(self) -> bool:
        """Whether the stage can turn on and on: nothing such as a cable limits it."""
        return all(map(math.isinf, self.limits_deg))
