import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.effects.warm_up import TIME_CONSTANT, begin_s, remaining_share
from calibrations.table import Array, Table


class WarmUpBias(Effect):
    """warm-up-bias: after power-on the zero-g output settles exponentially.

        V += A_i exp(-(t - t0) / tau)          A in {out}, one per axis; tau in s; t0: start of the record

    Symptom   the residual decays with time, fast at first, by the same amount at every angle.
    Excited by  a record that starts soon after power-on and lasts longer than the time constant.
    Confused with  temperature-bias while the sensor warms up; bias-drift, if the record is short. To separate them,
              hold the temperature constant, or run a soak.
    Source    Ang III.B and Fig. 10; Barshan and Durrant-Whyte (1995); IEEE Std 528, warm-up time.
    """

    kinds = ("poses", "positions", "fields", "motion", "rates")
    needs = ("t_s",)

    amplitude = Parameter("{out}", typical=0.01, doc="bias at the record's beginning less the final one")
    time_constant = TIME_CONSTANT
    begin_s = Constant(begin_s)

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return np.outer(remaining_share(table, p), p.amplitude)
