"""PI E-727: the part of its command set that the rig uses, its parameters and its errors.

Source: GCS 2.0 as PI's own client `pipython` speaks it; [M] from memory.
"""

from __future__ import annotations

# Commands of one byte, without LF.
MOVING, READY, WAVES, STOP = 5, 7, 9, 24  # bits of the axes that move; "±" for yes; bits of the generators that run
IS_READY = "\xb1"

# Who it is, and how.
IDENTITY, AXES = "*IDN?", "SAI?"
TRAVEL_LOW, TRAVEL_HIGH = "TMN?", "TMX?"  # um
SERVO, ASK_SERVO = "SVO", "SVO?"

# Motion in closed loop, in um.
MOVE, ON_TARGET, POSITION = "MOV", "ONT?", "POS?"

# Wave generators: one for each axis, by the axis' place. A wave table is written, selected, and played.
WAVE, SELECT_WAVE, WAVE_RATE, WAVE_CYCLES, PLAY = "WAV", "WSL", "WTR", "WGC", "WGO"
SINE = "SIN_P"  # WAV table X SIN_P points amplitude offset period start center: peak to peak, and the minimum [M]
ENDLESS = 0  # of WGC
FROM_THE_START = 1  # of WGO
STRAIGHT = 1  # of WTR: between the points of a table that is played slowly, straight lines
WAVE_POINTS = 262144  # of the wave memory [M]

# Data recorder: tables that each record one thing, every RTR servo cycles, from a trigger on.
RECORD, RECORD_TRIGGER, RECORD_RATE, RECORDED_POINTS, RECORDED = "DRC", "DRT", "RTR", "DRL?", "DRR?"
ACTUAL_POSITION = 2  # of DRC
WITH_THE_WAVE, WITH_A_MOTION, WITH_THE_NEXT_COMMAND, AT_ONCE = 0, 1, 2, 4  # of DRT
RECORD_POINTS = 262144  # of one table

# Parameters: SPA? item identifier, the identifier in decimal or as 0x hexadecimal.
ASK_PARAMETER = "SPA?"
CYCLE_TIME = 0x0E000200  # s
USUAL_CYCLE_S = 50e-6  # of the servo: what a plan goes by before the controller can be asked

NOT_REFERENCED, OUTSIDE, STOPPED, BAD_AXIS, ILLEGAL_AXIS = 5, 7, 10, 15, 23
UNKNOWN_PARAMETER, WAVE_MEMORY, WAVE_RUNS, NO_WAVE = 54, 67, 73, 75
_SOFTWARE = "This program and the controller's firmware do not fit: report both versions"
_AXES = "Write the axes in the bench file as the controller names them (SAI?)"
ERRORS: dict[int, tuple[str, str]] = {
    1: ("syntax error", _SOFTWARE),
    2: ("unknown command", "Check that the controller is an E-727"),
    NOT_REFERENCED: ("the servo is off, or the axis is not referenced", "Switch the servo on, then repeat"),
    OUTSIDE: ("the position is outside the travel", "Set limits_um in the bench file within the stage's travel"),
    STOPPED: ("somebody stopped the axes", "Find out who and why, then repeat"),
    BAD_AXIS: ("there is no such axis", _AXES),
    17: ("a value is out of range", "Ask for less: the controller's manual has the range of each value"),
    ILLEGAL_AXIS: ("the axis is not allowed here", _AXES),
    24: ("wrong number of parameters", _SOFTWARE),
    UNKNOWN_PARAMETER: ("unknown parameter", _SOFTWARE),
    WAVE_MEMORY: ("the wave memory is full", "Ask for a higher frequency, or lower wave_points in the bench file"),
    WAVE_RUNS: ("no move while a wave runs", "Stop the positioner, then move"),
    NO_WAVE: ("no wave table is selected", _SOFTWARE),
}


def explain(code: int) -> tuple[str, str]:
    """The meaning of an error number, and the remedy."""
    return ERRORS.get(code, ("an error that this program does not know", "Look it up in the controller's manual"))
