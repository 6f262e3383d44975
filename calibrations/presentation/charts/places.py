"""Charts of places of the signal chain: the curve of each with its band, and the falling error as shares by place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from calibrations.discovery.curves import CurveRows, PlaceCurve, place_curve
from calibrations.discovery.findings import Step
from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.errors import CalibrationError
from calibrations.fitting.fit import Fit, fit
from calibrations.free_forms.place_names import EFFECTS_AT, KINDS_OF_FORMS, PREFIX, place_of_effect
from calibrations.model import Model
from calibrations.presentation.chart import (
    AMBER,
    BAND,
    BLUE,
    GREEN,
    INK,
    PURPLE,
    QUIET,
    VERMILION,
    Axis,
    Band,
    Bars,
    Chart,
    Line,
    Panel,
    Picture,
    Rule,
    Series,
    side_by_side,
    single_chart,
)
from calibrations.table import Array, Table
from calibrations.text import in_milli, rounded

MOST_PLACES, MOST_FORMS = 6, 3  # that are drawn: places, and catalogue forms through the curve of one
MOST_ROWS = 130  # to which a form is fitted
LEAST_SHARE = 0.3  # of a curve's variance that a form must take up to be drawn
COVERAGE = 1.96  # standard uncertainties: a band of 95 %
FEWEST_BARS, ROW = 4, 0.42  # rows that there is room for; inches a row
BASE = ("bias", "scale-factor")
UNEXPLAINED, LINEAR, MINOR_PLACES = "not explained", "bias, scale factor and geometry", "other places"
MOST_SHARES = 5  # places with a colour of their own
SHARES_CAPTION = (
    "Variance of the residual beyond the noise, by the place of the signal chain that causes it; each model leaves "
    "less. The last part is what no effect of the model explains."
)
PLACE_COLOURS = (BLUE, VERMILION, GREEN, AMBER, PURPLE)
FORM_COLOURS = (VERMILION, GREEN, PURPLE)


class Falling(Protocol):
    """A fit, and the steps from there: a discovery, or a model that a person extends."""

    @property
    def start(self) -> Fit: ...

    @property
    def steps(self) -> tuple[Step[Fit], ...]: ...


@dataclass(frozen=True)
class FittedForm:
    """A form of the catalogue through the curve of a place: its own curve, and its share of that one's variance."""

    name: str
    curve: PlaceCurve
    share: float


def place_pictures(steps: Falling) -> list[Picture]:
    """The falling error as shares by place, and the curve of each place of the last model, the largest first."""
    end = _end(steps)
    curves = model_curves(end)
    if not curves:
        return []
    shares = Picture("shares", "Explained share by place", SHARES_CAPTION, shares_chart(steps))
    return [*([shares] if steps.steps else []), *(_picture(curve, forms_through(end, curve)) for curve in curves)]


def model_curves(end: Fit) -> list[PlaceCurve]:
    """The curve of each place at which the model has an effect, the largest first."""
    if end.table.content not in KINDS_OF_FORMS:
        return []
    places = dict.fromkeys(place_of_effect(term.name) for term in end.model.terms)
    curves = [curve for place in places if place and (curve := place_curve(end, place)) is not None]
    return sorted(curves, key=lambda curve: -_size(curve, end))[:MOST_PLACES]


