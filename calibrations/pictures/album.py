"""All pictures that a discovery calls for, in the order of its story, each with a name, a title and a caption."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.figure import Figure

from calibrations.compare import Comparison
from calibrations.discover import Added, Discovery
from calibrations.motion.evaluate import MotionResult
from calibrations.pictures import candidate, failure, measurement, motion, residual, waterfall
from calibrations.units import rows_of

MOST_CURVES = 4
POSES = (
    "Dots are measured, lines are the model {}.",
    "The residual of the model {} over both stage angles; pale is near the noise.",
)
MOTION = (
    "Output over a few periods, less its mean: dots are measured, lines are the model {}.",
    "What the model {} leaves over one period of the motion's strongest line: means of all periods, with their noise.",
)
POSITIONS = (
    "What the model {} makes of each position: the magnitude of gravity, 1 g if it were right.",
    "The residual of the model {} over the direction that gravity came from; pale is near the noise.",
)


RATES = (
    "Dots are measured, crosses are what the model {} makes of the same turn.",
    "The residual of the model {} over the rate of the turn.",
)
FIELDS = (
    "What the model {} makes of each position: the magnitude of the field, 1 if it were right.",
    "The residual of the model {} over the direction that the field came from; pale is near the noise.",
)
CAPTIONS = {"poses": POSES, "motion": MOTION, "rates": RATES, "fields": FIELDS}


@dataclass(frozen=True)
class Picture:
    """A figure, the name of its file without ending, and words for a page."""

    name: str
    title: str
    caption: str
    figure: Figure


def album(found: Discovery, beside: Comparison, shaken: MotionResult | None = None) -> list[Picture]:
    """The falling error, the model given beside its data and where it fails, then each effect's curve.

    Before them stands what a run of the procedure motion found, if it is given.
    """
    fit = beside.fit
    model, rows = fit.model.name, rows_of(fit.table)
    shown, mapped = CAPTIONS.get(fit.table.content, POSITIONS)
    fall = (
        "Error of the model before and after each effect, as a multiple of the noise floor: "
        f"bars on the {rows} that the fit used, diamonds on {rows} that it did not see."
    )
    left = f"Measured less the model {model}. The grey band is the noise floor, one standard deviation each way."
    return [
        *(_beside_displacement(each) for each in (shaken,) if each),
        Picture("waterfall", "The falling error", fall, waterfall.picture(found)),
        Picture("measurement", "Measurement beside model", shown.format(model), measurement.picture(fit)),
        Picture("residual", "What the model leaves", left, residual.picture(fit)),
        Picture("failure", "Where it fails", mapped.format(model), failure.picture(fit)),
        *(_curve(step, found) for step in tried(found)),
    ]


def _beside_displacement(shaken: MotionResult) -> Picture:
    """Fig. 12 of the paper."""
    caption = (
        "Above: acceleration along x by the sensor (full line) and by the displacement sensor (dotted), over the first "
        "half second. Below: the difference; the grey band is what the sensor's noise alone leaves, one standard "
        "deviation each way. Both sides in the paper's band, a second-order low-pass at 20 Hz (Ang, Fig. 12)."
    )
    return Picture("evaluation", "Both models beside the displacement sensor", caption, motion.evaluation(shaken))


def tried(found: Discovery) -> tuple[Added, ...]:
    """The effects that took off most, in the order added; where none was kept, the best that was tried."""
    if not found.steps:
        return tuple(Added(step.taken.name, step.before, step.after) for step in found.path.steps[:1])
    least = sorted((_fall(step) for step in found.steps), reverse=True)[:MOST_CURVES][-1]
    return tuple(step for step in found.steps if _fall(step) >= least)


def _fall(step: Added) -> float:
    """By which factor the error falls."""
    return step.before.pooled_excess / step.after.pooled_excess


def _curve(step: Added, found: Discovery) -> Picture:
    kept = "" if found.steps else "It was tried and not kept: it does not explain what is left. "
    caption = (
        f"{kept}Left: the residual before, and the part that {step.name} takes off it (full line clockwise, broken "
        "line anticlockwise). Right: the residual after, on the same scale."
    )
    return Picture(f"effect-{step.name}", f"What {step.name} explains", caption, candidate.picture(step))
