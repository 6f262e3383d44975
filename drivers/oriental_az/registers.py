"""Oriental Motor AZ: the part of its register map that the rig uses.

Source: AZ function manual, HM-60262; [M] from memory.

32-bit values, high word first. Default line: 115200 baud, 8 data bits, even parity. Functions 03, 06, 10h, 17h.
"""

from __future__ import annotations

from dataclasses import dataclass

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
CONTINUOUS = 7  # at a position that goes on and on, the way that the sign of the speed says, until STOP
TRIGGER_ALL = 1

# Remote inputs and outputs: one bit each in the lower word.
INPUTS = Register(0x007D, "uint16", "driver input command")
START, ZHOME, STOP, FREE, ALARM_RESET = (1 << bit for bit in (3, 4, 5, 6, 7))
OUTPUTS = Register(0x007F, "uint16", "driver output status")
HOME_END = 1 << 4  # [M] on while coordinates are set
READY, ALARM_ON, BUSY = (1 << bit for bit in (5, 7, 8))
MOVE, IN_POSITION = (1 << bit for bit in (13, 14))

# The drive's own limits; steps. The maker's CVD and AR drives have them here, behind the motor's direction at 0x0384;
# AZ drives have the direction there too: it is their EtherCAT object 41C2h, which is 4000h and half of 0x0384. That the
# limits follow it in the AZ as well is likely, and not confirmed by its manual (HM-60262).
OVERTRAVEL = Register(0x0386, "int32", "action at a software limit")
BRAKE_AND_ALARM = 3  # [M] brake, then alarm 67; -1 none, 0 and 1 stop or brake, 2 and 3 the same with the alarm
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


@dataclass(frozen=True)
class Alarm:
    """A drive's alarm in words, and what a person does about it."""

    code: int
    text: str
    remedy: str

    @property
    def resettable(self) -> bool:
        """Whether `reset_alarm` can clear it once its cause is gone."""
        return self.code not in RESETTABLE_BY_POWER_ONLY


COORDINATES_NOT_SET = 0x4A
COMMUNICATION_TIMEOUT = 0x85
SOFTWARE_OVERTRAVEL = 0x67
BAD_OPERATION_DATA = 0x70
_LIMITS = "Turn the stage by hand away from its limit, then home it"
_POWER = "Switch the drive's power off, wait a minute and switch it on; if it returns, have the drive serviced"
_WORDS: dict[int, tuple[str, str]] = {
    0x10: ("excessive position deviation", "Free the stage of what blocks it, or lower speed and acceleration"),
    0x20: ("overcurrent", _POWER),
    0x28: ("encoder error", _POWER),
    0x2A: ("encoder communication error", "Check the encoder's cable with the power off"),
    0x30: ("overload", "Free the stage of what blocks it, let the motor cool, or lower the acceleration"),
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
        "The controller went silent; find out why, then reset the alarm",
    ),
    0xF0: ("processor error", _POWER),
}


def alarm_of(code: int) -> Alarm | None:
    """The alarm of a code; None for 0."""
    if code == 0:
        return None
    return Alarm(code, *_WORDS.get(code, ("an alarm that this program does not know", "Look it up in the manual")))
