"""An effect's signature: what the linear model leaves where the effect acts, over the column that shows it best.

Made by the effect's own functions, without noise, on a sensor of 1 V/g: a sweep of full turns each way at five
inclinations while the room warms and cools, or, for an effect that only motion shows, oscillations beside a rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, MultipleLocator

from calibrations.axes import other_in_plane
from calibrations.chain import Step, force, forward
from calibrations.effect import Effect, catalogue
from calibrations.pictures.shown import Curve, Panel, shown
from calibrations.pictures.signature_turned import of_field, of_rates
from calibrations.pictures.style import BLUE, INCLINATION, INK, QUIET, styled
from calibrations.table import Array, Table

INCLINATIONS_DEG = (90.0, 30.0, 150.0, 60.0, 120.0)
STEP_DEG = 9.0
SMOOTH = 1.0  # von Neumann's ratio of a residual that is a function of a force; 2 where it is none
SAME = 0.02  # of its range
DIGITS = 4  # decimals of mV: what lies beyond depends on the machine
CLOSE_S = (3.0, 4.0)  # of a motion, where its waves are to be seen
LABELS = {"t_s": "time (min)", "temperature_c": "temperature (°C)", "supply_v": "supply voltage (V)"}


@styled
def picture(effect: Effect) -> Figure:
    """A panel for each axis that the effect reaches; lines are coloured by inclination, and broken on the way back."""
    panels = signature(effect)
    figure = Figure(figsize=(7.2, 2.45))
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for ax, panel in zip(axes, panels, strict=True):
        ax.axhline(0.0, color=QUIET, lw=0.6)
        for curve in panel.curves:
            ax.plot(panel.over[curve.rows], panel.left[curve.rows], curve.style, color=curve.colour, lw=1.3)
        ax.set_xlabel(panel.label)
        ax.set_title(
            f"{panel.axis} axis" if len(panel.axis) == 1 else panel.axis,
            loc="right",
            color=QUIET,
            fontsize=9,
            fontweight="normal",
            pad=4,
        )
        ax.margins(x=0.02, y=0.08)
        ax.xaxis.set_major_locator(
            MultipleLocator(90) if panel.label.startswith("β") else MaxNLocator(5, steps=[1, 2, 5, 10])
        )
    axes[0].set_ylabel(f"left over ({panels[0].unit})")
    if len(panels[0].curves) > 1:
        figure.legend(handles=_key(panels[0].curves), loc="outside upper left", ncols=7, handlelength=1.4)
    return figure


def _key(curves: tuple[Curve, ...]) -> list[Line2D]:
    """Colours of inclinations and, where there are both, styles of directions."""
    colours = [Line2D([], [], color=c.colour, label=c.label) for c in curves if c.style == "-"]
    colours = list({line.get_label(): line for line in colours}.values())
    sides = (("-", "clockwise"), ("--", "back")) if any(c.style == "--" for c in curves) else ()
    return [*colours, *(Line2D([], [], color=INK, ls=style, label=word) for style, word in sides)]


def signature(effect: Effect) -> list[Panel]:
    """What the linear model leaves of the effect, axis by axis."""
    if effect.kinds == ("fields",):
        return [of_field(effect)]
    if effect.kinds == ("rates",):
        return of_rates(effect)
    known = catalogue()
    linear: list[Step] = [
        (known["bias"], {"bias": np.full(3, 2.5)}),
        (known["scale-factor"], {"scale": np.ones(3)}),
    ]
    table = sweep() if "poses" in effect.kinds else motion()
    v, a = forward(table, linear), force(table, linear)
    table = replace(table, columns={**table.columns, "vx_v": v[:, 0], "vy_v": v[:, 1]})
    change = forward(table, [*linear, (effect, shown(effect, table))]) - v
    lefts = [(k, _left(table, change[:, k], v[:, k], effect.name)) for k in range(v.shape[1])]
    return [_panel(effect, table, a, k, left) for k, left in lefts if left.any()]


def _left(table: Table, change: Array, v: Array, name: str) -> Array:
    """The change of an output, V, less the straight line in that output that follows it best; mV.

    Bias and scale factor are beside a model that has all but them.
    """
    once = table.optional("beta_deg", 0.0) < 360.0  # the end of a turn is its beginning
    line = np.column_stack([np.ones(len(v)), v])
    line = {"bias": line[:, :0], "scale-factor": line[:, :1]}.get(name, line)
    left = change - line @ np.linalg.lstsq(line[once], change[once], rcond=None)[0]
    return np.asarray(np.round(1e3 * left, DIGITS) + 0.0)


def _panel(effect: Effect, table: Table, a: Array, k: int, left: Array) -> Panel:
    """Over what the effect needs beside the angles, a force that what is left is a function of, or beta."""
    axis, other = "xyz"[k], "yxx"[k]
    if table.kind == "motion":
        close = (table.time_s >= CLOSE_S[0]) & (table.time_s <= CLOSE_S[1])
        rows = np.flatnonzero(close) if effect.output else np.arange(0, table.n, 8)
        return Panel(axis, left, table.time_s, "time (s)", (Curve("", BLUE, "-", rows),))
    if needed := [name for name in effect.needs if name in LABELS]:
        over = table.column(needed[0]) / (60.0 if needed[0] == "t_s" else 1.0)
        return Panel(axis, left, over, LABELS[needed[0]], tuple(_by_inclination(table, ("-", "-"))))
    for name, felt in ((axis, a[:, k]), (other, other_in_plane(a)[:, k])):
        _, rows, each = np.unique(np.round(felt, 6), return_index=True, return_inverse=True)
        if np.max(np.abs(left - left[rows][each])) < SAME * np.ptp(left) and _smooth(left[rows]):
            return Panel(axis, left, felt, f"specific force along {name} (g)", (Curve("", BLUE, "-", rows),))
    styles = ("-", "--") if "direction" in effect.needs else ("-",)
    return Panel(axis, left, table.column("beta_deg"), "β (deg)", tuple(_by_inclination(table, styles)))


def _smooth(values: Array) -> bool:
    """Whether neighbours are alike (von Neumann, 1941)."""
    steps, away = np.diff(values), values - values.mean()
    return float(steps @ steps) < SMOOTH * float(away @ away)


def _by_inclination(table: Table, styles: tuple[str, ...]) -> Iterator[Curve]:
    """The rows of each inclination, one line for each direction that has a style."""
    alpha, direction = table.column("alpha_deg"), table.column("direction")
    for inclination in sorted(INCLINATIONS_DEG):
        colour = to_hex(INCLINATION((inclination - 30.0) / 120.0))
        for side, style in zip((1.0, -1.0), styles, strict=False):
            rows = np.flatnonzero((alpha == inclination) & (direction == side))
            yield Curve(f"α = {inclination:g}°", colour, style, rows)


def sweep() -> Table:
    """Full turns each way at each inclination from power-on, while room and supply rise and fall."""
    up = np.arange(0.0, 361.0, STEP_DEG)
    beta = np.tile(np.concatenate([up, up[::-1]]), len(INCLINATIONS_DEG))
    t = 2600.0 * np.linspace(0.0, 1.0, len(beta))
    columns = {
        "alpha_deg": np.repeat(INCLINATIONS_DEG, 2 * len(up)),
        "beta_deg": beta,
        "direction": np.tile(np.repeat([1.0, -1.0], len(up)), len(INCLINATIONS_DEG)),
        "t_s": t,
        "temperature_c": 25.0 + 4.0 * np.sin(2 * np.pi * t / 1300.0),
        "supply_v": 5.0 + 0.02 * np.sin(2 * np.pi * t / 900.0),
        "vx_v": 2.5 + np.sin(t),  # only its range counts, until the model has made it
        "vy_v": 2.5 + np.cos(t),
    }
    return Table.from_columns("poses", columns, source="a sweep")


def motion() -> Table:
    """Oscillation along x at 10 and 4 Hz, between rests."""
    t = np.arange(0.0, 8.0, 0.005)
    on = np.clip(np.minimum(t - 2.0, 6.0 - t) / 0.2, 0.0, 1.0)
    a = on * (0.12 * np.sin(2 * np.pi * 10 * t) + 0.05 * np.sin(2 * np.pi * 4 * t))
    columns = {"t_s": t, "displacement_m": np.zeros(len(t)), "vx_v": 2.5 + a, "vy_v": 2.5 + a}
    columns |= {"acceleration_m_s2": a, "alpha_deg": np.full(len(t), 45.0), "beta_deg": np.full(len(t), 90.0)}
    return Table.from_columns("motion", columns, source="a motion")
