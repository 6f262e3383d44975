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
from calibrations.presentation.residual import (
    ChannelResidual,
    Column,
    choices,
    columns,
    first_choices,
    residual_unit,
    select_telling_columns,
    specific_force,
    zero,
)
from calibrations.table import MILLI, Array

PALE = 3.0  # times the noise floor: below, noise alone stays pale
APART = 0.22  # of the step between rows of inclinations, by which both directions of turning are set apart
MOST_INCLINATIONS = 16  # with a row each; more are drawn at their true angles, both directions at one place
LARGEST_MISS = 0.1  # part of the change's rms by which a curve may miss the change of single rows
SIDES: dict[int, Symbol] = {1: "circle", -1: "circle-open", 0: "circle"}
PLACES: dict[int, Symbol] = {1: "triangle-up", -1: "triangle-down", 0: "circle"}
TOWARDS = "towards x; left: z upwards, right: z downwards (equal-area map)"
HALF_SPHERES = 2.3  # between the centres of both maps
SMALL_ROW, ROW = 2.0, 3.0  # inches: a motion has many channels
MOST_ROWS = 4  # channels of a motion that are drawn
ACROSS_PX, DOWN_PX, LEAST_PX, MOST_PX = 900.0, 330.0, 3.0, 10.0  # of a map of poses: its width, height; its markers


def fit_album(fit: Fit) -> list[Picture]:
    """The model and its data, the residual, and the residual pattern."""
    model, kind = fit.model.name, fit.table.type
    measurement_words, failure_words = (text.format(model) for text in (kind.measurement_caption, kind.failure_caption))
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
    """All channels; of a motion those with the largest rms of `values`, shape (channels, n), over the noise floor."""
    channels = range(len(fit.channels))
    if not fit.table.type.moving:
        return list(channels)
    size = rms(values) / fit.noise.floor
    return sorted(sorted(channels, key=lambda c: -float(size[c]))[:MOST_ROWS])


def row_height(fit: Fit) -> float:
    """Inches of a channel's row of panels."""
    return SMALL_ROW if fit.table.type.moving else ROW


def measurement(channel: ChannelResidual, x: Column, colour: Column) -> Panel:
    """Dots are measured, the line is the model (crosses where rows share no curve); output over `x`."""
    c, rows, fit = channel.c, channel.rows, channel.fit
    measured, model, label = _outputs(channel)
    hover = [f"{value:.6g}<br>{text}" for value, text in zip(measured[rows], channel.hover, strict=True)]
    dots = _dots(channel, x.values[c, rows], measured[rows], colour, hover)
    curve_hover = "model: %{y:.6g}"
    if x.name == "beta":
        lines = (Line(*_stretches(channel, x.values[c], model), width=1.2, hover=curve_hover),)
        series: tuple[Series, ...] = (*lines, dots)
    elif fit.table.type.magnitude:
        std = fit.noise.fast[0, rows]
        dots = replace(dots, low=dots.y - std, high=dots.y + std)
        series = (Rule(1.0, colour=MODEL, width=1.2), dots)
    else:
        crosses = Points(x.values[c, rows], model[rows], colour=MODEL, symbol="cross", size=9)
        series = (dots, crosses)
    title = _title(fit, c)
    second = None
    if not channel.in_g and fit.table.type.stage_angles:
        second = Second(float(scales(fit)[c]), zero(fit, c), f"{fit.table.input_unit}, by bias and scale factor")
    return Panel(series, _axis(x, c), Axis(label), title, second=second)


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


def _stretches(channel: ChannelResidual, x: Array, model: Array) -> tuple[Array, Array]:
    """The model over x, one stretch for each inclination and direction of turning, with gaps between."""
    table, abscissas, values = channel.fit.table, [], []
    groups = np.stack([table.optional("alpha_deg", 0.0), table.optional("direction", 0.0)])[:, channel.rows]
    _, group = np.unique(groups, axis=1, return_inverse=True)
    for k in range(int(group.max(initial=-1)) + 1):
        rows = channel.rows[group.ravel() == k]
        order = rows[np.argsort(x[rows], kind="stable")]
        abscissas += [*x[order], np.nan]
        values += [*model[order], np.nan]
    return np.array(abscissas), np.array(values)


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
    if fit.table.type.stage_angles:
        alpha, side = fit.table.column("alpha_deg"), np.sign(fit.table.optional("direction", 0.0))
        label = Axis("β (deg); ▲ turning clockwise, ▼ anticlockwise", ticks="quarters")
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


