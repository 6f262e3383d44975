"""What a residual is drawn against: angles, specific force, time, temperature, and what an effect says it needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.effects import Effect
from calibrations.fit import Fit
from calibrations.geometry.orientation import other_in_plane, out_of_plane
from calibrations.model.chain import backward, force
from calibrations.table import AXES, Array, Table

LENGTHS = ((7200.0, 3600.0, "h"), (180.0, 60.0, "min"), (-1.0, 1.0, "s"))  # longer than, unit, its name
RESOLUTION_C = 0.01  # a smaller range of temperatures is that of a constant one
LABELS = {"temperature_c": "temperature (°C)", "supply_v": "supply voltage (V)"}
SHOWN_OTHERWISE = ("direction", "alpha_deg", "beta_deg")
NAMES = {
    "alpha_deg": "α (deg)",
    "beta_deg": "β (deg)",
    "temperature_c": "temperature (°C)",
    "supply_v": "supply (V)",
    "direction": "direction of turning",
    "mount_deg": "turn on the table (deg)",
    "flip": "face down",
    "n": "samples averaged",
    "rate_deg_s": "rate (deg/s)",
}
UNITS = {"deg": "deg", "v": "V", "s": "s", "c": "°C", "m": "m"}


@dataclass(frozen=True)
class Column:
    """Something to draw against: values of shape (channels, n), and a label for each channel."""

    name: str
    labels: tuple[str, ...]
    values: Array
    names: tuple[str, ...] = ()  # of the values 0, 1, 2, where they are classes


def specific_force(fit: Fit) -> Array:
    """Specific force along the sensing axes by the model, g, shape (n, 3)."""
    steps = fit.problem.layout.steps(fit.theta)
    return force(fit.table, steps) if fit.table.type.known_input else backward(fit.table, steps)


def columns(fit: Fit) -> list[Column]:
    """What the residual is drawn against: angle or specific force, time, temperature, as far as measured."""
    table, n = fit.table, len(fit.channels)
    found: list[Column] = []
    if table.type.drawn_over:
        name, label, column = table.type.drawn_over
        found = [_same(name, label, table.column(column), n)]
    elif table.type.magnitude:
        found = _sensed(fit, "a")
    return found + _others(table, n)


def _sensed(fit: Fit, letter: str) -> list[Column]:
    """What is sensed along each axis, named by a letter and the axis."""
    along, n = fit.table.type.sensed_along, len(fit.channels)
    return [_same(letter + k, along.format(k), a, n) for k, a in zip(AXES, specific_force(fit).T, strict=True)]


def telling_columns(fit: Fit, effect: Effect) -> list[Column]:
    """Columns that an effect may follow: the specific forces, beta, and what it needs beside them.

    It cannot follow what it does not know, such as time: inclinations that follow one another would only seem so.
    """
    table, n = fit.table, len(fit.channels)
    needed = [_needed(table, name, n) for name in effect.needs if name not in SHOWN_OTHERWISE]
    if table.type.moving:  # what it explains returns in every stretch
        return columns(fit)[:1] + needed
    if table.type.turning:
        return _sensed(fit, "w") + needed
    if not table.type.stage_angles:
        return columns(fit)[:3] + needed
    a = specific_force(fit)
    roles = {"own": a, "other": other_in_plane(a), "out": out_of_plane(a)}
    names = {"own": "xyz", "other": "yxx", "out": "zzy"}
    forces = [
        Column(role, tuple(f"specific force along {names[role][k]} (g)" for k in range(n)), values.T[:n])
        for role, values in roles.items()
    ]
    return forces + columns(fit)[:1] + needed


def _needed(table: Table, name: str, n: int) -> Column:
    if name == "t_s":
        return _time(table, n)
    return _same(name, LABELS.get(name, f"{name} (as given)"), table.column(name), n)


def _others(table: Table, n: int) -> list[Column]:
    """Time, and temperature where it was measured and moved."""
    found = [_time(table, n)]
    if "temperature_c" in table and np.ptp(table.column("temperature_c")) > RESOLUTION_C:
        found.append(_needed(table, "temperature_c", n))
    return found


def _time(table: Table, n: int) -> Column:
    if "t_s" not in table:
        return _same("row", "row (number)", np.arange(1.0, table.n + 1), n)
    size, unit = in_time(float(np.ptp(table.time_s)))
    return _same("time", f"time ({unit})", table.time_s / size, n)


def in_time(length_s: float) -> tuple[float, str]:
    """(unit in s, its name) for a time axis of this length."""
    return next((size, unit) for limit, size, unit in LENGTHS if length_s > limit)


def _same(name: str, label: str, values: Array, n: int) -> Column:
    return Column(name, (label,) * n, np.tile(values, (n, 1)))


def choices(fit: Fit) -> dict[str, Column]:
    """Columns that a residual may be drawn against or coloured by; the most likely causes first."""
    table, n = fit.table, len(fit.channels)
    found = {column.name: column for column in columns(fit)}
    if table.type.stage_angles:
        found |= {column.name: column for column in _sensed(fit, "a")}
    elif not table.type.moving:
        found["axis"] = nearest_axis(fit)
    drawn = {"beta_deg" if name == "beta" else name for name in found} | {"t_s", "temperature_c"} & set(table.columns)
    for name, values in table.columns.items():
        if name not in drawn:
            found[name] = Column(name, (named(name),) * n, np.tile(values, (n, 1)))
    return found


def nearest_axis(fit: Fit) -> Column:
    """The sensor axis nearest to gravity, to the field or to the axis of turn: 0, 1, 2."""
    n, nearest = len(fit.channels), np.argmax(np.abs(specific_force(fit)), axis=1).astype(float)
    return Column("axis", (f"axis nearest to {fit.table.type.nearest_to}",) * n, np.tile(nearest, (n, 1)), AXES)


def first_choices(found: Sequence[str]) -> tuple[str, str]:
    """What to draw against, and what to colour by, at first."""
    colour = next((name for name in ("alpha_deg", "axis", "time", "row") if name in found), found[-1])
    return found[0], colour


def named(column: str) -> str:
    """The label of a table's column, with its unit."""
    if column in NAMES:
        return NAMES[column]
    head, _, last = column.rpartition("_")
    return f"{head.replace('_', ' ')} ({UNITS[last]})" if head and last in UNITS else column.replace("_", " ")
