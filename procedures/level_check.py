"""level-check: how far the table is from level, by the digital level or a typed reading.

Excites   tilt of the base, zero offset of alpha.
Blind to  turns about the vertical; the level's own offset, which the half turn takes out; on the table, which of base
          and alpha is off: laid on the base, the level shows the base alone.
Source    Ang V: the level is read before every experiment; reversal, as for any spirit level.
"""

from __future__ import annotations

from typing import Literal

from procedures.errors import SafetyLimit
from procedures.session import Reading, Session

HALF_TURN = (("front", 0.0), ("back", 180.0))  # of beta: the table's tilt turns its sign on the level, its offset not
LEVEL_RANGE_DEG = 45.0
Place = Literal["table", "base"]


def level_check(rig: Session, *, settle_s: float = 2.0, on: Place = "table") -> None:
    """Read the level at beta = 0 and 180 deg with alpha at 0, and refuse to go on where the table is not level.

    Other procedures begin with it where the bench has limits.level_deg. With `on="base"` a person lays the level on the
    base beside the stages, reads it, turns it round by half a turn and reads it again. Raises SafetyLimit.
    """
    if on == "base":
        _read_base(rig)
        return
    again = all(_is_read(rig, side) for side, _ in HALF_TURN) and _refused(rig)  # the base was levelled since
    for side, beta_deg in HALF_TURN:
        if again or not _is_read(rig, side):
            _read(rig, side, beta_deg, settle_s)
    if _refused(rig):
        x_deg, y_deg = tilt_deg(rig)
        raise SafetyLimit(
            f"the table is tilted by {x_deg:.3f} deg along x and {y_deg:.3f} deg along y, more than "
            f"limits.level_deg = {rig.limits.level_deg:g}; level the base and the zero of alpha, then resume the run"
        )


def levelled(rig: Session) -> None:
    """The level check that other procedures begin with: once a run, and only where the bench has a limit for it."""
    if rig.limits.level_deg is not None:
        level_check(rig)


def tilt_deg(rig: Session) -> tuple[float, float]:
    """The table's tilt from both readings, deg, along x and y of the level at beta = 0."""
    front_x, front_y, back_x, back_y = (
        rig.reading(f"level-{side}-{axis}") or 0.0 for side, _ in HALF_TURN for axis in "xy"
    )
    return reversal(front_x, back_x)[0], reversal(front_y, back_y)[0]


def reversal(front_deg: float, back_deg: float) -> tuple[float, float]:
    """(tilt, the level's own offset) from its readings before and after half a turn, deg."""
    return (front_deg - back_deg) / 2, (front_deg + back_deg) / 2


def _is_read(rig: Session, side: str) -> bool:
    return rig.reading(f"level-{side}-y") is not None


def _refused(rig: Session) -> bool:
    """Whether the table, as it was read, is not level enough to go on."""
    limit = rig.limits.level_deg
    return limit is not None and max(map(abs, tilt_deg(rig))) > limit


def _read(rig: Session, side: str, beta_deg: float, settle_s: float) -> None:
    """One reading of both axes: from the level, or typed where the bench has none."""
    rig.alpha.move_to(0.0)
    rig.beta.move_to(beta_deg)
    rig.wait(settle_s)
    std_deg: float | None = None
    if rig.level is not None:
        shown = rig.level.read()
        x_deg, y_deg, std_deg = shown.x_deg, shown.y_deg, shown.std_deg
    else:
        x_deg, y_deg = (_typed_deg(rig, f"level-{side}-{axis}", axis, beta_deg) for axis in "xy")
    rig.keep_readings(
        Reading(f"level-{side}-x", x_deg, "deg", std_deg), Reading(f"level-{side}-y", y_deg, "deg", std_deg)
    )


def _read_base(rig: Session) -> None:
    """Both axes of the base, the level lying along the base and turned round; typed, as nothing moves it there."""
    for side, turned_deg in HALF_TURN:
        if rig.reading(f"base-{side}-y") is not None:
            continue
        where = f"The level on the base, turned by {turned_deg:g} deg from along the base's x"
        names = [f"base-{side}-{axis}" for axis in "xy"]
        shown = [
            rig.number(
                name,
                f"{where}: what does it show along its {name[-1]}, in deg?",
                "deg",
                -LEVEL_RANGE_DEG,
                LEVEL_RANGE_DEG,
            )
            for name in names
        ]
        rig.keep_readings(*(Reading(name, value, "deg") for name, value in zip(names, shown, strict=True)))


def _typed_deg(rig: Session, name: str, axis: str, beta_deg: float) -> float:
    text = f"What does the level on the table show along {axis}, in deg? (alpha 0, beta {beta_deg:g} deg)"
    return rig.number(name, text, "deg", -LEVEL_RANGE_DEG, LEVEL_RANGE_DEG)
