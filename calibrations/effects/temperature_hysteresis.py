"""temperature-hysteresis: the zero-g output follows the temperature with play: it lags where temperature turns back.

    V += s_i (P - T0)      P: temperature behind a play of +-r; s in {out}/K, one per axis; r in K; T0 the data's mean

Symptom   the residual follows temperature along another line when it falls than when it rises.
Excited by  temperature that rises and falls by more than the play.
Confused with  temperature-bias where temperature does not turn back; a temperature cycle tells them apart.
Source    Book 17.3.12; IEEE Std 1293, thermal hysteresis; the play operator: Krasnoselskii and Pokrovskii (1989).
"""

from collections.abc import Sequence

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.kernels import play
from calibrations.table import Array, Table

KINDS = ("poses", "positions")
NEEDS = ("temperature_c", "t_s")
CONTAINS = ("temperature-bias",)
PARAMETERS = (
    Parameter("slope", "{out}/K", typical=0.001, doc="bias per kelvin, once the play is gone through"),
    Parameter("play", "K", typical=0.1, per_axis=False, starts=(0.3,), low=0.0, doc="half of its width"),
)
PARTS = (0.05, 0.15, 0.35)  # of the range of temperatures: plays to begin with
STARTS = {"play": lambda table: np.outer(PARTS, np.full(len(table.axes), np.ptp(table.column("temperature_c"))))}
MEMORY = 1
CONSTANTS = {"reference_c": lambda table: float(np.mean(table.column("temperature_c")))}


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.outer(play(table.column("temperature_c"), float(p["play"])) - p["reference_c"], p["slope"])


def follow(a: Array, table: Table, p: Values, before: Sequence[Array]) -> tuple[Array, list[Array]]:
    """`before` and after: the temperature behind the play, less T0, K; so it begins at T0."""
    (held,) = before
    from_t0 = (table.column("temperature_c") - p["reference_c"])[:, None]
    lagging = np.minimum(np.maximum(held, from_t0 - p["play"]), from_t0 + p["play"])
    return lagging * p["slope"], [lagging]
