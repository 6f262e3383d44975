import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.sphere import sphere_radius
from calibrations.table import Array, Table


class FieldStrength(Effect):
    """field-strength: the strength of the local field, in units of the output.

        V += F m          m: direction of the field, a unit vector; F in {out}, one for all axes

    Symptom   the mean magnitude of the output differs from the assumed one.
    Excited by  any data.
    Confused with  a scale factor shared by all axes: a magnetometer is calibrated with a field of known strength.
    Source    Book (17.6).
    """

    kinds = ("fields",)

    total = Parameter(
        "{out}",
        typical=1.0,
        per_axis=False,
        starts=(1.0,),
        low=1e-12,
        guess=lambda table: np.full(3, sphere_radius(table)),
        doc="F (17.6)",
    )

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return a * p.total
