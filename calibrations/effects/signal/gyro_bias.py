import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.rate_table import outputs_at_rest
from calibrations.table import Array, Table


class GyroBias(Effect):
    """gyro-bias: the output of a gyroscope at zero angular rate.

        V += b                                            b in {out}, one per axis

    Symptom   the mean of the residual is not zero, also at rest.
    Excited by  any data.
    Confused with  the rotation of the earth, if the latitude is not given: 0.0042 deg/s at most.
    Source    Book 17.3.6; IEEE Std 528, bias.
    """

    kinds = ("rates", "turns")

    bias = Parameter(
        "{out}",
        typical=5.0,
        guess=outputs_at_rest,
        doc="output at zero angular rate",
    )

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return np.broadcast_to(p.bias, a.shape)
