import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.table import Array, Table


class DeadZone(Effect):
    """dead-zone: specific force below a threshold gives no output, and the threshold is missing from larger forces.

        a_i <- a_i - w_i for a_i > c_i + w_i,   a_i + w_i for a_i < c_i - w_i,   c_i between      w, c in g, per axis

    Symptom   the residual jumps where the specific force of its own axis changes sign, and is flat on both sides.
    Excited by  positions close to 0 g on both sides, and others far from it.
    Confused with  hysteresis with a small reach, which jumps at different positions on the way up and on the way down.
    Source    Book 17.3.11; IEEE Std 528, dead band.
    """

    kinds = ("poses", "motion")

    width = Parameter("g", typical=0.01, starts=(0.003, 0.05), low=0.0, high=0.5, doc="greatest without output")
    centre = Parameter(
        "g", typical=0.01, low=-0.5, high=0.5, where="centred", assumed=0.0,
        doc="force at the middle of it; only poses in the zone show it",
    )  # fmt: skip
    # In a motion at few attitudes, a zone about any force would be an offset at one of them.
    centred = Constant(lambda table: float(table.kind == "poses"), doc="the middle is sought (1: yes, 0: it is 0 g)")

    def force(self, a: Array, table: Table, p: Values) -> Array:
        return a - np.clip(a - p.centre, -p.width, p.width)
