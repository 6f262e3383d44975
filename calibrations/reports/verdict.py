"""The verdict of a diagnosis in a sentence."""

from __future__ import annotations

from calibrations.diagnose import Diagnosis
from calibrations.search.share import MATERIAL


def headline(result: Diagnosis) -> str:
    """The verdict in a sentence."""
    if result.verdict == "adequate":
        scatter = float(max(result.fit.noise.scatter / result.fit.noise.floor)) if result.fit.noise.known else 0.0
        rest = f" Scatter of {scatter:.1f} x the noise floor has no pattern." if scatter > 1 else ""
        return f"nothing is missing; what is left is noise.{rest}"
    if result.verdict == "unexplained":
        return f"nothing in the catalogue explains this. Left over: {result.residual_structure}."
    if not result.path.steps:
        return f"nothing shows that an effect is missing, but {result.caution}."
    best = result.candidates[0]
    if result.verdict == "ambiguous":
        rivals = " or ".join((best.name, *best.indistinguishable_from))
        return f"an effect is missing: {rivals}; this data cannot tell which."
    return f"an effect is missing: {best.name}.{_more(result)}"


def _more(result: Diagnosis) -> str:
    """What is left once the effect is added, where that is more than noise."""
    left = result.path.steps[0].held_out_after
    return f" More may be: with it, {left:.3g} x the noise floor is left on unseen poses." if left > MATERIAL else ""
