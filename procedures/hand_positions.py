"""hand-positions: a person turns an accelerometer from rest to rest; no stage.

Excites   bias, scale factor and nonorthogonality of three axes; nonlinearity, with additional positions.
Blind to  misalignment to the case, because the orientations are not known; hysteresis; warm-up, as the run is short.
Source    Tedaldi, Pretto and Menegatti, ICRA 2014; Skog et al. (2010), detectors of zero velocity.

The program detects when the sensor is at rest, records the position, and shows which orientation it needs next.
"""

from __future__ import annotations

from procedures.at_rest import Goal, require_analysis, take_positions
from procedures.session import Session

KIND = "positions"
ADAPTIVE = True
OUTPUTS = ("ax", "ay", "az")
TABLE = "Does the sensor lie on a table, and is its cable long enough to turn it upside down? Let it go."


def hand_positions(
    rig: Session, *, target_g: float = 0.001, rest_s: float = 2.0, most_positions: int = 40, wait_s: float = 120.0
) -> None:
    """Take positions at rest until every parameter is known well enough.

    target_g        The standard uncertainty to reach, as an error at 1 g: 0.001 is 1 mg of bias, 0.1 % of scale factor,
                    0.06 deg of an angle.
    rest_s          How long the sensor must rest in each position.
    most_positions  The run ends after this number of positions, also if the uncertainty is not reached.
    wait_s          The run stops after this time without a new position.
    """
    goal = Goal("hand-positions", "target_g", target_g, 1e3, "mg", rest_s, most_positions, wait_s)
    take_positions(rig, OUTPUTS, TABLE, require_analysis(rig, goal.procedure).course, goal)
