"""temperature-bias: the zero-g output follows the temperature.

    V += slope (T - T0)                               slope in {out}/K, one per axis; T0 the data's mean temperature

Symptom   the residual follows temperature, the same at every angle.
Excited by  any run in which temperature changes.
Confused with  warm-up and drift, where temperature rises with time; a hold at constant temperature tells them apart.
Source    Book 17.3.12; Ang III.B.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

KINDS = ("poses", "positions", "fields", "motion", "rates")
NEEDS = ("temperature_c",)
PARAMETERS = (Parameter("slope", "{out}/K", typical=0.005, doc="output per kelvin"),)
CONSTANTS = {"reference_c": lambda table: float(np.mean(table.column("temperature_c")))}


def transduction(a: Array, table: Table, p: Values) -> Array:
    warmer = table.column("temperature_c") - p["reference_c"]
    return warmer[:, None] * p["slope"]
