"""The EPICS motor record: the fields that the rig uses, and the settings of a stage in a bench file.

Source: EPICS motor record documentation (epics-modules/motor), field descriptions; the bits of MSTA are those of its
motor.h.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from drivers.instrument import require_positive
from drivers.motor_stage import MotorSettings

__all__ = ["FIELDS", "UNITS_DEG", "Settings"]

TARGET, READBACK, DONE = ".VAL", ".RBV", ".DMOV"
STOP, MODE, SET = ".STOP", ".SPMG", ".SET"
HIGH_LIMIT, LOW_LIMIT, LIMIT_VIOLATION = ".HLM", ".LLM", ".LVIO"
HIGH_SWITCH, LOW_SWITCH, STATUS = ".HLS", ".LLS", ".MSTA"
SPEED, ACCELERATION_TIME = ".VELO", ".ACCL"
HOME = {"forward": ".HOMF", "reverse": ".HOMR"}
FIELDS = (
    TARGET, READBACK, DONE, STOP, MODE, SET, HIGH_LIMIT, LOW_LIMIT, LIMIT_VIOLATION, HIGH_SWITCH, LOW_SWITCH, STATUS,
    SPEED, ACCELERATION_TIME, *HOME.values(),
)  # fmt: skip
GO = 3  # of SPMG: stop, pause, move, go
MODES = ("Stop", "Pause", "Move", "Go")
SLIP_STALL, PROBLEM, COMM_ERR, HOMED = 1 << 6, 1 << 9, 1 << 12, 1 << 14  # bits of MSTA
FAULTY = {
    SLIP_STALL: ("the motor slips or stalls", "Remove what blocks the stage, check the load's balance"),
    PROBLEM: ("the driver has stopped polling the controller", "Look at the controller, and restart the IOC"),
    COMM_ERR: ("the IOC does not reach the controller", "Check the controller's power and cable"),
}
UNITS_DEG = {"deg": 1.0, "degree": 1.0, "degrees": 1.0, "°": 1.0, "mdeg": 1e-3, "arcmin": 1 / 60, "arcsec": 1 / 3600}


@dataclass(frozen=True)
class Settings(MotorSettings):
    """One stage: limits and speed, how it moves, when it counts as settled, and how far its record is trusted.

    `deg_per_unit` converts the engineering units of the record; without it the units must be those of an angle. `home`
    is the direction in which the motor seeks its zero; `none` for a motor whose position the IOC keeps.
    `highest_severity` is the worst alarm with which the rig goes on. Raises ValueError for impossible values.
    """

    limits_deg: tuple[float, float] = (-400.0, 400.0)
    speed_deg_s: float = 10.0
    speed_limit_deg_s: float = 30.0
    acceleration_deg_s2: float = 20.0
    settle_deg: float = 0.05
    deg_per_unit: float | None = None
    home: Literal["none", "forward", "reverse"] = "none"
    highest_severity: Literal["none", "minor", "major"] = "minor"
    timeout_s: float = 5.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "timeout_s")
        if self.deg_per_unit == 0:
            raise ValueError("deg_per_unit must not be 0")
