import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.effects.logged import LEVEL_DOC, follows_level, level
from calibrations.table import Array, Table


class SupplySensitivity(Effect):
    """supply-sensitivity: the output follows the supply voltage.

        V <- V (1 + k (S / S0 - 1))          k: 1 for a ratiometric output; S0: mean supply voltage of the data

    Symptom   the residual follows the supply voltage, in proportion to the output.
    Excited by  a run in which the supply voltage is logged and changes.
    Confused with  drift, if the supply voltage changes steadily with time.
    Source    ADXL203 data sheet (ratiometric output); IEEE Std 1293, supply voltage sensitivity.
    """

    needs = ("supply_v",)

    share = Parameter("1", typical=1.0, doc="relative change of the output over that of the supply")
    reference_v = Constant(lambda table: float(np.mean(table.column("supply_v"))))
    level = Constant(lambda table: follows_level(table, ["supply_v"]), doc=LEVEL_DOC)

    def output(self, v: Array, table: Table, p: Values) -> Array:
        supply_v = level(table, "supply_v") if p.level else table.column("supply_v")
        excess = supply_v / p.reference_v - 1
        return v * (1 + excess[:, None] * p.share)
