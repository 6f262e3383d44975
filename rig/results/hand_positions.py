"""hand-positions: bias, scale factor and angles of a triaxial accelerometer that a person turned."""

from __future__ import annotations

import math

from calibrations.analyses.hand_positions import ANGLES, fit_positions, largest_uncertainty_g
from rig.record.measured import Measured
from rig.results.result import Missing, Result, result

PAIRS = ("xy", "xz", "yz")
NAMES = ("bias-{axis}", "scale-{axis}", *(f"nonorthogonality-{pair}" for pair in PAIRS), "uncertainty")


def evaluate(measured: Measured) -> dict[str, Result | Missing]:
    """From all positions together, by the magnitude of gravity:

    bias                 output without specific force, in the unit of the outputs
    scale                that unit per g
    nonorthogonality-xy  deg, departure of the angle between two sensing axes from 90 deg
    uncertainty          g, the largest standard uncertainty of these as an error at 1 g

    The uncertainty is Missing if it is above the setting target_g: the run ended at most_positions.
    """
    fit = fit_positions(measured.table())
    results = {f"bias-{e.axis}": result(e) for e in fit.model.estimates("bias")}
    results |= {f"scale-{e.axis}": result(e) for e in fit.model.estimates("scale-factor")}
    results |= {f"nonorthogonality-{e.name}": result(e) for e in fit.model.estimates(ANGLES)}
    worst_g, parameter = largest_uncertainty_g(fit)
    target_g = float(measured.run.settings.get("target_g", math.inf))
    if worst_g > target_g:
        why = (
            f"{parameter} is known to {worst_g:.2g} g only, wanted {target_g:g} g; take more positions, or longer rests"
        )
        return results | {"uncertainty": Missing(why)}
    return results | {"uncertainty": Result(worst_g, "g")}
