import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.effects.logged import LEVEL_DOC, follows_level, sensor_temperature_c
from calibrations.table import Array, Table


class TemperatureBias(Effect):
    """temperature-bias: the zero-g output follows the temperature.

        V += slope (T - T0)          slope in {out}/K, one per axis; T0: mean temperature of the data

    Symptom   the residual follows the temperature, by the same amount at every angle.
    Excited by  any run in which the temperature changes.
    Confused with  warm-up-bias and bias-drift, if the temperature rises with time. To separate them, hold the
              temperature constant.
    Source    Book 17.3.12; Ang III.B.
    """

    kinds = ("poses", "positions", "fields", "motion", "rates")
    needs = ("temperature_c",)

    slope = Parameter("{out}/K", typical=0.005, doc="output per kelvin")
    lead_s = Constant(lambda _: 0.0, doc="lead of the sensor before the thermometer (s)")  # a search finds it
    level = Constant(lambda table: follows_level(table, ["temperature_c"]), assumed=0.0, doc=LEVEL_DOC)
    reference_c = Constant(lambda table: float(np.mean(table.column("temperature_c"))))

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        warmer = sensor_temperature_c(table, float(p.lead_s), bool(p.level)) - p.reference_c
        return warmer[:, None] * p.slope
