"""temperature-scale: the scale factor follows the temperature.

    V += slope (T - T0) a_i                           slope in {out}/g/K, one per axis; T0 the data's mean temperature

Symptom   the residual follows temperature, in proportion to the axis's own specific force.
Excited by  a run in which temperature changes while the axis goes from -1 g to +1 g.
Confused with  z-axis-scale, where each inclination has a temperature of its own; a hold tells them apart.
Source    Book 17.3.7 and 17.3.12.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

NEEDS = ("temperature_c",)
PARAMETERS = (Parameter("slope", "{out}/g/K", typical=0.001, doc="scale factor per kelvin"),)
CONSTANTS = {"reference_c": lambda table: float(np.mean(table.column("temperature_c")))}


def transduction(a: Array, table: Table, p: Values) -> Array:
    warmer = table.column("temperature_c") - p["reference_c"]
    return warmer[:, None] * a * p["slope"]