def forms_through(end: Fit, curve: PlaceCurve) -> list[FittedForm]:
    """Forms of the catalogue fitted to the curve of unknown form at a place, the best first; none without such a curve.

    They are fitted to what bias, scale factor and this place predict, without noise; not to motion, whose output passes
    a filter.
    """
    if not end.model.holds(f"{PREFIX}{curve.place}") or end.table.type.moving:
        return []
    others = [t.name for t in end.model.terms if t.name not in BASE and place_of_effect(t.name) != curve.place]
    rows = CurveRows.of(end)
    predicted = rows.output(end.theta, without=others)
    table = replace(
        rows.table, columns={**rows.table.columns, **dict(zip(rows.table.output_names, predicted, strict=True))}
    )
    table = table.rows(np.arange(0, table.n, max(1, table.n // MOST_ROWS)))  # without noise, a part of the poses does
    base = replace(end.model, terms=tuple(term for term in end.model.terms if term.name in BASE))
    effects_by_name = catalogue()
    effects = [effects_by_name[name] for name in EFFECTS_AT.get(curve.place, ()) if name in effects_by_name]
    fitted = [
        fitted_form for effect in effects if (fitted_form := _fit_form(base, effect, end, table, curve)) is not None
    ]
    return sorted((t for t in fitted if t.share >= LEAST_SHARE), key=lambda t: -t.share)[:MOST_FORMS]


def _fit_form(base: Model, effect: Effect, end: Fit, table: Table, curve: PlaceCurve) -> FittedForm | None:
    """One form; None where it cannot be fitted to this table."""
    if effect.excluded(end.table) is not None:
        return None
    try:
        form_curve = place_curve(fit(base.with_effect(effect), table), curve.place)
    except (CalibrationError, np.linalg.LinAlgError):
        return None
    if form_curve is None:
        return None
    unexplained = total = 0.0
    for axis, value in curve.value.items():
        form = np.interp(curve.at[axis], form_curve.at[axis], form_curve.value[axis])
        unexplained += float(np.sum((value - form - np.mean(value - form)) ** 2))
        total += float(np.sum((value - np.mean(value)) ** 2))
    return FittedForm(effect.name, form_curve, 1 - unexplained / total if total > 0 else 0.0)


def curve_chart(curve: PlaceCurve, forms: Sequence[FittedForm] = ()) -> Chart:
    """A panel for each axis: the curve with its band of 95 %, and forms of the catalogue through it."""
    return side_by_side([curve_panel(curve, axis, forms) for axis in curve.value], 3.2, share_y=True)


def curve_panel(curve: PlaceCurve, axis: str, forms: Sequence[FittedForm] = ()) -> Panel:
    """The curve of one axis."""
    scale, unit = in_milli(curve.unit)
    abscissas, value, band = curve.at[axis], scale * curve.value[axis], COVERAGE * scale * curve.std[axis]
    series: list[Series] = [
        Rule(0.0, width=0.7),
        Band(abscissas, value - band, value + band, "95 % band"),
        Line(abscissas, value, "curve", INK, 1.8, markers=len(abscissas) < 12),
    ]
    for colour, form in zip(FORM_COLOURS, forms, strict=False):
        form_curve = form.curve
        label = f"{form.name}: {100 * max(form.share, 0.0):.0f} %"
        series.append(Line(form_curve.at[axis], scale * form_curve.value[axis], label, colour, 1.4, "dash"))
    name = "time" if curve.driver == "t_s" else curve.driver.removesuffix("_deg").removesuffix("_c")
    driver = name.replace("_", " ")
    x = Axis(f"{driver}, {curve.driver_unit}" if curve.driver_unit else driver)
    first = axis == next(iter(curve.value))
    y = Axis(f"{curve.place}, {unit}" if first else "")
    return Panel(tuple(series), x, y, axis, legend="best" if first else "")


def shares_chart(steps: Falling) -> Chart:
    """For each model, the part of the first model's excess variance that remains, divided among the places."""
    names, shares = shares_by_place(steps)
    rows = len(shares)
    ends = np.cumsum(shares, axis=1)
    texts_of_models = [f"{100 - 100 * row[-1]:.0f} % explained" for row in ends]
    texts_of_models[0] = f"{rounded(steps.start.pooled_excess)} × the noise floor"
    series = []
    for k in range(len(names) - 1, -1, -1):  # the longest bars below the others
        texts = texts_of_models if k == len(names) - 1 else [""] * rows
        colour = {UNEXPLAINED: BAND, LINEAR: QUIET, MINOR_PLACES: INK}.get(
            names[k], PLACE_COLOURS[k % len(PLACE_COLOURS)]
        )
        series.append(Bars(0.0, 100 * ends[:, k], [colour] * rows, texts, [False] * rows, names[k]))
    models = (steps.start.model.name, *(f"+ {step.name}" for step in steps.steps))
    y = Axis(low=-0.5, high=max(rows, FEWEST_BARS) - 0.5, names=models, reverse=True)
    x = Axis("remaining variance beyond the noise, % of that of the first model", low=0.0, high=135.0)
    return single_chart(Panel(tuple(series), x, y, legend="outside"), 0.9 + ROW * max(rows, FEWEST_BARS))


def shares_by_place(steps: Falling) -> tuple[list[str], Array]:
    """Places, and the part of the first model's excess variance that each still holds, (models, places).

    The last place is the part that no step explains. A step's part is the fall of the variance when it is added.
    """
    errors = np.array([steps.start.pooled_excess, *(step.after.pooled_excess for step in steps.steps)]) ** 2
    gains = np.maximum(-np.diff(errors), 0.0)
    unexplained = max(float(errors[-1]) - 1.0, 0.0)
    total = float(gains.sum()) + unexplained or 1.0
    names, place_labels = _named_places(steps, gains)
    shares = np.zeros((len(errors), len(names) + 1))
    for row in range(len(errors)):
        for k in range(row, len(gains)):
            shares[row, names.index(place_labels[k])] += gains[k] / total
    shares[:, -1] = unexplained / total
    return [*names, UNEXPLAINED], shares


def _named_places(steps: Falling, gains: Array) -> tuple[list[str], list[str]]:
    """The places in the order of the legend, the largest first, and that of each step. Small places are one."""
    place_labels = [_legend_label(step.name) for step in steps.steps]
    size = {name: sum(g for g, a in zip(gains, place_labels, strict=True) if a == name) for name in place_labels}
    names = sorted(size, key=lambda name: (name == LINEAR, -size[name]))
    minor = [name for name in names if name != LINEAR][MOST_SHARES:]
    labels = [MINOR_PLACES if name in minor else name for name in place_labels]
    return [*(name for name in names if name not in minor), *([MINOR_PLACES] if minor else [])], labels


def _legend_label(effect: str) -> str:
    """The place of an effect, as a legend has it."""
    if effect in BASE:
        return LINEAR
    place = place_of_effect(effect)
    return LINEAR if place == "geometry" else place or effect


def _end(steps: Falling) -> Fit:
    return steps.steps[-1].after if steps.steps else steps.start


def _size(curve: PlaceCurve, end: Fit) -> float:
    """Size of a curve: its rms; that of a stage angle in the output that the angle changes."""
    rms = max(float(np.std(value)) for value in curve.value.values())
    return rms * (np.radians(1.0) * float(np.ptp(end.table.outputs)) / 2 if curve.unit == "deg" else 1.0)


def _picture(curve: PlaceCurve, forms: Sequence[FittedForm]) -> Picture:
    caption = "The curve of this place in the model, with its band of 95 % (grey)."
    if forms:
        share = f"{forms[0].name} takes up {100 * max(forms[0].share, 0.0):.0f} % of its variance"
        caption += f" Broken lines: forms of the catalogue that are fitted to it; {share}."
    if curve.symmetry:
        caption += f" The curve is {curve.symmetry}." if "wave" not in curve.symmetry else f" It has {curve.symmetry}."
    name = f"place-{curve.place.replace(':', '-')}"
    return Picture(name, f"Curve of {curve.place}", caption, curve_chart(curve, forms))
