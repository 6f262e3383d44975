"""Charts of a fit: measurement and model, the residual against a column, and the residual pattern.

A panel shows one channel (`ChannelResidual`). A filled marker is a clockwise approach, an open one an anticlockwise
approach; colours are the values of a second column.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibrations.discovery.findings import Step
from calibrations.fitting.fit import Fit, scales
from calibrations.means.noise import rms
from calibrations.presentation.chart import (
    CANDIDATE,
    MODEL,
    QUIET,
    Axis,
    Chart,
    Line,
    Panel,
    Picture,
    Points,
    Rule,
    Scale,
    Second,
    Series,
    Symbol,
    floor_band,
    side_by_side,
    stack_panels,
)
from calibrations.presentation.charts import motion
from calibrations.presentation.charts.contribution import change_of, curves, is_function
from calibrations.presentation.residual import (
    ChannelResidual,
    Column,
    choices,
    columns,
    first_choices,
    repeats,
    specific_force,
    zero,
)
from calibrations.table import MILLI, Array

PALE = 3.0  # times the noise floor: below, noise alone stays pale
APART = 0.22  # of the step between rows of inclinations, by which both directions of turning are set apart
MOST_INCLINATIONS = 16  # with a row each; more are drawn at their true angles, both directions at one place
SIDES: dict[int, Symbol] = {1: "circle", -1: "circle-open", 0: "circle"}
PLACES: dict[int, Symbol] = {1: "triangle-up", -1: "triangle-down", 0: "circle"}
SIGNS = {1: " ▲", -1: " ▼", 0: ""}  # after the angles of a pose
VISITS_CAPTION = "The residual of the model {} at each pose over time; pale is near the noise."
TURNING = "▲ turning clockwise, ▼ anticlockwise"
GAP = 1.5  # times the usual step between two poses: a pose between them is missing
VISIT_PX = 6.0  # a marker of a pose that is visited again and again
TOWARDS = "towards x; left: z upwards, right: z downwards (equal-area map)"
HALF_SPHERES = 2.3  # between the centres of both maps
SMALL_ROW, ROW = 2.0, 3.0  # inches: a motion has many channels
ROUNDING = 1e-6  # times the noise floor: a smaller change of an output is not drawn
MOST_ROWS = 4  # channels of a motion that are drawn
ACROSS_PX, DOWN_PX, LEAST_PX, MOST_PX = 900.0, 330.0, 3.0, 10.0  # of a map of poses: its width, height; its markers


def fit_album(fit: Fit) -> list[Picture]:
    """The model and its data, the residual, and the residual pattern."""
    model, kind = fit.model.name, fit.table.type
    failure_caption = VISITS_CAPTION if _visits_repeatedly(fit) else kind.failure_caption
    measurement_words, failure_words = (text.format(model) for text in (kind.measurement_caption, failure_caption))
    difference = f"Measured less the model {model}. The grey band is the noise floor, one standard deviation each way."
    if len(fit.channels) > len(drawn_channels(fit, fit.residual)):
        difference += f" Only the {MOST_ROWS} outputs with the largest residual are drawn."
    return [
        Picture("measurement", "Measurement and model", measurement_words, measurement_chart(fit)),
        Picture("residual", "Residual", difference, residual_chart(fit)),
        Picture("failure", "Residual pattern", failure_words, failure_chart(fit)),
    ]


def measurement_chart(fit: Fit) -> Chart:
    """A panel for each output, or one for the magnitude of positions."""
    if fit.table.type.moving:
        return stack_panels(
            [motion.measurement(ChannelResidual(fit, c, False)) for c in motion.first_channels(fit)], 2.6
        )
    columns_of_fit, n = choices(fit), 1 if fit.table.type.magnitude else len(fit.channels)
    x, colour = (columns_of_fit[name] for name in first_choices(list(columns_of_fit), fit.table))
    if fit.table.type.magnitude:
        x = columns(fit)[3]
    panels = [measurement(ChannelResidual(fit, c, False), x, colour) for c in range(n)]
    bar = scale_of(colour, 0)
    return side_by_side(panels, 4.2, bar=bar) if n < 3 else stack_panels(panels, ROW, bar=bar)


def residual_chart(fit: Fit) -> Chart:
    """A row of panels for each channel, a column for each thing that the residual may follow."""
    columns_of_fit = choices(fit)
    colour = columns_of_fit[first_choices(list(columns_of_fit), fit.table)[1]]
    columns_across = columns(fit)
    rows = tuple(
        tuple(
            residual(ChannelResidual(fit, c, False), x, colour, second=x is columns_across[-1]) for x in columns_across
        )
        for c in drawn_channels(fit, fit.residual)
    )
    has_one_colour = bool(np.ptp(colour.values) == 0)  # a motion has one inclination
    bar = None if has_one_colour or any(colour is x for x in columns_across) else scale_of(colour, 0)
    return Chart(rows, row_height(fit), share_x=True, share_y=True, bar=bar)


def failure_chart(fit: Fit) -> Chart:
    """A map for each channel; for a motion the residual over one period."""
    if fit.table.type.moving:
        return stack_panels([motion.failure(ChannelResidual(fit, c, False)) for c in motion.first_channels(fit)], 2.6)
    panels = [failure(ChannelResidual(fit, c, False)) for c in range(len(fit.channels))]
    reach = max(PALE, float(np.abs(fit.residual / fit.noise.floor[:, None]).max()))
    return stack_panels(panels, 4.2 if len(panels) == 1 else ROW, bar=_signed_scale(reach))


def drawn_channels(fit: Fit, values: Array) -> list[int]:
    """Channels with `values`, (channels, n), that are more than rounding; all if none has.

    Of a motion, those with the largest rms of `values` over the noise floor.
    """
    changed = rms(values) > ROUNDING * fit.noise.floor
    channels = [c for c in range(len(fit.channels)) if changed[c]] or list(range(len(fit.channels)))
    if not fit.table.type.moving:
        return channels
    size = rms(values) / fit.noise.floor
    return sorted(sorted(channels, key=lambda c: -float(size[c]))[:MOST_ROWS])


def row_height(fit: Fit) -> float:
    """Inches of a channel's row of panels."""
    return SMALL_ROW if fit.table.type.moving else ROW


