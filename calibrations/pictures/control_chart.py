"""Pictures of control charts: a row for each quantity, with its individuals, its moving ranges and its EWMA."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from calibrations.evaluations.control_chart import Chart
from calibrations.pictures.style import BAND, BLUE, INK, QUIET, VERMILION, panels, styled
from calibrations.table import Array

WORDS = ("individuals", "moving range", "EWMA")


@styled
def control_charts(charts: Mapping[str, Chart], units: Mapping[str, str]) -> Figure:
    """Charts by quantity, less their centre; open dots are the baseline, vermilion ones beyond a limit."""
    figure, axes = panels(len(charts), len(WORDS), 2.3, sharex="col")
    for row, (name, chart) in zip(axes, charts.items(), strict=True):
        n = np.arange(1.0, len(chart.values) + 1)
        reach, ewma_reach, limit = (
            np.full(len(n), chart.reach),
            chart.ewma_reach,
            np.full(len(n) - 1, chart.range_limit),
        )
        _points(row[0], n, chart.values - chart.centre, (-reach, reach), chart.jumps, chart.judged)
        _points(row[1], n[1:], chart.ranges, (0 * limit, limit), [], chart.judged - 1)
        _points(row[2], n, chart.ewma - chart.centre, (-ewma_reach, ewma_reach), chart.drifts, chart.judged)
        row[0].set_ylabel(f"{name} less {chart.centre:.6g} {units[name]}\n(µ{units[name]})")
        row[2].set_title(chart.verdict, loc="right", color=VERMILION if chart.verdict == "out of control" else INK)
    for ax, words in zip(axes[0], WORDS, strict=True):
        ax.set_title(words)
    for ax in axes[-1]:
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_xlabel("run")
    return figure


def _points(ax: Axes, n: Array, values: Array, limits: tuple[Array, Array], beyond: Sequence[int], judged: int) -> None:
    """Values in order, with their limits as a band; in millionths."""
    low, high = (1e6 * limit for limit in limits)
    ax.fill_between(n, low, high, step="mid", color=BAND, lw=0, zorder=0.5)
    ax.axhline(0.0, color=QUIET, lw=0.7, zorder=0.6)
    ax.plot(n, 1e6 * values, color=BLUE, lw=0.8, zorder=1.5)
    colours = [VERMILION if k in beyond else BLUE for k in range(len(n))]
    faces = ["white" if k < judged else colour for k, colour in enumerate(colours)]
    ax.scatter(n, 1e6 * values, s=16, c=faces, edgecolors=colours, linewidths=0.9, zorder=2)
