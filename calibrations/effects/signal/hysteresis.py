from collections.abc import Sequence

import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.geometry.orientation import other_in_plane
from calibrations.geometry.stage_path import APPROACH_DOC, STATED_APPROACH, sensed_turning_points, with_approach
from calibrations.table import Array, Table

LEAST_REACH_G = 1e-3
LEAST_FACTOR = 0.01  # on the limits: where loads would take away more, the elements slip almost freely
ELEMENTS = (np.arange(6) + 0.5) / 3 - 1  # midpoints of six equal parts of -1 .. 1


class Hysteresis(Effect):
    """hysteresis: friction makes the output depend on the side from which a specific force was reached.

        V += h s      s: force held by elements of equal stiffness that follow the specific force and slip at their
                      limits (Jenkins, Iwan), spread evenly over r (1 - w) .. r (1 + w), times
                      1 + c |a_p| + d a_p^2; s = 1 where all elements slip, and b before the first pose

        h in {out}, r in g, b from -1 to 1, per axis; w from 0 (one element) to 1; c in 1/g and d in 1/g^2: load of the
        other in-plane axis. b is a parameter, as the way to the first pose, such as the search for home, is not
        recorded.

    Symptom   clockwise and anticlockwise turns give two branches, with opposite signs of the residual.
    Excited by  every angle, approached from both sides.
    Confused with  stage-backlash, which shifts both axes by the same angle.
    Source    Ang III.A (largest where the other axis is loaded most); Iwan (1966); IEEE Std 528, hysteresis error.
    """

    of_force = True
    kinds = ("poses",)
    needs = ("direction",)
    memory = len(ELEMENTS)

    height = Parameter("{out}", typical=0.01, doc="half the opening of the loop")
    reach = Parameter(
        "g", typical=0.1, starts=(0.02, 0.2), low=LEAST_REACH_G, high=3.0, doc="specific force from rest to slip"
    )
    spread = Parameter(
        "1", typical=1.0, per_axis=False, starts=(0.5,), low=0.0, high=0.95, doc="spread of the limits over their mean"
    )
    pressing = Parameter(
        "1/g", typical=0.5, per_axis=False, low=-0.9, high=5.0, doc="growth of the limits with the other axis's load"
    )
    pressing_square = Parameter(
        "1/g^2", typical=0.5, per_axis=False, low=-0.9, high=5.0, assumed=0.0,
        doc="growth of the limits with the square of the other axis's load",
    )  # fmt: skip
    begin = Parameter(
        "1", typical=1.0, low=-1.0, high=1.0, assumed=0.0, doc="share of the slip force held before the first pose"
    )

    approach_deg = Constant(lambda _: STATED_APPROACH, doc=APPROACH_DOC)  # a search may find it

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        path = sensed_turning_points(with_approach(table, float(p.approach_deg)), a)
        from calibrations.effects.kernels import slip  # numba is slow to import

        return slip(a, path, _limit_factor(a, p), _limits(p), p.begin) * p.height

    def follow(self, a: Array, table: Table, p: Values, before: Sequence[Array]) -> tuple[Array, list[Array]]:
        """`before` and after: the specific force at which each element would be at rest, g."""
        limits, limit_factor = _limits(p), _limit_factor(a, p)
        forces = [
            np.minimum(limit * limit_factor, np.maximum(-limit * limit_factor, a - rest_point))
            for limit, rest_point in zip(limits, before, strict=True)
        ]
        return sum(forces[1:], forces[0]) * (p.height / np.sum(limits, axis=0)), [a - force for force in forces]


def _limits(p: Values) -> Array:
    """The slip limit of each element along each axis, g, if the other axis is not loaded, shape (elements, 3)."""
    reach = np.maximum(p.reach, LEAST_REACH_G)  # an axis that is not measured has none
    return np.asarray(reach * (1 + p.spread * ELEMENTS[:, None]))


def _limit_factor(a: Array, p: Values) -> Array:
    """Factor on the limits, shape (n, 3)."""
    load = np.abs(other_in_plane(a))
    return np.maximum(1 + p.pressing * load + p.pressing_square * load * load, LEAST_FACTOR)
