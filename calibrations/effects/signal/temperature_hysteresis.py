from collections.abc import Sequence

import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.effects.logged import LEVEL_DOC, sensor_temperature_c
from calibrations.table import Array, Table

PARTS = (0.05, 0.15, 0.35)  # of the range of temperatures: plays to begin with


class TemperatureHysteresis(Effect):
    """temperature-hysteresis: the zero-g output follows the temperature with a lag where the temperature reverses.

        V += s_i (P - T0)      P: temperature behind a play of +-r; s in {out}/K, one per axis; r in K
                               T0: mean temperature of the data

    Symptom   the residual follows one line while the temperature rises and another while it falls.
    Excited by  temperature that rises and falls by more than the play.
    Confused with  temperature-bias, if the temperature does not reverse. To separate them, run a temperature cycle.
    Source    Book 17.3.12; IEEE Std 1293, thermal hysteresis; the play operator: Krasnoselskii and Pokrovskii (1989).
    """

    kinds = ("poses", "positions")
    needs = ("temperature_c", "t_s")
    contains = ("temperature-bias",)
    memory = 1

    slope = Parameter("{out}/K", typical=0.001, doc="bias per kelvin, after the temperature has crossed the play")
    play = Parameter(
        "K",
        typical=0.1,
        per_axis=False,
        starts=(0.3,),
        low=0.0,
        guess=lambda table: np.outer(PARTS, np.full(len(table.axes), np.ptp(table.column("temperature_c")))),
        doc="half of its width",
    )
    level = Constant(lambda _: 0.0, assumed=0.0, doc=LEVEL_DOC)  # a search sets it
    reference_c = Constant(lambda table: float(np.mean(table.column("temperature_c"))))

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        from calibrations.effects.kernels import play  # numba is slow to import

        temperature_c = sensor_temperature_c(table, 0.0, bool(p.level))
        return np.outer(play(temperature_c, float(p.play)) - p.reference_c, p.slope)

    def follow(self, a: Array, table: Table, p: Values, before: Sequence[Array]) -> tuple[Array, list[Array]]:
        """`before` and after: the temperature behind the play, less T0, K; so it begins at T0."""
        (memory,) = before
        from_t0 = (table.column("temperature_c") - p.reference_c)[:, None]
        lagging = np.minimum(np.maximum(memory, from_t0 - p.play), from_t0 + p.play)
        return lagging * p.slope, [lagging]
