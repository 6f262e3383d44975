import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.sphere import HARD_IRON, coverage_fault, sphere_centre
from calibrations.table import Array, Table


class HardIron(Effect):
    """hard-iron: a magnet that turns with the sensor adds a constant field.

        V += h          h in {out}, one per axis; it contains the zero offset of the sensor

    Symptom   the magnitude is larger on one side and smaller on the other: circles and spheres are off centre.
    Excited by  orientations to all sides; a horizontal turn shows two of the three components.
    Confused with  soft-iron, if the orientations cover only one side of the sphere.
    Source    Book 17.5, Fig. 17.12; Renaudin, Afzal and Lachapelle, Journal of Sensors (2010).
    """

    kinds = ("fields",)
    exact = True

    offset = Parameter(
        "{out}",
        typical=0.5,
        guess=lambda table: sphere_centre(table.outputs),
        doc="constant field that turns with the sensor",
    )

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return np.broadcast_to(p.offset, a.shape)

    def lacks(self, table: Table) -> str | None:
        return coverage_fault(table, HARD_IRON)
