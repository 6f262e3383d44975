"""The verdict of a diagnosis in a sentence."""

from __future__ import annotations

from calibrations.diagnose import Diagnosis
from calibrations.search.candidates import SIGNIFICANT
from calibrations.search.share import MATERIAL

DOUBTFUL = 0.05  # chance, over the whole search, below which a candidate is worth a second measurement


def headline(result: Diagnosis) -> str:
    """The verdict in a sentence."""
    if result.verdict == "adequate":
        scatter = float(max(result.fit.noise.scatter / result.fit.noise.floor)) if result.fit.noise.known else 0.0
        rest = f" Scatter of {scatter:.1f} x the noise floor has no pattern." if scatter > 1 else ""
        return (_doubtful(result) or "nothing is missing; what is left is noise.") + rest
    if result.verdict == "unexplained":
        return f"nothing in the catalogue explains this. Left over: {result.residual_structure}."
    if not result.path.steps:
        return f"nothing shows that an effect is missing, but {result.caution}."
    best = result.candidates[0]
    if result.verdict == "ambiguous":
        rivals = " or ".join((best.name, *best.indistinguishable_from))
        return f"an effect is missing: {rivals}; this data cannot tell which."
    return f"an effect is missing: {best.name}.{_more(result)}"


def _doubtful(result: Diagnosis) -> str | None:
    """What chance alone would seldom show, though too often to name it; None where there is none."""
    best = next(iter(result.candidates), None)
    if best is None or best.p_value >= DOUBTFUL or best.held_out_after >= result.held_out_before:
        return None
    return (
        f"nothing is missing beyond what chance may show, but {best.name} comes near: chance alone shows as much "
        f"in {best.p_value:.1%} of such searches, and an effect is named below {SIGNIFICANT:.1%}; measure once more to "
        "tell."
    )


def _more(result: Diagnosis) -> str:
    """What is left once the effect is added, where that is more than noise."""
    left = result.path.steps[0].held_out_after
    return f" More may be: with it, {left:.3g} x the noise floor is left on unseen poses." if left > MATERIAL else ""
