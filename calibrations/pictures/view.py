"""What pictures show of a fit: its rows in groups of one colour and marker, its residual in mV and mg.

Poses are coloured by inclination, positions by the axis that lies nearest to gravity. A filled marker is a clockwise
approach (or that axis upwards), an open one an anticlockwise one (or downwards), a small one where neither is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from calibrations.compare import scales
from calibrations.fit import Fit
from calibrations.pictures.columns import specific_force
from calibrations.pictures.style import BLUE, GREEN, INCLINATION, INK, MARKER, VERMILION, beside
from calibrations.table import MILLI, Array, Table

MOST_KEYS = 16
KEYS_IN_A_ROW = 10


@dataclass(frozen=True)
class Group:
    """Rows that share a colour and a marker. `side` is +1 filled, -1 open, 0 small."""

    label: str
    colour: str
    side: int
    rows: NDArray[np.intp]


def groups(fit: Fit) -> list[Group]:
    """The rows of a fit in groups."""
    if fit.table.kind == "poses":
        return list(_by_inclination(fit.table))
    if fit.table.kind == "motion":
        return list(_by_attitude(fit.table))
    what = {"fields": "the field", "rates": "the axis of turn"}.get(fit.table.content, "gravity")
    return list(_by_axis(specific_force(fit), what))


def _by_inclination(table: Table) -> Iterator[Group]:
    alpha, side = table.column("alpha_deg"), np.sign(table.optional("direction", 0.0))
    values = np.unique(alpha)
    span = float(np.ptp(values)) or 1.0
    for value in values:
        colour = to_hex(INCLINATION((value - values[0]) / span if len(values) > 1 else 0.4))
        for s in (1, -1, 0):
            rows = np.flatnonzero((alpha == value) & (side == s))
            if len(rows):
                yield Group(f"α = {value:g}°", colour, s, rows)


def _by_attitude(table: Table) -> Iterator[Group]:
    angles = np.column_stack([table.optional(name, 0.0) for name in ("alpha_deg", "beta_deg")])
    values, number = np.unique(angles, axis=0, return_inverse=True)
    for k, (alpha, beta) in enumerate(values):
        colour = to_hex(INCLINATION(k / (len(values) - 1) if len(values) > 1 else 0.4))
        yield Group(f"α = {alpha:g}°, β = {beta:g}°", colour, 1, np.flatnonzero(number.ravel() == k))


def _by_axis(a: Array, what: str) -> Iterator[Group]:
    nearest = np.argmax(np.abs(a), axis=1)
    side = np.sign(np.take_along_axis(a, nearest[:, None], axis=1)[:, 0])
    for k, (axis, colour) in enumerate(zip("xyz", (BLUE, VERMILION, GREEN), strict=True)):
        for s in (1, -1, 0):
            rows = np.flatnonzero((nearest == k) & (side == s))
            if len(rows):
                yield Group(f"{axis} nearest to {what}", colour, s, rows)


def dots(ax: Axes, group: Group, x: Array, y: Array, alpha: float = 1.0) -> Line2D:
    """The group's rows as markers."""
    face = group.colour if group.side >= 0 else "none"
    size = {1: MARKER, -1: 1.2 * MARKER, 0: 0.7 * MARKER}[group.side]
    line: Line2D = ax.plot(x, y, "o", ms=size, mew=0.7, mec=group.colour, mfc=face, alpha=alpha, zorder=2)[0]
    return line


def key(figure: Figure, found: list[Group]) -> None:
    """The key to colours and markers, above the figure."""
    colours = {g.label: g.colour for g in found}
    shown = list(colours)[:: 1 + (len(colours) - 1) // MOST_KEYS]
    marks = [Line2D([], [], color=colours[label], marker="o", ls="", label=label) for label in shown]
    turning = found[0].label.startswith("α")
    if found[0].label.startswith("α") and "β" in found[0].label:  # a motion has no direction of turning
        figure.legend(handles=marks, loc="outside upper left", ncols=KEYS_IN_A_ROW // 2)
        return
    words = {1: "clockwise" if turning else "upwards", -1: "anticlockwise" if turning else "downwards"}
    for side, word in words.items():
        if any(g.side == side for g in found):
            face = INK if side > 0 else "none"
            marks.append(Line2D([], [], color=INK, mfc=face, mew=0.7, marker="o", ls="", label=word))
    figure.legend(handles=marks, loc="outside upper left", ncols=KEYS_IN_A_ROW, handletextpad=0.2, columnspacing=1.4)


def shown_unit(fit: Fit) -> str:
    """The unit that a residual is drawn in."""
    return MILLI.get(fit.problem.unit, f"m{fit.problem.unit}")


def label_of(fit: Fit, c: int) -> str:
    """The name of a channel's residual."""
    if fit.table.kind == "motion":
        return f"residual of {fit.channels[c]}".replace(" in ", "\nin ").replace(" with", "\nwith")
    return (
        f"residual of |{'m' if fit.table.content == 'fields' else 'a'}|"
        if fit.table.kind == "positions"
        else f"residual of {fit.channels[c]}"
    )


def label_residual(ax: Axes, fit: Fit, c: int, last: bool) -> None:
    """The residual's unit on the left axis; on the last panel of a row mg on the right."""
    if ax.get_subplotspec() is None or ax.get_subplotspec().is_first_col():  # type: ignore[union-attr]
        ax.set_ylabel(f"{label_of(fit, c)} ({shown_unit(fit)})")
    if last and fit.table.kind != "positions":
        beside(ax, float(scales(fit)[c]), 0.0, MILLI[fit.table.input_unit])


def row_height(fit: Fit) -> float:
    """Inches for a channel's row of panels: a motion has many channels."""
    return 3.0 if fit.table.kind != "motion" else 2.0
