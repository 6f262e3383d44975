from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import other_in_plane
from calibrations.table import Array, Table


class CrossAxisScale(Effect):
    """cross-axis-scale: the scale factor follows the other in-plane axis.

        V += k r_i a_p                                    k in {out}/g^2, one per axis; IEEE K_ip = k / K1

        r_i = a_i + N_i / SF_i, with all that nonlinear effects add, N_i: it multiplies the whole response

    Symptom   the residual follows the product of both in-plane axes: two full waves in a turn of beta.
    Excited by  a full turn of beta.
    Confused with  a stage angle error with two waves in a turn.
    Source    IEEE Std 1293, K_ip.
    """

    of_force = True
    scales = True
    slope = Parameter("{out}/g^2", typical=0.02, doc="scale factor per g along the other in-plane axis")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return a * other_in_plane(a) * p.slope
