from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.effects.warm_up import TIME_CONSTANT, begin_s, remaining_share
from calibrations.table import Array, Table


class WarmUpScale(Effect):
    """warm-up-scale: after power-on the scale factor settles exponentially.

        V += A_i exp(-(t - t0) / tau) r_i      A in {out}/g, one per axis; tau in s; t0: start of the record

        r_i = a_i + N_i / SF_i, with all that nonlinear effects add, N_i: the drift multiplies the whole response

    Symptom   the residual decays with time, in proportion to the specific force of its own axis.
    Excited by  a record that starts soon after power-on, with +1 g and -1 g on each axis throughout.
    Confused with  temperature-scale while the sensor warms up. To separate them, hold the temperature constant.
    Source    Ang III.B; Barshan and Durrant-Whyte (1995); IEEE Std 528, warm-up time.
    """

    scales = True
    kinds = ("poses", "positions")
    needs = ("t_s",)

    amplitude = Parameter("{out}/g", typical=0.01, doc="scale factor at the record's beginning less the final one")
    time_constant = TIME_CONSTANT
    begin_s = Constant(begin_s)

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return remaining_share(table, p)[:, None] * a * p.amplitude
