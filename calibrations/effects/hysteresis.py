"""hysteresis: friction makes the output depend on the side from which a specific force was reached.

    V += h s,   s <- clip(s + (a - a_before) / r, -L, L),   L = 1 + c |a_p|      h in {out}, per axis; r in g; c in 1/g

    an elastic element that slips (Jenkins), pressed by the load along the other in-plane axis: s follows the specific
    force until it slips at +-L, and turns round only when the specific force has gone back by 2 L r

Symptom   clockwise and anticlockwise turns leave two branches, with the residual of opposite sign on them.
Excited by  every angle approached from both sides.
Confused with  stage-backlash, which moves both axes by the same angle.
Source    Ang III.A (largest where the other axis is loaded most); Jenkins (1962); IEEE Std 528, hysteresis error.
"""

import numpy as np

from calibrations.axes import approached_from, other_in_plane
from calibrations.effect import Parameter, Values
from calibrations.kernels import slip
from calibrations.table import Array, Table

KINDS = ("poses",)
NEEDS = ("direction",)
PARAMETERS = (
    Parameter("height", "{out}", typical=0.01, doc="half the opening of the loop"),
    Parameter("reach", "g", typical=0.1, per_axis=False, starts=(0.02, 0.3), low=1e-3, high=3.0,
              doc="specific force from rest to slip"),
    Parameter("pressing", "1/g", typical=0.5, per_axis=False, low=-0.9, high=5.0,
              doc="growth of the opening with the other axis's load"),
)  # fmt: skip


def transduction(a: Array, table: Table, p: Values) -> Array:
    limit = 1 + p["pressing"] * np.abs(other_in_plane(a))
    return slip(a, approached_from(a, table), limit, float(p["reach"])) * p["height"]
