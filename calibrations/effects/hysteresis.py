"""hysteresis: friction makes the output depend on the side from which a specific force was reached.

    V += h s,   s <- clip(s + (a - a_before) / r, -1, 1)      h in {out}, one per axis; r in g

    an elastic element that slips (Jenkins): s follows the specific force until it slips at +-1, and
    turns round only after the specific force has gone back by 2 r. `direction` tells how a pose was approached.

Symptom   clockwise and anticlockwise turns leave two branches, with the residual of opposite sign on them.
Excited by  every angle approached from both sides.
Confused with  stage-backlash, which moves both axes by the same angle.
Source    Ang III.A; Jenkins (1962); IEEE Std 528, hysteresis error.
"""

from calibrations.axes import turned_back
from calibrations.effect import Parameter, Values
from calibrations.kernels import slip
from calibrations.table import Array, Table

KINDS = ("poses",)
NEEDS = ("direction",)
PARAMETERS = (
    Parameter("height", "{out}", typical=0.01, doc="half the opening of the loop"),
    Parameter("reach", "g", typical=0.1, per_axis=False, starts=(0.02, 0.3), low=1e-3, high=3.0,
              doc="specific force from rest to slip"),
)  # fmt: skip


def transduction(a: Array, table: Table, p: Values) -> Array:
    return slip(a, turned_back(a, table), table.order, float(p["reach"])) * p["height"]
