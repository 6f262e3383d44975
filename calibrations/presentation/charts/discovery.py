"""Charts of a discovery: the falling error, the curve of each effect, and all charts of its report with captions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import log10

import numpy as np

from calibrations.analyses.motion import MotionResult
from calibrations.discovery.findings import F, Step
from calibrations.discovery.results import Comparison, Discovery
from calibrations.fitting.fit import Fit, milli_unit, pool_in_milli
from calibrations.presentation.chart import (
    GOOD,
    MEASURED,
    MODEL,
    UNSEEN,
    Axis,
    Bars,
    Chart,
    Panel,
    Picture,
    Points,
    Span,
    single_chart,
)
from calibrations.presentation.charts.contribution import change_of, select_telling_column
from calibrations.presentation.charts.fit import drawn_channels, fit_album, residual, row_height, scale_of
from calibrations.presentation.charts.motion import evaluation
from calibrations.presentation.charts.places import Falling, place_pictures
from calibrations.presentation.residual import ChannelResidual, choices, first_choices
from calibrations.text import milli_amount, rounded

BELOW = 0.5  # times the floor: where the logarithmic axis begins
SHORTEST_SHARE = 0.7  # of the smallest error, if that is below: its bar is seen
FEWEST = 4  # bars that there is room for: one alone is no thicker than they
MANY_BARS = 8  # more bars have short texts, which fit beside them
NEAR = 1.15  # times the floor: as good as noise
LONG = 0.5  # of the axis: a bar that its text fits into
ROW = 0.42  # inches
MANY_EFFECTS = 2  # in the name of a model: more are counted, so that bars have room
MOST_CURVES = 4


@dataclass(frozen=True)
class ErrorLevel:
    """The error of a model in multiples of the noise floor (for noise: of chance), on rows of the fit and on others.

    `rms` is the same error in its unit, such as "3.8 mg".
    """

    name: str
    seen: float
    unseen: float
    rms: str


@dataclass(frozen=True)
class Measure:
    """Words of the falling error: the label of its axis, and the names of both kinds of rows."""

    axis: str = "rms error / noise floor"
    over: str = "the noise floor"
    seen: str = "rows of the fit"
    unseen: str = "rows not used in the fit"


def levels(steps: Falling) -> list[ErrorLevel]:
    """The model as it was, then each effect added."""
    return model_levels(steps.start, steps.steps, error_text)


def model_levels(start: F, steps: Sequence[Step[F]], text: Callable[[F], str]) -> list[ErrorLevel]:
    """The model as it was, then each effect added; `text` writes the error of a fit with its unit."""
    first = ErrorLevel(brief(start.model.name), start.pooled_excess, start.held_out_excess, text(start))
    return [first, *(ErrorLevel(f"+ {s.name}", s.after.pooled_excess, s.held_out_after, text(s.after)) for s in steps)]


def brief(model: str) -> str:
    """The name of a model with many effects in a few words: `linear + 9 effects`."""
    first, *effects = model.split("+")
    return model if len(effects) < MANY_EFFECTS else f"{first} + {len(effects)} effects"


def error_text(fit: Fit) -> str:
    """The rms error with its unit."""
    return milli_amount(pool_in_milli(fit)[0], milli_unit(fit), 2)


def waterfall(steps: Sequence[ErrorLevel], words: Measure = Measure()) -> Chart:
    """Error by model: a bar for the model as it was, one more for each effect added; the band is the noise floor.

    Bars are errors on rows of the fit, diamonds on rows that the fit did not use.
    """
    excess, unseen = (np.array([getattr(level, name) for level in steps], float) for name in ("seen", "unseen"))
    reach = 2.2 * max(*excess, *unseen, 3.0)
    begin = min([BELOW, *(SHORTEST_SHARE * value for value in excess if value > 0)])
    colours = [MODEL, *(GOOD if value < NEAR else MEASURED for value in excess[1:])]
    units = [f" ({level.rms})" if len(steps) <= MANY_BARS else "" for level in steps]
    texts = [f"{rounded(level.seen)} ×{in_unit}" for level, in_unit in zip(steps, units, strict=True)]
    text_inside = [log10(max(value, begin) / begin) > LONG * log10(reach / begin) for value in excess]
    hover = [f"{rounded(value)} × {words.over} on {words.unseen}" for value in unseen]
    series = (
        Span(begin, 1.0, "x"),
        Bars(begin, excess, colours, texts, text_inside, starts=np.fmax(excess, unseen)),  # behind the diamond
        Points(unseen, np.arange(len(steps), dtype=float), colour=UNSEEN, symbol="diamond", size=10, hover=hover),
    )
    x = Axis(words.axis, log=True, low=begin, high=reach)
    y = Axis(low=-0.5, high=max(len(steps), FEWEST) - 0.5, names=tuple(level.name for level in steps), reverse=True)
    return single_chart(Panel(series, x, y), 0.6 + ROW * max(len(steps), FEWEST))


def effect_chart(step: Step[Fit]) -> Chart:
    """A row for each channel: the residual before with the effect's curve through it, and the residual after."""
    columns_of_fit = choices(step.before)
    colour, x = columns_of_fit[first_choices(list(columns_of_fit), step.before.table)[1]], select_telling_column(step)
    rows = []
    for k, c in enumerate(drawn_channels(step.before, change_of(step))):
        titles = (f"before; line: {step.name}", "after") if k == 0 else ("", "")
        channel_before, channel_after = (ChannelResidual(fit, c, False) for fit in (step.before, step.after))
        rows.append((
            residual(channel_before, x, colour, step, title=titles[0]),
            residual(channel_after, x, colour, second=True, title=titles[1]),
        ))  # fmt: skip
    bar = None if step.before.table.type.moving else scale_of(colour, 0)
    return Chart(tuple(rows), row_height(step.before), share_y=True, bar=bar)


