"""Pictures of a noise analysis: how the noise averages, and its spectrum, each beside what the processes make of it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from scipy.stats import chi2

from calibrations.noise_analysis.analysis import NoiseAnalysis
from calibrations.noise_analysis.freedom import COVERAGE
from calibrations.noise_analysis.processes import GAUSS_MARKOV
from calibrations.numerals import plain
from calibrations.pictures.album import Picture
from calibrations.pictures.style import AMBER, BLUE, GREEN, INK, QUIET, VERMILION, panels, styled
from calibrations.table import Array

FEW_DECADES = 2.5
POINTS = 200
SUM = "their sum"
COLOURS = {
    "white-noise": BLUE,
    "flicker-noise": AMBER,
    "rate-random-walk": VERMILION,
    "quantisation-noise": GREEN,
    GAUSS_MARKOV: QUIET,
}


def noise_album(found: NoiseAnalysis) -> list[Picture]:
    """Both pictures, with words for a page."""
    averaging = (
        "How much neighbouring means differ, over the time that each is taken over. Dots are measured, bars are "
        "intervals of 95 %; the full line is the sum of the processes that were identified, broken lines are these. "
        "On the right the other deviations, with theirs."
    )
    spectrum = (
        "Power over frequency, one-sided. Dots are averages over narrow bands with intervals of 95 %, the grey band is "
        "where 95 % of them should be; the full line is the sum of the processes, marks on top are lines that were "
        "taken off."
    )
    return [
        Picture("allan", "Allan deviation", averaging, allan(found)),
        Picture("spectrum", "Spectrum", spectrum, density(found)),
    ]


@styled
def allan(found: NoiseAnalysis) -> Figure:
    """The overlapping deviation with its interval, the processes and their sum; beside it the other deviations."""
    figure, axes = panels(1, 2, 4.0, width_ratios=[3, 2], sharex=True, sharey=True)
    ax, beside = axes[0]
    curve = found.allan
    bars = np.array([curve.deviation - curve.low, curve.high - curve.deviation])
    ax.errorbar(
        curve.tau_s, curve.deviation, bars, fmt="o", color=INK, elinewidth=0.8, ms=3.4, label="measured", zorder=3
    )
    tau_s = whole_steps(curve.tau_s[0], curve.tau_s[-1], found.rate_hz)
    parts = found.parts(tau_s)
    for name, variance in parts.items() if _several(found) else ():
        ax.plot(tau_s, np.sqrt(variance), "--", color=COLOURS[name], label=name)
    ax.plot(tau_s, found.modelled(tau_s), color=INK, lw=1.4, label=SUM if _several(found) else next(iter(parts)))
    for kind, colour in (("modified", BLUE), ("hadamard", GREEN), ("total", VERMILION)):
        other = found.curves[kind]
        beside.fill_between(other.tau_s, other.low, other.high, color=colour, alpha=0.18, lw=0)
        beside.plot(other.tau_s, other.deviation, "o-", color=colour, ms=2.6, label=kind)
    beside.plot(curve.tau_s, curve.deviation, color=QUIET, label="Allan")
    room = 2.0
    ax.set(xscale="log", yscale="log", ylim=(curve.low.min() / room, curve.high.max() * room))
    ax.set(xlabel="averaging time (s)", ylabel=f"deviation ({found.unit})", title="Allan deviation, overlapping")
    beside.set(xlabel="averaging time (s)", title="other deviations")
    for each in (ax, beside):
        each.legend(loc="upper center")  # the curves fall on the left, and bars are long on the right
        mark_powers(each)
    return figure


def _several(found: NoiseAnalysis) -> bool:
    """Whether the sum is anything but its one part."""
    return len(found.found.power) + len(found.lines) > 1


@styled
def density(found: NoiseAnalysis) -> Figure:
    """Measured and expected one-sided amplitude densities."""
    figure, axes = panels(1, 1, 4.0)
    ax = axes[0, 0]
    spectrum, order = found.spectrum, np.argsort(found.spectrum.frequency_hz)
    f, freedom = spectrum.frequency_hz[order], spectrum.freedom[order]
    expected = found.found.expected(spectrum)[order]
    tail = (1 - COVERAGE) / 2
    low, high = (root(expected * chi2.ppf(p, freedom) / freedom) for p in (tail, 1 - tail))
    ax.fill_between(f, low, high, color=QUIET, alpha=0.22, lw=0)
    ax.vlines(f, *(root(bound[order]) for bound in spectrum.interval), color=INK, lw=0.5, alpha=0.25)
    ax.plot(f, root(spectrum.density[order]), "o", color=INK, ms=2.2, label="measured")
    several = len(found.found.power) > 1
    for name, power in found.found.power.items() if several else ():
        column = spectrum.column(name, found.found.time_constant_s)[order]
        ax.plot(f, root(power * column), "--", color=COLOURS[name], label=name)
    ax.plot(f, root(expected), color=INK, lw=1.2, label=SUM if several else next(iter(found.found.power)))
    ax.set(xscale="log", yscale="log", ylim=(low.min() / 2, 2 * max(high.max(), root(spectrum.density).max())))
    _mark_lines(ax, found)
    ax.set(xlabel="frequency (Hz)", ylabel=f"density ({found.unit}/√Hz)")
    ax.legend()
    mark_powers(ax)
    return figure


def whole_steps(first_s: float, last_s: float, rate_hz: float) -> Array:
    """Averaging times in whole samples, evenly spaced on a logarithmic axis."""
    steps = np.geomspace(first_s * rate_hz, last_s * rate_hz, POINTS)
    return np.unique(np.round(steps)).astype(np.float64) / rate_hz


def mark_powers(ax: Axes) -> None:
    """Marks of logarithmic axes in plain text: powers of ten, and 2 and 5 where there are few of these."""
    for axis, (low, high) in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
        axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, 1)))
        few = np.log10(high / low) < FEW_DECADES
        axis.set_minor_formatter(FuncFormatter(_of_two_and_five) if few else NullFormatter())


def _of_two_and_five(value: float, _: int | None = None) -> str:
    return plain(value, 1) if f"{value:.0e}"[0] in "25" else ""


def root(two_sided: Array) -> Array:
    """One-sided amplitude density."""
    return np.asarray(np.sqrt(2 * two_sided))


def _mark_lines(ax: Axes, found: NoiseAnalysis) -> None:
    for line in found.lines:
        ax.axvline(line.frequency_hz, color=VERMILION, lw=0.7, ls=":")
        ax.annotate(f"{line.frequency_hz:.4g} Hz", (line.frequency_hz, 1), xycoords=("data", "axes fraction"),
                    rotation=90, ha="right", va="top", fontsize=8)  # fmt: skip
