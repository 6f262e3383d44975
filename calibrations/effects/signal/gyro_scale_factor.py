from functools import partial

import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.geometry.rate_table import is_turned, rate_scales
from calibrations.table import AXES, Array, Table


def _mean_of_turned(table: Table) -> float:
    scales = rate_scales(table)
    return float(np.mean(np.abs(scales[scales != 0])))


class GyroScaleFactor(Effect):
    """gyro-scale-factor: the output of a gyroscope per unit of angular rate.

        V += k w          k in {out}/(deg/s), one for each axis about which the sensor was turned

    An axis without turns gets the mean of the others, so that its misalignment can be computed.

    Symptom   the residual is proportional to the rate about the axis itself.
    Excited by  turns at constant rates, in both directions, about each axis.
    Confused with  nothing, if the rate has several values.
    Source    Book 17.3.7; IEEE Std 528, scale factor.
    """

    kinds = ("rates", "turns")

    scale = Parameter("{out}/(deg/s)", typical=1.0, where="turned", guess=rate_scales, doc="change of output per deg/s")
    turned_x = Constant(partial(is_turned, axis=0), doc="turns about x measured (1: yes, 0: no)")
    turned_y = Constant(partial(is_turned, axis=1), doc="turns about y measured (1: yes, 0: no)")
    turned_z = Constant(partial(is_turned, axis=2), doc="turns about z measured (1: yes, 0: no)")
    assumed = Constant(_mean_of_turned, doc="scale factor of an axis without turns, taken as the mean of the others")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        turned = np.array([p[f"turned_{axis}"] for axis in AXES]) > 0
        return a * np.where(turned, p.scale, p.assumed)
