import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.table import Array, Table


class DeadZone(Effect):
    """dead-zone: specific force below a threshold gives no output, and the threshold is missing from larger forces.

        a_i <- a_i - w_i for a_i > c_i + w_i,   a_i + w_i for a_i < c_i - w_i,   c_i between

        w, c in g, one per axis; c: 0, or what an offset before the threshold makes of it, which a search finds

    Symptom   the residual jumps where the specific force of its own axis changes sign, and is flat on both sides. An
              offset before the threshold moves the jump to another force.
    Excited by  positions close to 0 g on both sides, and others far from it.
    Confused with  hysteresis with a small reach, which jumps at different positions on the way up and on the way down.
    Source    Book 17.3.11; IEEE Std 528, dead band.
    """

    kinds = ("poses", "motion")

    width = Parameter("g", typical=0.01, starts=(0.003, 0.05), low=0.0, high=0.5, doc="greatest without output")
    centre_x = Constant(lambda _: 0.0, assumed=0.0)  # specific force, g, about which there is no output
    centre_y = Constant(lambda _: 0.0, assumed=0.0)
    centre_z = Constant(lambda _: 0.0, assumed=0.0)

    def force(self, a: Array, table: Table, p: Values) -> Array:
        centre = np.array([p.centre_x, p.centre_y, p.centre_z])
        blocked: Array = np.clip(a - centre, -p.width, p.width)
        return a - blocked
