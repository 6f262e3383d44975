"""Pictures of a fleet: which batch has which effects, how the rigs differ, and how parameters spread over a batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calibrations.fleet.population import Population
from calibrations.fleet.rigs import RigError
from calibrations.numerals import percent
from calibrations.pictures.style import BLUE, FAINT, INK, MARKER, QUIET, SIGNED, VERMILION, panels, styled
from calibrations.table import Array

ROW = 0.32  # inches, of an effect or a rig
HALF = 0.5  # share of sensors from which on numbers are white
WIDE = 0.28  # of a batch's place that its sensors are strewn over
MOST_DOTS = 400  # of a batch
MOST_NAMED = 6  # sensors of a batch


@styled
def shares(found: Population) -> Figure:
    """Share of each batch's sensors that have each effect."""
    effects = list(dict.fromkeys(name for batch in found.batches for name in batch.shares))
    share = np.array([[batch.shares.get(name, 0.0) for batch in found.batches] for name in effects])
    figure, axes = panels(1, 1, ROW * len(effects) + 0.4)
    ax = axes[0, 0]
    ax.imshow(share, cmap=SIGNED, vmin=-1, vmax=1, aspect="auto")
    for (row, column), value in np.ndenumerate(share):
        if value:
            text, colour = percent(float(value)), "white" if value > HALF else INK
            ax.text(column, row, text, ha="center", va="center", color=colour)
    ax.set_xticks(range(len(found.batches)), [batch.batch or "no batch" for batch in found.batches])
    ax.set_yticks(range(len(effects)), effects)
    ax.xaxis.tick_top()
    ax.grid(visible=False)
    ax.tick_params(length=0)
    return figure


@styled
def rigs(errors: Sequence[RigError]) -> Figure:
    """Every rig's errors about the median of the rigs, with expanded uncertainties."""
    names = list(dict.fromkeys((e.effect, e.parameter, e.unit) for e in errors))
    of = list(dict.fromkeys(e.rig for e in errors))
    figure, axes = panels(len(names), 1, max(0.16 * len(of), 0.9) + 0.4)
    for ax, name in zip(axes[:, 0], names, strict=True):
        mine = [e for e in errors if (e.effect, e.parameter, e.unit) == name]
        for e in mine:
            colour = VERMILION if e.beyond else BLUE
            ax.errorbar(e.value, of.index(e.rig), xerr=2 * e.std, fmt="o", ms=MARKER, color=colour, lw=1, capsize=2)
        ax.axvline(0.0, color=QUIET, lw=0.7)
        ax.set_yticks(range(len(of)), of)
        ax.set_ylim(len(of) - 0.5, -0.5)
        ax.set_title(f"{name[0]}, {name[1]} in {name[2]}")
    return figure


@dataclass(frozen=True)
class Spread:
    """One quantity over a batch: value, expanded uncertainty, name of every sensor, and which are unlike the rest."""

    batch: str
    values: Array
    expanded: Array
    sensors: Sequence[str]
    apart: NDArray[np.bool_]
    band: tuple[float, float] | None  # where 95 % of the batch's sensors are


@styled
def spreads(quantities: Mapping[str, Sequence[Spread]]) -> Figure:
    """A row for each quantity, in which every batch has its place."""
    batches = list(dict.fromkeys(each.batch for of in quantities.values() for each in of))
    figure, axes = panels(len(quantities), 1, 1.7, sharex=True)
    for ax, (name, of) in zip(axes[:, 0], quantities.items(), strict=True):
        for each in of:
            _spread(ax, batches.index(each.batch), each)
        ax.set_title(name)
    axes[-1, 0].set_xticks(range(len(batches)), [batch or "no batch" for batch in batches])
    axes[-1, 0].set_xlim(-0.6, len(batches) - 0.4)
    return figure


def _spread(ax: Axes, place: int, each: Spread) -> None:
    rng = np.random.default_rng(place)
    shown = np.sort(rng.permutation(len(each.values))[:MOST_DOTS])
    shown = np.union1d(shown, np.flatnonzero(each.apart))
    x = place + WIDE * rng.uniform(-1, 1, len(each.values))
    if each.band is not None:
        ax.fill_between([place - 0.4, place + 0.4], *each.band, color=FAINT, lw=0, zorder=0.5)
    for chosen, colour in ((shown[~each.apart[shown]], BLUE), (shown[each.apart[shown]], VERMILION)):
        ax.errorbar(x[chosen], each.values[chosen], yerr=each.expanded[chosen], fmt="o", ms=2.4, color=colour, lw=0.5)
    for k in np.flatnonzero(each.apart)[:MOST_NAMED]:
        ax.annotate(each.sensors[k], (x[k], each.values[k]), xytext=(4, 0), textcoords="offset points", va="center")
