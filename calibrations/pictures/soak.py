"""Pictures of a soak: bias and scale factor over the hours, what surrounded them, and the still record's noise."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from calibrations.evaluations.forecast import Foreseen
from calibrations.evaluations.soak import HOUR_S, Course, Soak
from calibrations.numerals import measured, plain
from calibrations.pictures.album import Picture
from calibrations.pictures.style import AMBER, BAND, BLUE, GREEN, INK, QUIET, VERMILION, panels, styled
from calibrations.table import Array

COLOURS = {"x": BLUE, "y": VERMILION}
SHOWN = 600  # means of the still record that a line is drawn through, at most
CURVE = 400  # points of a fitted curve
COVERAGE = 2.0
WINDOW = 1.6  # times the whole drift: what is shown of bounds that are far wider in the beginning
FORESEEN = (
    "What the Kalman filters said, at each time, that bias and scale factor would come to: a line within its 95 % "
    "bounds, less the last one. The dotted line is where the drift was then. The broken line is when the final value "
    "was known: from then on the bounds are narrow beside the whole drift."
)


def soak_album(found: Soak, foreseen: Mapping[str, Foreseen] = MappingProxyType({})) -> list[Picture]:
    """All pictures of a soak, and of what was foreseen of it, with words for a page."""
    course = (
        "Dots are reversals, with their standard errors; the line is the exponential approach with its standard error. "
        "Within the grey band, the expanded uncertainty of one reversal about the final value, the rest of the drift "
        "is told from noise by no measurement: the broken line is the time from which it stays there. The thin grey "
        "line is the record of the level sensor between reversals, shifted onto the bias."
    )
    around = (
        "What the night was like: the sensor's temperature, its supply, and the noise of single samples hour by hour."
    )
    noise = (
        "How much neighbouring means of the still record differ, over the time that each is taken over: white noise "
        "falls with the square root of time, drift rises with it."
    )
    pictures = [
        Picture("drift", "Bias and scale factor since power-on", course, drift(found)),
        Picture("night", "Temperature, supply and noise", around, surroundings(found)),
    ]
    if foreseen:
        pictures.insert(1, Picture("foreseen", "What was foreseen, and when", FORESEEN, forecasts(found, foreseen)))
    times_s, _ = found.allan(found.axes[0])
    return [*pictures, Picture("allan", "Allan deviation", noise, allan(found))] if len(times_s) else pictures


@styled
def drift(found: Soak) -> Figure:
    """A column for each axis: bias above, scale factor below, as change from the final value."""
    figure, axes = panels(2, len(found.axes), 2.9, sharex=True)
    for k, axis in enumerate(found.axes):
        _course(axes[0, k], found, found.courses[f"bias-{axis}"], 1e3, "bias less final value (mV)")
        scale = found.courses[f"scale-{axis}"]
        _course(axes[1, k], found, scale, 1e6 / _final(scale), "scale factor less final value (ppm)")
        axes[0, k].set_title(f"axis {axis}")
        axes[1, k].set_xlabel("time since power-on (h)")
    return figure


@styled
def forecasts(found: Soak, foreseen: Mapping[str, Foreseen]) -> Figure:
    """A column for each axis: what bias and scale factor were thought to come to, less what the last forecast says."""
    figure, axes = panels(2, len(found.axes), 2.6, sharex=True)
    for k, axis in enumerate(found.axes):
        for row, (quantity, factor, unit) in enumerate((("bias", 1e3, "mV"), ("scale", 1e6, "ppm"))):
            ax, name = axes[row, k], f"{quantity}-{axis}"
            if name in foreseen:
                whole = 1.0 if quantity == "bias" else foreseen[name].last.final.value
                _forecast(ax, foreseen[name], factor / whole, COLOURS[axis])
            ax.set_ylabel(f"{'bias' if quantity == 'bias' else 'scale factor'} foreseen ({unit})")
        axes[0, k].set_title(f"axis {axis}")
        axes[1, k].set_xlabel("time since power-on (h)")
    return figure


def _forecast(ax: Axes, course: Foreseen, factor: float, colour: str) -> None:
    """Bounds of the final value, and where the drift was, against the time at which that was said."""
    hours = np.array([each.t_s for each in course.forecasts]) / HOUR_S
    low, value, high = (factor * (np.array(column) - course.last.final.value)
                        for column in zip(*(each.final for each in course.forecasts), strict=True))  # fmt: skip
    now = factor * (np.array([each.present.value for each in course.forecasts]) - course.last.final.value)
    ax.fill_between(hours, low, high, color=colour, alpha=0.25, lw=0)
    ax.plot(hours, value, color=colour, lw=1.4)
    ax.plot(hours, now, color=INK, lw=0.9, ls=":")
    reach = WINDOW * max(np.abs(now).max(), (high[-1] - low[-1]) / 2)
    ax.set(ylim=(-reach, reach), xlim=(0, None))
    words = "not known at the end"
    if course.known_s is not None:
        ax.axvline(course.known_s / HOUR_S, color=INK, ls="--", lw=0.9)
        words = f"known after {plain(course.known_s / HOUR_S)} h"
    ax.annotate(words, (1, 1), xycoords="axes fraction", xytext=(-4, -4), textcoords="offset points",
                ha="right", va="top")  # fmt: skip


@styled
def surroundings(found: Soak) -> Figure:
    """Temperature, supply and noise over the hours, those of them that were measured."""
    holds = found.holds
    rows = [name for name in ("temperature_c", "supply_v") if name in holds]
    figure, axes = panels(len(rows) + 1, 1, 1.6, sharex=True)
    labels = {"temperature_c": "sensor (°C)", "supply_v": "supply (V)"}
    for ax, name in zip(axes[:, 0], rows, strict=False):
        ax.plot(*_thinned(holds.time_s / HOUR_S, holds.column(name)), color=GREEN if name == "supply_v" else AMBER)
        ax.set_ylabel(labels[name])
        _mark(ax, found)
    ax = axes[-1, 0]
    for axis in found.axes:
        times_s, rms = found.noise_of_hours(axis)
        ax.plot(times_s / HOUR_S, 1e3 * rms, "o-", color=COLOURS[axis], label=f"axis {axis}")
    ax.set(ylabel="noise, rms (mV)", xlabel="time since power-on (h)", xlim=(_begin_h(found), None))
    ax.margins(y=0.3)
    ax.legend(loc="upper right", ncols=len(found.axes))
    _mark(ax, found)
    figure.align_ylabels()
    return figure


@styled
def allan(found: Soak) -> Figure:
    """Allan deviation of each axis on logarithmic axes, beside the slope of white noise."""
    figure, axes = panels(1, 1, 3.0)
    ax = axes[0, 0]
    for axis in found.axes:
        times_s, deviations = found.allan(axis)
        ax.loglog(times_s, 1e6 * deviations, "o-", color=COLOURS[axis], label=f"axis {axis}")
    ax.loglog(times_s, 1e6 * deviations[0] * np.sqrt(times_s[0] / times_s), color=QUIET, ls=":", label="white noise")
    ax.set(xlabel="time of a mean (s)", ylabel="Allan deviation (µV)")
    for side in (ax.xaxis, ax.yaxis):
        side.set_major_formatter(FuncFormatter(_plainly))
        side.set_minor_formatter(FuncFormatter(_plainly))
    ax.legend()
    return figure


def _course(ax: Axes, found: Soak, course: Course, factor: float, label: str) -> None:
    """One quantity as change from its final value, times `factor`."""
    state, final, colour = course.state, _final(course), COLOURS[course.axis]
    if course.quantity == "bias":
        line = _still(found, course)
        ax.plot(line[0] / HOUR_S, factor * (line[1] - final), color=QUIET, alpha=0.45, lw=0.7, zorder=0.8)
    if state is not None:
        ax.axhspan(-factor * state.tolerance, factor * state.tolerance, color=BAND, lw=0, zorder=0.4)
        t_s = np.linspace(*state.span_s, CURVE)
        curve, std = factor * (state.at(t_s) - final), factor * state.std_at(t_s)
        ax.fill_between(t_s / HOUR_S, curve - std, curve + std, color=colour, alpha=0.25, lw=0)
        ax.plot(t_s / HOUR_S, curve, color=colour, lw=1.4)
    ax.errorbar(course.t_s / HOUR_S, factor * (course.values - final), factor * course.stds, fmt="o", color=INK,
                mfc="white", mew=0.7, elinewidth=0.7, ms=3.0, zorder=2)  # fmt: skip
    seen = factor * (np.append(course.values, final) - final)
    room = 0.12 * np.ptp(seen) + factor * (state.tolerance if state else 0.0)
    ax.set(ylabel=label, xlim=(_begin_h(found), None), ylim=(seen.min() - room, seen.max() + room))
    _mark(ax, found)
    _mark_steady(ax, course)


def _begin_h(found: Soak) -> float | None:
    """Left end of the axes of time: power-on, unless the record began long after it."""
    first, last = (t / HOUR_S for t in _span_s(found))
    return 0.0 if first < last - first else None


def _span_s(found: Soak) -> tuple[float, float]:
    """First and last time of the table, since power-on, s."""
    times_s = found.table.time_s
    return float(times_s.min()), float(times_s.max())


def _mark_steady(ax: Axes, course: Course) -> None:
    time = course.time_s
    words = "steady state not reached"
    if time is not None:
        ax.axvline(time[0] / HOUR_S, color=INK, ls="--", lw=0.9)
    if course.state and not course.state.terms and time:
        words = "steady from the first reversal on"
    elif time is not None:
        words = f"steady after {measured(*(each / HOUR_S for each in time))} h"
    up = course.values[0] > course.values[-1]
    ax.annotate(words, (1, 1 if up else 0), xycoords="axes fraction", xytext=(-4, -4 if up else 6),
                textcoords="offset points", ha="right", va="top" if up else "bottom")  # fmt: skip


def _mark(ax: Axes, found: Soak) -> None:
    """Gaps as shaded time."""
    for gap in found.gaps:
        ends = gap.start_s / HOUR_S, (gap.start_s + gap.length_s) / HOUR_S
        ax.axvspan(*ends, color=VERMILION, alpha=0.25, lw=0.8)


def _plainly(value: float, _: int | None = None) -> str:
    """A mark of a logarithmic axis: numbers that begin with 1, 2 or 5."""
    return f"{value:g}" if f"{value:e}"[0] in "125" else ""


def _final(course: Course) -> float:
    return course.state.final[0] if course.state else float(course.values[-1])


def _still(found: Soak, course: Course) -> tuple[Array, Array]:
    """The still record at 0 g, shifted onto the bias: what differs there is load along z."""
    t_s, volts = _thinned(found.holds.time_s, found.holds.column(f"v{course.axis}_v"))
    return t_s, volts - np.median(volts - np.interp(t_s, course.t_s, course.values))


def _thinned(t: Array, values: Array) -> tuple[Array, Array]:
    """Means of neighbours, SHOWN at most."""
    step = 1 + len(t) // SHOWN
    n = len(t) // step * step
    return t[:n].reshape(-1, step).mean(axis=1), values[:n].reshape(-1, step).mean(axis=1)
