"""Charts of acceleration against a reference: the paper's Fig. 12, waveform, period of a motion; compensation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.analyses.motion import MotionResult, Quantity
from calibrations.compensation.inverse import Residual
from calibrations.fitting.fit import Fit
from calibrations.means.noise import rms
from calibrations.model.chain import forward
from calibrations.motion.stretches import Stretches, make_stretches
from calibrations.presentation.chart import (
    BLUE,
    CANDIDATE,
    INK,
    VERMILION,
    Axis,
    Chart,
    Line,
    Panel,
    Points,
    Rule,
    floor_band,
)
from calibrations.presentation.residual import ChannelResidual
from calibrations.table import Array
from calibrations.text import estimate_text as written
from calibrations.text import rounded

SHOWN_S = 0.5  # of the record: five periods of the paper's motion
BINS = 40  # of a period
ROOM, LEGEND_ROOM = 0.05, 0.25  # below and above the curves, as shares of their range


def evaluation(result: MotionResult) -> Chart:
    """Fig. 12 of the paper: the acceleration by each model and the reference above, the error of the model below."""
    first = result.t_s[0]
    visible = (result.t_s - first) < SHOWN_S
    t = result.t_s[visible] - first
    curves = [values[visible] for values in (result.linear, result.physical, result.reference)]
    low, high = float(np.min(curves)), float(np.max(curves))
    axis = Axis("acceleration (mm/s²)", low=low - ROOM * (high - low), high=high + LEGEND_ROOM * (high - low))
    upper_row, lower_row = [], []
    for k, (name, values, error) in enumerate(_models(result)):
        colour = (VERMILION, BLUE)[k]
        sensor = Line(t, values[visible], f"sensor, {name} model", colour, 1.8)
        reference = Line(t, result.reference[visible], "displacement sensor", INK, 1.8, "dot")
        title = f"{'ab'[k]}  {name} model: rmse {written(error.value, error.std)} mm/s²"
        upper_row.append(Panel((sensor, reference), Axis(), axis, title, legend="upper right"))
        error_line = Line(t, (values - result.reference)[visible], colour=colour)
        series = (*floor_band(result.noise_limit.value), error_line)
        lower_row.append(Panel(series, Axis("time (s)"), Axis("sensor − reference (mm/s²)")))
    return Chart((tuple(upper_row), tuple(lower_row)), 2.8, share_x=True, share_y=True)


def _models(result: MotionResult) -> tuple[tuple[str, Array, Quantity], ...]:
    return (
        ("linear", result.linear, result.rmse_linear),
        ("physical", result.physical, result.rmse_physical),
    )


def measurement(channel: ChannelResidual) -> Panel:
    """Output less its mean over a few periods; dots are measured, the line is the model."""
    axis = _axis(channel)
    wave = waveform(channel.fit, axis)
    texts = [f"{y:.5g} at {x:.3f} s" for x, y in zip(wave.at, channel.factor * wave.measured, strict=True)]
    line = Line(wave.at, channel.factor * wave.model, "model", hover="model: %{y:.5g}")
    dots = Points(wave.at, channel.factor * wave.measured, "measured", size=5, hover=texts)
    time = Axis("time since the first sample (s)")
    return Panel((line, dots), time, Axis(f"{axis} − mean ({channel.unit})"), f"axis {axis}")


def failure(channel: ChannelResidual) -> Panel:
    """Mean residual over one period of the strongest line; the band is the noise of a mean."""
    axis = _axis(channel)
    period = overlay_periods(channel.fit, axis)
    hover = "%{y:.3g} at %{x:.0f} deg"
    line = Line(period.phase_deg, channel.factor * period.residual, colour=CANDIDATE, hover=hover, markers=True)
    x = Axis(f"phase of the motion {period.line} (deg)", ticks="quarters")
    series = (*floor_band(channel.factor * period.floor), line)
    return Panel(series, x, Axis(f"mean residual of {axis} ({channel.unit})"), f"axis {axis}")


def first_channels(fit: Fit) -> list[int]:
    """The first channel of each axis: `x mean` of `x mean`, `x in phase at 10 Hz` and so on."""
    axes = [name.partition(" ")[0] for name in fit.channels]
    return [axes.index(axis) for axis in dict.fromkeys(axes)]


def _axis(channel: ChannelResidual) -> str:
    """The axis of the channel: `x` of `x in phase at 10 Hz`."""
    return channel.fit.channels[channel.c].partition(" ")[0]


@dataclass(frozen=True)
class Waveform:
    """A few periods of one axis: time since the first sample (s), outputs less the model's mean in the table's unit."""

    at: Array
    measured: Array
    model: Array


def waveform(fit: Fit, axis: str) -> Waveform:
    """The periods in the middle of the record."""
    table = _stretches(fit)
    c, t = table.axes.index(axis), table.samples.time_s
    start = int(np.searchsorted(t, table.time_s[len(table.time_s) // 2]))
    rows = slice(start, int(np.searchsorted(t, t[start] + SHOWN_S)))
    model = _predict(fit)[rows, c]
    return Waveform(t[rows] - t[0], table.samples.outputs[rows, c] - model.mean(), model - model.mean())


@dataclass(frozen=True)
class Period:
    """Mean residual of one axis over the phase of the strongest `line`, and the noise of a mean."""

    phase_deg: Array
    residual: Array
    floor: float
    line: str


def overlay_periods(fit: Fit, axis: str) -> Period:
    """All periods laid over each other, in BINS parts."""
    table = _stretches(fit)
    phase, line = _phase(table)
    part = np.minimum((phase * BINS / 360).astype(int), BINS - 1)
    count = np.bincount(part, minlength=BINS)
    c, filled = table.axes.index(axis), count > 0
    residual = table.samples.outputs[:, c] - _predict(fit)[:, c]
    mean = np.bincount(part, residual, minlength=BINS) / np.maximum(count, 1)
    # a part of the period comes once in a period: by then the output filter has forgotten
    floor = float(rms(residual - mean[part])) / np.sqrt(np.median(count))
    return Period(((np.arange(BINS) + 0.5) * 360 / BINS)[filled], mean[filled], float(floor), line)


def _stretches(fit: Fit) -> Stretches:
    return make_stretches(fit.table)  # itself, by its own kind


def _predict(fit: Fit) -> Array:
    """The model's output at each sample, shape (samples, axes)."""
    return forward(_stretches(fit).samples, fit.problem.layout.steps(fit.theta))


def _phase(table: Stretches) -> tuple[Array, str]:
    """Phase of the strongest line at each sample, deg, and its name; zero at its greatest output."""
    line = table.lines[0]
    return np.degrees(np.arctan2(-line.in_quadrature, line.in_phase)) % 360, line.name


def compensated_chart(residual: Residual) -> Chart:
    """A row for each axis: the linear model's error on the left, the compensated one on the same scale."""
    poses = np.arange(residual.table.n, dtype=float)
    rows = []
    for k, axis in enumerate(residual.axes):
        sides = ((residual.linear, VERMILION, "linear model"), (residual.compensated, BLUE, "compensated"))
        rows.append(tuple(
            Panel((Rule(0.0, width=0.7), Points(poses, errors[:, k], colour=colour, size=5)), Axis("pose"),
                  Axis("sensor − reference (mm/s²)"), f"{axis}, {name}: rmse {rounded(rmse)} mm/s²")
            for (errors, colour, name), rmse in zip(sides, residual.rmse[axis], strict=True)
        ))  # fmt: skip
    return Chart(tuple(rows), 2.6, share_x=True, share_y=True)