def measurement(channel: ChannelResidual, x: Column, colour: Column) -> Panel:
    """Dots are measured, the line is the model (crosses where rows share no curve, below the dots); output over `x`."""
    c, rows, fit = channel.c, channel.rows, channel.fit
    measured, model, label = _outputs(channel)
    hover = [f"{value:.6g}<br>{text}" for value, text in zip(measured[rows], channel.hover, strict=True)]
    dots = _dots(channel, x.values[c, rows], measured[rows], colour, hover)
    curve_hover = "model: %{y:.6g}"
    series: tuple[Series, ...]
    if fit.table.type.magnitude:
        std = fit.noise.fast[0, rows]
        dots = replace(dots, low=dots.y - std, high=dots.y + std)
        series = (Rule(1.0, colour=MODEL, width=1.2), dots)
    elif model_is_line(fit, x):
        series = (Line(*_stretches(channel, x, model), width=1.2, hover=curve_hover), dots)
    else:
        series = (Points(x.values[c, rows], model[rows], colour=MODEL, symbol="cross", size=9), dots)
    title = _title(fit, c)
    second = None
    if not channel.in_g and fit.table.type.stage_angles:
        second = Second(float(scales(fit)[c]), zero(fit, c), f"{fit.table.input_unit}, by bias and scale factor")
    return Panel(series, _axis(x, c), Axis(label), title, second=second)


def model_is_line(fit: Fit, x: Column) -> bool:
    """Whether the model is a line over `x`: over the angle, or over the time of poses that are visited repeatedly."""
    if fit.table.type.magnitude or fit.table.type.moving:
        return True
    return x.name == "beta" or (x.name == "time" and _visits_repeatedly(fit))


def _visits_repeatedly(fit: Fit) -> bool:
    return fit.table.type.stage_angles and repeats(fit.table)


def residual(
    channel: ChannelResidual,
    x: Column,
    colour: Column,
    step: Step[Fit] | None = None,
    *,
    second: bool = False,
    title: str = "",
) -> Panel:
    """The residual over `x` and the noise floor; the part that the effect of `step` explains as a line.

    The line is full for clockwise and broken for anticlockwise approaches. `second`: an axis in thousandths
    of the sensed unit on the right, where the residual is in the unit of the output.
    """
    c, rows = channel.c, channel.rows
    dots = _dots(channel, x.values[c, rows], channel.residual, colour, channel.hover)
    lines = tuple(_mark_explained(step, x, channel)) if step else ()
    second_axis = None
    if second and not channel.fit.table.type.from_output and not channel.in_g:
        second_axis = Second(channel.scale, 0.0, MILLI[channel.fit.table.input_unit])
    label = channel.label
    if channel.fit.table.type.moving:
        label = label.replace(" in ", "\nin ", 1).replace(" with", "\nwith", 1)
    return Panel((*floor_band(channel.floor), dots, *lines), _axis(x, c), Axis(label), title, second=second_axis)


