"""Preparation of a run, for the terminal and the page: limits, storage, checks by hand, the mounting of the sensor."""

from __future__ import annotations

from calibrations.text import size
from procedures.questions import Confirm, Mounting
from rig.bench import Bench
from rig.drawings import Attitude, drawing_of
from rig.planning.plan import Plan


def stops(bench: Bench) -> list[str]:
    """The limits at which a run stops by itself."""
    low, high = bench.limits.temperature_c
    level_deg = bench.limits.level_deg
    tilt = [] if level_deg is None else [f"if the tilt of the table exceeds {level_deg:g} deg"]
    return [f"if the sensor is not at {low:g} to {high:g} C", *tilt]


def storage(plan: Plan, free_bytes: int) -> str:
    """The size of a run's data, and whether the disk of the record has room for it."""
    lacking = "" if free_bytes > plan.bytes else ": not enough space"
    return f"{size(plan.bytes)} on the disk; {size(free_bytes)} are free{lacking}"


LONG_CABLE = "the sensor's cable is long enough to turn it upside down"
FIRM_TABLE = "the table is firm, and no motor shakes it"


def checks(plan: Plan, is_resumed: bool = False) -> list[str]:
    """Checks that only a person can do, before anything moves.

    The first question of a procedure with the sensor in a hand is about its cable; a resumed run does not ask again.
    """
    actions = [step.what for step in plan.steps]
    level = any("level" in question.name for question in plan.asked)
    if not plan.reach:
        return [LONG_CABLE, FIRM_TABLE] if is_resumed else [FIRM_TABLE]
    lines = [
        "the cables are long enough for the whole range, and no object or person is in the way of the stages",
        "the sensor is fastened as in the drawing, with pin 1 at the drawn place",
    ]
    if any("level is read" in action for action in actions):
        lines.append("the level lies on the table and is switched on")
    if level:
        lines.append("a level lies on the table; you will read it")
    if "oven on" in actions:
        lines.append("the oven is closed, and everything in it withstands the temperatures")
    if any("positioner swings" in action for action in actions):
        lines.append("the nano-positioner's carriage is free to move")
    return lines


def mounting(plan: Plan) -> Attitude:
    """The first mounting of the sensor: from the first question with a drawing, else from the first pose."""
    drawings = [attitude for question in plan.asked if (attitude := drawing_of(question)) is not None]
    posed = [Attitude(mount_deg=dwell.pose.mount_deg, flip=dwell.pose.flip) for dwell in plan.held]
    return next(iter([*drawings, *posed]), Attitude())


def first_question(plan: Plan) -> Confirm | None:
    """The question that a person confirms before the stages move; None if the procedure begins without one."""
    first = next(iter(plan.asked), None)
    return first if isinstance(first, Confirm) and not isinstance(first, Mounting) and not first.repeated else None