# The column that an effect's curve is drawn over: the change of the residual is nearest to a function of it


MOST_PARTS = 24  # of a column, for each direction
ROWS_IN_A_PART = 6
LEAST_EXPLAINED = 0.8  # part of the change's variance that a function of the column must give
EQUAL = 0.02  # columns closer than this are equal: the simpler cause is drawn


def change_of(step: Step[Fit]) -> Array:
    """Reduction of the residual by the effect, the other parameters refitted, shape (channels, n)."""
    return step.before.residual - step.after.residual


def select_telling_column(step: Step[Fit]) -> Column:
    """The simplest column that explains the change; the change itself if no column explains it."""
    change, sides = change_of(step) / step.before.noise.floor[:, None], _sides(step)
    effect = next(term.effect for term in step.after.model.terms if term.name == step.name)
    candidates = select_telling_columns(step.before, effect)
    shares = np.array([explained_share(change, column.values, sides) for column in candidates])
    if step.before.table.type.moving:
        return candidates[0]
    if shares.max() < LEAST_EXPLAINED:
        label = f"change made by {step.name} ({residual_unit(step.before)})"
        return Column("change", (label,) * len(change), 1e3 * change_of(step))
    return candidates[int(np.argmax(shares >= shares.max() - EQUAL))]


def explained_share(change: Array, values: Array, sides: Array) -> float:
    """Share of the change's variance that is a function of the column, by side; shapes (channels, n)."""
    unexplained = 0.0
    for y, x in zip(change, values, strict=True):
        part = _parts(x, sides)
        mean = np.bincount(part, y) / np.bincount(part)
        unexplained += float(np.sum((y - mean[part]) ** 2))
    total = float(np.sum((change - change.mean(axis=1, keepdims=True)) ** 2))
    return 1 - unexplained / total if total > 0 else 0.0


def curves(step: Step[Fit], column: Column, c: int) -> Iterator[tuple[float, Array, Array]]:
    """The change as a function of the column: (direction of turning, column, change), means in parts of the column."""
    change, sides = change_of(step)[c], _sides(step)
    if column.name == "change":
        ends = np.array([change.min(), change.max()])
        yield 1.0, 1e3 * ends, ends
        return
    part = _parts(column.values[c], sides)
    count = np.bincount(part)
    x, y, side = (np.bincount(part, values) / count for values in (column.values[c], change, sides))
    for s in np.unique(side):
        rows = np.flatnonzero(side == s)
        rows = rows[np.argsort(x[rows], kind="stable")]
        yield float(s), x[rows], y[rows]


def is_function(step: Step[Fit], column: Column, c: int) -> bool:
    """Whether the curves of the change over `column` pass through the change of the single rows.

    They may miss them by MISSED of the change's rms, or by the noise floor of one row.
    """
    if column.name == "change" or step.before.table.type.moving:
        return True
    change, sides, x = change_of(step)[c], _sides(step), column.values[c]
    missed = np.zeros(len(change))
    for side, abscissas, values in curves(step, column, c):
        rows = sides == side
        missed[rows] = change[rows] - np.interp(x[rows], abscissas, values)
    limit = max(LARGEST_MISS * float(rms(change)), float(step.before.noise.floor[c]))
    return float(rms(missed)) <= limit


def _sides(step: Step[Fit]) -> Array:
    return step.before.table.optional("direction", 0.0)


def _parts(x: Array, sides: Array) -> NDArray[np.intp]:
    """Part number of each row. Parts are ranges of the column with equal numbers of rows, for each side separately."""
    most = min(MOST_PARTS, max(len(x) // ROWS_IN_A_PART, 2))
    edges = np.unique(np.quantile(x, np.linspace(0, 1, most + 1)[1:-1]))
    keys = np.stack([np.searchsorted(edges, x, side="right"), sides])
    return np.asarray(np.unique(keys, axis=1, return_inverse=True)[1]).ravel()
