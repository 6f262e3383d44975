"""Pictures of a motion: models beside the reference (Ang Fig. 12), output beside model, the residual over a period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from calibrations.chain import forward
from calibrations.fit import Fit
from calibrations.motion.evaluate import MotionResult, Quantity
from calibrations.motion.stretches import Stretches, stretches
from calibrations.noise import rms
from calibrations.numerals import measured as written
from calibrations.pictures.style import BLUE, INK, VERMILION, floor_band, panels, quarters, styled
from calibrations.table import Array

SHOWN_S = 0.5  # of the record: five periods of the paper's motion
BINS = 40  # of a period


@styled
def evaluation(result: MotionResult) -> Figure:
    """Fig. 12 of the paper: each model's acceleration beside the reference above, and its error below."""
    figure, axes = panels(2, 2, 2.8, sharex=True, sharey="row")
    first = result.t_s[0]
    shown = (result.t_s - first) < SHOWN_S
    t = result.t_s[shown] - first
    for k, (name, values, error) in enumerate(_models(result)):
        above, below = axes[:, k]
        above.plot(t, values[shown], color=(VERMILION, BLUE)[k], lw=1.4, label=f"sensor, {name} model")
        above.plot(t, result.reference[shown], color=INK, ls=":", lw=1.4, label="displacement sensor")
        above.set_title(f"{'ab'[k]}  {name} model: rmse {written(error.value, error.std)} mm/s²")
        above.margins(y=0.2)
        above.legend(loc="upper right", ncols=2)
        floor_band(below, result.noise_limit.value)
        below.plot(t, (values - result.reference)[shown], color=(VERMILION, BLUE)[k])
        below.set_xlabel("time (s)")
    axes[0, 0].set_ylabel("acceleration (mm/s²)")
    axes[1, 0].set_ylabel("sensor less reference (mm/s²)")
    return figure


def _models(result: MotionResult) -> tuple[tuple[str, Array, Quantity], ...]:
    return (
        ("linear", result.linear, result.rmse_linear),
        ("physical", result.physical, result.rmse_physical),
    )


@styled
def measurement(fit: Fit) -> Figure:
    """A panel for each axis: output less its mean over a few periods, mV; dots measured, line the model."""
    table = _stretches(fit)
    figure, axes = panels(len(table.axes), 1, 2.6, sharex=True)
    for axis, ax in zip(table.axes, axes[:, 0], strict=True):
        shown = waveform(fit, axis)
        ax.plot(shown.at, 1e3 * shown.model, color=BLUE, zorder=1.5)
        ax.plot(shown.at, 1e3 * shown.measured, "o", color=INK, mfc="none", mew=0.7)
        ax.set(title=f"axis {axis}", ylabel=f"output less mean (m{table.unit})")
    axes[-1, 0].set_xlabel("time (s)")
    return figure


@styled
def failure(fit: Fit) -> Figure:
    """A panel for each axis: mean residual over one period of the strongest line, mV, the noise of a mean as a band."""
    table = _stretches(fit)
    figure, axes = panels(len(table.axes), 1, 2.6, sharex=True)
    for axis, ax in zip(table.axes, axes[:, 0], strict=True):
        shown = over_a_period(fit, axis)
        floor_band(ax, 1e3 * shown.floor)
        ax.plot(shown.phase_deg, 1e3 * shown.residual, "o-", color=VERMILION)
        quarters(ax)
        ax.set(title=f"axis {axis}", ylabel=f"mean residual (m{table.unit})")
    axes[-1, 0].set_xlabel(f"phase of the motion {shown.line} (deg)")
    return figure


@dataclass(frozen=True)
class Waveform:
    """A few periods of one axis: time (s), and outputs less the model's mean, in the table's unit."""

    at: Array
    measured: Array
    model: Array


def waveform(fit: Fit, axis: str) -> Waveform:
    """Those in the middle of the record."""
    table = _stretches(fit)
    c, t = table.axes.index(axis), table.samples.time_s
    start = int(np.searchsorted(t, table.time_s[len(table.time_s) // 2]))
    rows = slice(start, int(np.searchsorted(t, t[start] + SHOWN_S)))
    model = _predicted(fit)[rows, c]
    return Waveform(t[rows], table.samples.outputs[rows, c] - model.mean(), model - model.mean())


@dataclass(frozen=True)
class Period:
    """Mean residual of one axis over the phase of the strongest `line`, and the noise of a mean."""

    phase_deg: Array
    residual: Array
    floor: float
    line: str


def over_a_period(fit: Fit, axis: str) -> Period:
    """All periods laid over each other, in BINS parts."""
    table = _stretches(fit)
    phase, line = _phase(table)
    part = np.minimum((phase * BINS / 360).astype(int), BINS - 1)
    count = np.bincount(part, minlength=BINS)
    c, there = table.axes.index(axis), count > 0
    residual = table.samples.outputs[:, c] - _predicted(fit)[:, c]
    mean = np.bincount(part, residual, minlength=BINS) / np.maximum(count, 1)
    # a part of the period comes once in a period: by then the output filter has forgotten
    floor = float(rms(residual - mean[part])) / np.sqrt(np.median(count))
    return Period(((np.arange(BINS) + 0.5) * 360 / BINS)[there], mean[there], float(floor), line)


def _stretches(fit: Fit) -> Stretches:
    return stretches(fit.table)  # itself, by its own kind


def _predicted(fit: Fit) -> Array:
    """The model's output at each sample, shape (samples, axes)."""
    return forward(_stretches(fit).samples, fit.problem.layout.steps(fit.theta))


def _phase(table: Stretches) -> tuple[Array, str]:
    """Phase of the strongest line at each sample, deg, and its name; zero at its greatest output."""
    line = table.lines[0]
    return np.degrees(np.arctan2(-line.in_quadrature, line.in_phase)) % 360, line.name
