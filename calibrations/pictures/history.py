"""Pictures of a sensor's life: every calibration with its uncertainty, its drift, and what is allowed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibrations.evaluations.stability import Stability
from calibrations.pictures.style import BAND, BLUE, MARKER, QUIET, VERMILION, panels, styled

POINTS = 200
AHEAD = 0.5  # of the time from first to last: how far the line is drawn on


@dataclass(frozen=True)
class Shown:
    """One quantity: days since 1970, values with expanded uncertainties, its line, limits, and when it is due."""

    t_days: Sequence[float]
    values: Sequence[float]
    expanded: Sequence[float]
    unit: str
    line: Stability | None
    allowed: tuple[float, float] | None
    due_days: float | None


@styled
def life(quantities: Mapping[str, Shown]) -> Figure:
    """A row for each quantity."""
    figure, axes = panels(len(quantities), 1, 2.0, sharex=True)
    for ax, (name, shown) in zip(axes[:, 0], quantities.items(), strict=True):
        _quantity(ax, shown)
        ax.set_title(name)
        ax.set_ylabel(shown.unit or "1")
    axes[-1, 0].xaxis_date()
    for ax in axes[:, 0]:
        if ax.get_legend_handles_labels()[1]:
            ax.legend(loc="upper left", ncols=2)
    return figure


def _quantity(ax: Axes, shown: Shown) -> None:
    first, last = shown.t_days[0], shown.t_days[-1]
    end = max(shown.due_days or 0.0, last + AHEAD * (last - first))
    if shown.line is not None:
        days = np.linspace(first, end, POINTS)
        value, std = shown.line.predict(days)
        reach = shown.line.coverage * std
        ax.fill_between(days, value - reach, value + reach, color=BAND, lw=0, label="95 % of the value then")
        ax.plot(days, value, color=QUIET, lw=0.9)
    for limit in shown.allowed or ():
        ax.axhline(limit, color=VERMILION, lw=0.9, ls="--")
    if shown.due_days is not None:
        ax.axvline(shown.due_days, color=VERMILION, lw=0.9, label="due")
    ax.errorbar(shown.t_days, shown.values, yerr=shown.expanded, fmt="o", ms=MARKER, color=BLUE, lw=1.0, capsize=2)