def failure(channel: ChannelResidual) -> Panel:
    """Each row at its place, coloured by its residual over the noise floor."""
    fit, c, rows = channel.fit, channel.c, channel.rows
    x, y, axes = _map(channel)
    relative = channel.residual / channel.floor
    dots = Points(x[rows], y[rows], symbol=[PLACES[int(s)] for s in channel.side], size=_marker_px(channel),
                  values=relative, scale=_signed_scale(max(PALE, float(np.abs(relative).max(initial=0.0)))),
                  hover=channel.hover, keys=range(len(rows)))  # fmt: skip
    circles: tuple[Line, ...] = ()
    if fit.table.type.magnitude:
        turn = np.linspace(0, 2 * np.pi, 121)
        circles = tuple(
            Line(np.cos(turn) + offset, np.sin(turn), colour=QUIET, width=0.8) for offset in (0.0, HALF_SPHERES)
        )
    title = _title(fit, c)
    return Panel((*circles, dots), *axes, title, equal=fit.table.type.magnitude)


def _title(fit: Fit, c: int) -> str:
    """The channel, if there are several."""
    if fit.table.type.magnitude:
        return ""
    return fit.channels[c] if fit.table.type.from_output else f"axis {fit.channels[c]}"


def _marker_px(channel: ChannelResidual) -> float:
    """Markers of neighbouring poses, and of both directions of turning, must not overlap."""
    table = channel.fit.table
    if _visits_repeatedly(channel.fit):
        return VISIT_PX
    if not table.type.stage_angles:
        return MOST_PX
    columns_across, rows_down = (len(np.unique(table.column(name))) for name in ("beta_deg", "alpha_deg"))
    return min(max(min(ACROSS_PX / columns_across, DOWN_PX / (2 * rows_down)), LEAST_PX), MOST_PX)


def scale_of(colour: Column, c: int) -> Scale:
    """Colours by the values of a column."""
    if colour.names:
        return Scale(colour.labels[c], 0, len(colour.names) - 1, names=colour.names)
    values = colour.values[c]
    return Scale(colour.labels[c], float(values.min()), float(values.max()))


def _signed_scale(reach: float) -> Scale:
    return Scale("residual / noise floor", -reach, reach, signed=True)


def _dots(channel: ChannelResidual, x: Array, y: Array, colour: Column, hover: Sequence[str]) -> Points:
    return Points(x, y, symbol=[SIDES[int(s)] for s in channel.side], values=colour.values[channel.c, channel.rows],
                  scale=scale_of(colour, channel.c), hover=hover, keys=range(len(channel.rows)))  # fmt: skip


def _axis(x: Column, c: int) -> Axis:
    return Axis(x.labels[c], ticks="quarters" if x.name == "beta" else "", names=x.names)


def _outputs(channel: ChannelResidual) -> tuple[Array, Array, str]:
    """Measured values, the model's values, and their label, for every row."""
    fit, c = channel.fit, channel.c
    if fit.table.type.magnitude:
        magnitude_label = f"|{fit.table.type.symbol}| by the model ({fit.table.type.sensed_in})"
        return 1.0 + fit.residual[0], np.ones(fit.table.n), magnitude_label
    if fit.table.type.from_output:
        return fit.residual[c], np.zeros(fit.table.n), f"error {fit.channels[c]} ({fit.problem.unit})"
    measured = fit.table.outputs[:, c]
    model = measured - fit.residual[c]
    if not channel.in_g:
        return measured, model, f"output of {fit.channels[c]} ({fit.table.unit})"
    offset, unit = zero(fit, c), fit.table.input_unit
    label = f"{fit.channels[c]} by bias and scale factor ({unit})"
    return (measured - offset) / channel.scale, (model - offset) / channel.scale, label


