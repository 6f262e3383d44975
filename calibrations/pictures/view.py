"""What pictures show of a fit: its rows in groups of one colour and marker, its columns, its residual in mV and mg.

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

from calibrations.axes import other_in_plane, out_of_plane
from calibrations.chain import backward, force
from calibrations.compare import scales
from calibrations.fit import Fit
from calibrations.pictures.style import BLUE, GREEN, INCLINATION, INK, MARKER, VERMILION, beside, quarters
from calibrations.table import Array, Table

MOST_KEYS = 16
KEYS_IN_A_ROW = 10


@dataclass(frozen=True)
class Group:
    """Rows that share a colour and a marker. `side` is +1 filled, -1 open, 0 small."""

    label: str
    colour: str
    side: int
    rows: NDArray[np.intp]


@dataclass(frozen=True)
class Column:
    """Something to draw against: values of shape (channels, n), and a label for each channel."""

    name: str
    labels: tuple[str, ...]
    values: Array


def groups(fit: Fit) -> list[Group]:
    """The rows of a fit in groups."""
    if fit.table.kind == "poses":
        return list(_by_inclination(fit.table))
    return list(_by_axis(specific_force(fit)))


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


def _by_axis(a: Array) -> Iterator[Group]:
    nearest = np.argmax(np.abs(a), axis=1)
    side = np.sign(np.take_along_axis(a, nearest[:, None], axis=1)[:, 0])
    for k, (axis, colour) in enumerate(zip("xyz", (BLUE, VERMILION, GREEN), strict=True)):
        for s in (1, -1):
            rows = np.flatnonzero((nearest == k) & (side == s))
            if len(rows):
                yield Group(f"{axis} nearest to gravity", colour, s, rows)


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
    words = {1: "clockwise" if turning else "upwards", -1: "anticlockwise" if turning else "downwards"}
    for side, word in words.items():
        if any(g.side == side for g in found):
            face = INK if side > 0 else "none"
            marks.append(Line2D([], [], color=INK, mfc=face, mew=0.7, marker="o", ls="", label=word))
    figure.legend(handles=marks, loc="outside upper left", ncols=KEYS_IN_A_ROW, handletextpad=0.2, columnspacing=1.4)


def specific_force(fit: Fit) -> Array:
    """Specific force along the sensing axes by the model, g, shape (n, 3)."""
    steps = fit.problem.layout.steps(fit.theta)
    return force(fit.table, steps) if fit.table.kind == "poses" else backward(fit.table, steps)


def columns(fit: Fit) -> list[Column]:
    """What the residual is drawn against: angle or specific force, time, temperature, as far as measured."""
    table, n = fit.table, len(fit.channels)
    if table.kind == "poses":
        found = [_same("beta", "β (deg)", table.column("beta_deg"), n)]
    else:
        forces = specific_force(fit).T
        found = [_same(f"a{k}", f"specific force along {k} (g)", a, n) for k, a in zip("xyz", forces, strict=True)]
    return found + _others(table, n)


def telling_columns(fit: Fit) -> list[Column]:
    """Columns that an effect may follow, the plainest cause first."""
    table, n = fit.table, len(fit.channels)
    if table.kind != "poses":
        return columns(fit)[:3] + _others(table, n)[::-1]
    a = specific_force(fit)
    roles = {"own": a, "other": other_in_plane(a), "out": out_of_plane(a)}
    names = {"own": "xyz", "other": "yxx", "out": "zzy"}
    forces = [
        Column(role, tuple(f"specific force along {names[role][k]} (g)" for k in range(n)), values.T[:n])
        for role, values in roles.items()
    ]
    return forces + columns(fit)[:1] + _others(table, n)[::-1]


def _others(table: Table, n: int) -> list[Column]:
    """Time, and temperature where it was measured and moved."""
    found = [_time(table, n)]
    if "temperature_c" in table and np.ptp(table.column("temperature_c")) > 0:
        found.append(_same("temperature", "temperature (°C)", table.column("temperature_c"), n))
    return found


def _time(table: Table, n: int) -> Column:
    if "t_s" not in table:
        return _same("row", "row (number)", np.arange(1.0, table.n + 1), n)
    length = float(np.ptp(table.time_s))
    size, unit = next((s, u) for limit, s, u in LENGTHS if length > limit)
    return _same("time", f"time ({unit})", table.time_s / size, n)


LENGTHS = ((7200.0, 3600.0, "h"), (180.0, 60.0, "min"), (-1.0, 1.0, "s"))


def _same(name: str, label: str, values: Array, n: int) -> Column:
    return Column(name, (label,) * n, np.tile(values, (n, 1)))


def shown_unit(fit: Fit) -> str:
    """The unit that a residual is drawn in."""
    return "mg" if fit.table.kind != "poses" else f"m{fit.table.unit}"


def label_of(fit: Fit, c: int) -> str:
    """The name of a channel's residual."""
    return f"residual of {fit.channels[c]}" if fit.table.kind == "poses" else "residual of |a|"


def label_column(ax: Axes, column: Column, c: int, last: bool) -> None:
    """The column's label under the last panel of a column of panels; angles are marked at quarters of a turn."""
    if column.name == "beta":
        quarters(ax)
    if last:
        ax.set_xlabel(column.labels[c])


def label_residual(ax: Axes, fit: Fit, c: int, last: bool) -> None:
    """The residual's unit on the left axis; on the last panel of a row mg on the right."""
    if ax.get_subplotspec() is None or ax.get_subplotspec().is_first_col():  # type: ignore[union-attr]
        ax.set_ylabel(f"{label_of(fit, c)} ({shown_unit(fit)})")
    if last and fit.table.kind == "poses":
        beside(ax, float(scales(fit)[c]), 0.0, "mg")


def mg(values: Array, fit: Fit) -> Array:
    """Values per channel, in the residual's unit, as mg."""
    return np.asarray(1e3 * values / scales(fit))


def pooled_mg(fit: Fit) -> tuple[float, float]:
    """Rms of the residual over all channels, and the noise floor, both in mg."""
    error, floor = mg(fit.rmse, fit), mg(fit.noise.floor, fit)
    return float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(floor**2)))
