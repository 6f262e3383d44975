"""level-check: measure the tilt of the table with the level or typed readings.

Excites   tilt of the base, zero offset of alpha.
Blind to  rotation about the vertical; the offset of the level, which the half turn removes. On the table it cannot
          separate tilt of the base from zero offset of alpha; on the base the level shows only the base.
Source    Ang V: the level is read before every experiment; reversal, as for any spirit level.
"""

from __future__ import annotations

from typing import Literal

from procedures.errors import SafetyLimit
from procedures.session import Reading, Session

HALF_TURN = (("front", 0.0), ("back", 180.0))  # beta, deg: the tilt changes its sign, the level's offset does not
FACE_UP = "Is the sensor mounted face up on the table? Can its cable turn freely?"
LEVEL_RANGE_DEG = 45.0
Place = Literal["table", "base"]


def level_check(rig: Session, *, settle_s: float = 2.0, on: Place = "table") -> None:
    """Read the level at beta = 0 and 180 deg with alpha = 0. Raises SafetyLimit if the table is not level.

    Other procedures begin with this check if the bench has limits.level_deg.

    on  Where the level lies. base: a person puts the level on the base next to the stages, reads it, turns it by half a
        turn and reads it again.
    """
    if on == "base":
        _read_base(rig)
        return
    repeated = all(_is_read(rig, side) for side, _ in HALF_TURN) and _is_tilted(rig)  # a person has levelled the base
    for side, beta_deg in HALF_TURN:
        if repeated or not _is_read(rig, side):
            _read_level(rig, side, beta_deg, settle_s)
    if _is_tilted(rig):
        x_deg, y_deg = tilt_deg(rig)
        raise SafetyLimit(
            f"level: the table is tilted by {x_deg:.3f} deg along x and {y_deg:.3f} deg along y, but "
            f"limits.level_deg is {rig.limits.level_deg:g}; level the base, correct the zero of alpha, resume the run"
        )


def prepare(rig: Session, mounting: str = FACE_UP) -> None:
    """Ask a person to confirm the mounting, then check the level. Every procedure begins with it.

    The level check happens once in a run, and only if the bench has limits.level_deg.
    """
    rig.confirm("mounting", mounting, drawing="face-up")
    check_level(rig)


def check_level(rig: Session) -> None:
    """The level check at the beginning of a run, if the bench has limits.level_deg."""
    if rig.limits.level_deg is not None:
        level_check(rig)


def tilt_deg(rig: Session) -> tuple[float, float]:
    """Tilt of the table from both readings, deg, along x and y of the level at beta = 0."""
    front_x, front_y, back_x, back_y = (
        rig.reading(f"level-{side}-{axis}") or 0.0 for side, _ in HALF_TURN for axis in "xy"
    )
    return reversal(front_x, back_x)[0], reversal(front_y, back_y)[0]


def reversal(front_deg: float, back_deg: float) -> tuple[float, float]:
    """(tilt, offset of the level) from the readings before and after half a turn, deg."""
    return (front_deg - back_deg) / 2, (front_deg + back_deg) / 2


def _is_read(rig: Session, side: str) -> bool:
    return rig.reading(f"level-{side}-y") is not None


def _is_tilted(rig: Session) -> bool:
    """Whether the measured tilt is above the limit of the bench."""
    limit = rig.limits.level_deg
    return limit is not None and max(map(abs, tilt_deg(rig))) > limit


def _read_level(rig: Session, side: str, beta_deg: float, settle_s: float) -> None:
    """Read both axes: from the level, or typed by a person if the bench has no level."""
    rig.alpha.move_to(0.0)
    rig.beta.move_to(beta_deg)
    rig.wait(settle_s)
    std_deg: float | None = None
    if rig.level is not None:
        tilt = rig.level.read()
        x_deg, y_deg, std_deg = tilt.x_deg, tilt.y_deg, tilt.std_deg
    else:
        text = f"Read the level on the table (alpha 0, beta {beta_deg:g} deg). What does it show along"
        x_deg, y_deg = (_ask_deg(rig, f"level-{side}-{axis}", f"{text} {axis}, in deg?") for axis in "xy")
    rig.keep_readings(
        Reading(f"level-{side}-x", x_deg, "deg", std_deg), Reading(f"level-{side}-y", y_deg, "deg", std_deg)
    )


def _read_base(rig: Session) -> None:
    """Both axes of the base, before and after half a turn. A person types them, as no stage moves the level there."""
    for side, turn_deg in HALF_TURN:
        if rig.reading(f"base-{side}-y") is not None:
            continue
        text = f"Put the level on the base, turned by {turn_deg:g} deg from the base's x. What does it show along its"
        names = [f"base-{side}-{axis}" for axis in "xy"]
        values = [_ask_deg(rig, name, f"{text} {name[-1]}, in deg?") for name in names]
        rig.keep_readings(*(Reading(name, value, "deg") for name, value in zip(names, values, strict=True)))


def _ask_deg(rig: Session, name: str, text: str) -> float:
    return rig.number(name, text, "deg", -LEVEL_RANGE_DEG, LEVEL_RANGE_DEG)