def _stretches(channel: ChannelResidual, x: Column, model: Array) -> tuple[Array, Array]:
    """The model over x, one stretch for each inclination (over time: each pose) and direction of turning.

    Gaps are between the stretches, and where poses are missing, for example because a person excluded them.
    """
    table, at, abscissas, values = channel.fit.table, x.values[channel.c], [], []
    names = ("alpha_deg", "direction") if x.name == "beta" else ("alpha_deg", "beta_deg", "direction")
    groups = np.stack([table.optional(name, 0.0) for name in names])[:, channel.rows]
    _, group = np.unique(groups, axis=1, return_inverse=True)
    for k in range(int(group.max(initial=-1)) + 1):
        rows = channel.rows[group.ravel() == k]
        order = rows[np.argsort(at[rows], kind="stable")]
        gaps = _gaps(at[order])
        abscissas += [*np.insert(at[order], gaps, np.nan), np.nan]
        values += [*np.insert(model[order], gaps, np.nan), np.nan]
    return np.array(abscissas), np.array(values)


def _gaps(at: Array) -> NDArray[np.intp]:
    """The indices in increasing `at` before which a gap is larger than the usual step."""
    steps = np.diff(at)
    usual_step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    return np.flatnonzero(steps > GAP * usual_step) + 1


def _mark_explained(step: Step[Fit], x: Column, channel: ChannelResidual) -> Iterator[Line | Points]:
    """A line where the change is a function of `x`, else a cross for each row."""
    if not is_function(step, x, channel.c):
        change, rows = change_of(step)[channel.c], channel.rows
        hover = [f"explained by {step.name}<br>{channel.place(int(row))}" for row in rows]
        yield Points(x.values[channel.c, rows], channel.factor * change[rows], colour=CANDIDATE, symbol="cross", size=5,
                     hover=hover)  # fmt: skip
        return
    for side, abscissas, values in curves(step, x, channel.c):
        turning = {1: " clockwise", -1: " anticlockwise"}.get(int(side), "")
        yield Line(abscissas, channel.factor * values, colour=CANDIDATE, width=3, dash="solid" if side >= 0 else "dash",
                   halo=True, hover=f"explained by {step.name}{turning}")  # fmt: skip


def _map(channel: ChannelResidual) -> tuple[Array, Array, tuple[Axis, Axis]]:
    """The place of each row, and the axes."""
    fit = channel.fit
    if _visits_repeatedly(fit):
        return _visits(channel)
    if fit.table.type.stage_angles:
        alpha, side = fit.table.column("alpha_deg"), np.sign(fit.table.optional("direction", 0.0))
        label = Axis(f"β (deg); {TURNING}", ticks="quarters")
        inclinations, row = np.unique(alpha, return_inverse=True)
        if len(inclinations) > MOST_INCLINATIONS:
            return fit.table.column("beta_deg"), alpha, (label, Axis("α (deg)"))
        names = tuple(f"{inclination:g}" for inclination in inclinations)
        return fit.table.column("beta_deg"), row.ravel() + APART * side, (label, Axis("α (deg)", names=names))
    if fit.table.type.magnitude:
        a = specific_force(fit)
        flat = a[:, :2] / np.sqrt(np.linalg.norm(a, axis=1, keepdims=True) + np.abs(a[:, 2:]))
        offset = np.where(a[:, 2] < 0, HALF_SPHERES, 0.0)
        unit = fit.table.type.sensed_in
        return flat[:, 0] + offset, flat[:, 1], (Axis(f"{TOWARDS} ({unit})"), Axis(f"towards y ({unit})"))
    first = columns(fit)[0]
    relative = fit.residual[channel.c] / fit.noise.floor[channel.c]
    return first.values[channel.c], relative, (Axis(first.labels[channel.c]), Axis("residual / noise floor"))


def _visits(channel: ChannelResidual) -> tuple[Array, Array, tuple[Axis, Axis]]:
    """A row for each pose that is visited repeatedly, over time."""
    fit = channel.fit
    time = columns(fit)[1]
    sides = np.sign(fit.table.optional("direction", 0.0))
    angles = np.column_stack([fit.table.column("alpha_deg").round(), fit.table.column("beta_deg").round(), sides])
    poses, row = np.unique(angles, axis=0, return_inverse=True)
    names = tuple(f"{alpha:g}, {beta:g}{SIGNS[int(side)]}" for alpha, beta, side in poses)
    turning = f"; {TURNING}" if np.any(sides) else ""
    axes = Axis(f"{time.labels[channel.c]}{turning}"), Axis("α, β (deg)", names=names)
    return time.values[channel.c], row.ravel().astype(float), axes