def album(discovery: Discovery[Fit], compared: Comparison[Fit], motion: MotionResult | None = None) -> list[Picture]:
    """Error by model, the given model and its data, the residual pattern, and each effect's curve.

    The result of a run of the procedure motion comes first, if it is given.
    """
    falling, *effects = steps_album(discovery)
    return [*(_motion_picture(result) for result in (motion,) if result), falling, *fit_album(compared.fit), *effects]


def steps_album(discovery: Discovery[Fit]) -> list[Picture]:
    """Error by model, each effect's curve, and the curves of places."""
    rows = discovery.start.table.type.rows
    fall = (
        "Error of the model before and after each effect, as a multiple of the noise floor (grey): "
        f"bars on the {rows} of the fit, diamonds on {rows} that the fit did not use."
    )
    return [
        Picture("waterfall", "Error by model", fall, waterfall(levels(discovery))),
        *(_curve(step, discovery) for step in notable_steps(discovery)),
        *place_pictures(discovery),
    ]


def _motion_picture(motion: MotionResult) -> Picture:
    """Fig. 12 of the paper."""
    caption = (
        "Above: acceleration along x by the sensor (full line) and by the displacement sensor (dotted), over the first "
        "half second. Below: the difference; the grey band is the difference by the sensor's noise alone, one standard "
        "deviation each way. Both are in the paper's band, a second-order low-pass at 20 Hz (Ang, Fig. 12)."
    )
    return Picture("evaluation", "Both models and the displacement sensor", caption, evaluation(motion))


def notable_steps(discovery: Discovery[Fit]) -> tuple[Step[Fit], ...]:
    """The effects that reduced the error most, in the order added; where none was kept, the best that was tried."""
    if not discovery.steps:
        return discovery.findings.tried[:1]
    least = sorted((_fall(step) for step in discovery.steps), reverse=True)[:MOST_CURVES][-1]
    return tuple(step for step in discovery.steps if _fall(step) >= least)


def _fall(step: Step[Fit]) -> float:
    """The factor by which a step reduces the error."""
    return step.before.pooled_excess / step.after.pooled_excess


def _curve(step: Step[Fit], discovery: Discovery[Fit]) -> Picture:
    remark = "" if discovery.steps else "This effect was tried and not kept: it does not explain the residual. "
    is_turned = np.any(step.before.table.optional("direction", 0.0) != 0)
    sides = " (full line clockwise, broken line anticlockwise)" if is_turned else ""
    caption = (
        f"{remark}Left: the residual before, and the part explained by {step.name}{sides}. Right: the residual after, "
        "on the same scale."
    )
    if len(drawn_channels(step.before, change_of(step))) < len(step.before.channels):
        caption += " Outputs that it does not change are left out."
    return Picture(f"effect-{step.name}", f"Contribution of {step.name}", caption, effect_chart(step))
