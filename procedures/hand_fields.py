"""hand-fields: a person turns a magnetometer from rest to rest; no stage.

Excites   hard iron and soft iron that turn with the sensor; its offsets, scale factors and angles between its axes.
Blind to  the scale factor that all axes share, unless the strength of the field is known; misalignment to the case;
          iron and magnets that do not turn with the sensor, which must be far away.
Source    Renaudin, Afzal and Lachapelle (2010): the ellipsoid of all directions; Skog et al. (2010), detectors of zero
          velocity.

The program sees when the sensor is at rest, takes the position, and says which attitude it needs next: what is upward,
and what points to the north. North may be any direction, if it is always the same.
"""

from __future__ import annotations

from procedures.at_rest import Goal, require_analysis, take_positions
from procedures.session import Session

KIND = "positions"
ADAPTIVE = True
OUTPUTS = ("mx", "my", "mz")
TABLE = (
    "Does the sensor lie on a table without iron, 2 m away from magnets, motors and large iron? Is its cable long "
    "enough to turn it upside down? Do you know where north is, within 20 deg? Let the sensor go."
)


def hand_fields(
    rig: Session,
    *,
    target_percent: float = 0.2,
    rest_s: float = 2.0,
    most_positions: int = 40,
    wait_s: float = 120.0,
) -> None:
    """Take positions at rest until every parameter is known well enough.

    target_percent  The standard uncertainty to reach, as a share of the field: 0.2 is 0.1 uT of hard iron in a field of
                    50 uT, 0.1 deg of heading.
    rest_s          How long the sensor must rest in each position.
    most_positions  The run ends after this number of positions, also if the uncertainty is not reached.
    wait_s          The run stops after this time without a new position.
    """
    goal = Goal("hand-fields", "target_percent", target_percent / 100, 100, "%", rest_s, most_positions, wait_s)
    take_positions(rig, OUTPUTS, TABLE, require_analysis(rig, goal.procedure).field_course, goal)
