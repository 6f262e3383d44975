import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.effects.logged import LEVEL_DOC, follows_level, sensor_temperature_c
from calibrations.table import Array, Table


class TemperatureScale(Effect):
    """temperature-scale: the scale factor follows the temperature.

        V += slope (T - T0) r_i          slope in {out}/g/K, one per axis; T0: mean temperature of the data

        r_i = a_i + N_i / SF_i, with all that nonlinear effects add, N_i: the drift multiplies the whole response

    Symptom   the residual follows the temperature, in proportion to the specific force of its own axis.
    Excited by  a run in which the temperature changes while the axis goes from -1 g to +1 g.
    Confused with  z-axis-scale, if each inclination has its own temperature. To separate them, hold the temperature
              constant.
    Source    Book 17.3.7 and 17.3.12.
    """

    scales = True
    needs = ("temperature_c",)

    slope = Parameter("{out}/g/K", typical=0.001, doc="scale factor per kelvin")
    lead_s = Constant(lambda _: 0.0, doc="lead of the sensor before the thermometer (s)")  # a search finds it
    level = Constant(lambda table: follows_level(table, ["temperature_c"], scales=True), assumed=0.0, doc=LEVEL_DOC)
    reference_c = Constant(lambda table: float(np.mean(table.column("temperature_c"))))

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        warmer = sensor_temperature_c(table, float(p.lead_s), bool(p.level)) - p.reference_c
        return warmer[:, None] * a * p.slope
