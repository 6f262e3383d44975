from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import out_of_plane
from calibrations.table import Array, Table


class ZAxisScale(Effect):
    """z-axis-scale: the scale factor follows the out-of-plane axis.

        V += (r1 a_o + r2 a_o^2) r_i          r1 in {out}/g^2, r2 in {out}/g^3, per axis; IEEE K_io = r1 / K1

        r_i = a_i + N_i / SF_i, with all that nonlinear effects add, N_i: it multiplies the whole response

    Symptom   the slope of the output over the specific force of its own axis differs between inclinations.
    Excited by  full turns of beta at three inclinations or more, below and above alpha = 90 deg.
    Confused with  scale-factor, at one inclination; an error of the stage angle alpha, which also changes sin(alpha).
    Source    Ang (15), r1 and r2; IEEE Std 1293, K_io.
    """

    of_force = True
    scales = True
    slope = Parameter("{out}/g^2", typical=0.02, doc="scale factor per out-of-plane g")
    square = Parameter("{out}/g^3", typical=0.02, doc="scale factor per square of the out-of-plane g")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        o = out_of_plane(a)
        return a * (o * p.slope + o**2 * p.square)
