"""Residuals as charts and texts show them: the rows, their unit, and the text of each row under the pointer."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.effects import Effect
from calibrations.fitting.fit import Fit, milli_unit, scales
from calibrations.geometry.orientation import other_in_plane, out_of_plane
from calibrations.means.noise import rms
from calibrations.model.chain import backward, force
from calibrations.table import AXES, MILLI, Array, Table, in_time, time_origin
from calibrations.text import milli_amount, rounded

RESOLUTION_C = 0.01  # a smaller range of temperatures is that of a constant one
MANY_VISITS = 10  # of one pose: the change over time is the question, and not the angle
POSE_COLUMNS = ("direction", "alpha_deg", "beta_deg")
NAMES = {
    "alpha_deg": "α (deg)",
    "beta_deg": "β (deg)",
    "temperature_c": "temperature (°C)",
    "supply_v": "supply voltage (V)",
    "direction": "direction of turning",
    "mount_deg": "turn on the table (deg)",
    "flip": "face down",
    "n": "samples averaged",
    **{f"axis_{axis}": f"axis of rotation along {axis}" for axis in AXES},
    **{f"a{axis}": f"specific force along {axis} (g)" for axis in AXES},
}
UNITS = {  # ends of names
    "deg_s": "deg/s",
    "m_s2": "m/s²",
    "deg": "deg",
    "hz": "Hz",
    "v": "V",
    "s": "s",
    "c": "°C",
    "m": "m",
}


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
    """The abscissas of the residual: angle or specific force, time, temperature, as far as measured."""
    table, n = fit.table, len(fit.channels)
    first: list[Column] = []
    if table.type.drawn_over:
        name, label, column = table.type.drawn_over
        first = [_column(name, label, table.column(column), n)]
    elif table.type.magnitude:
        first = _sensed_column(fit, "a")
    return first + _logged_columns(table, n)


def _sensed_column(fit: Fit, letter: str) -> list[Column]:
    """The sensed quantity along each axis, named by a letter and the axis."""
    axis_label, n = fit.table.type.sensed_along, len(fit.channels)
    return [_column(letter + k, axis_label.format(k), a, n) for k, a in zip(AXES, specific_force(fit).T, strict=True)]


def select_telling_columns(fit: Fit, effect: Effect) -> list[Column]:
    """Columns that an effect may follow: the specific forces, beta, and the columns that it needs.

    An effect does not know other columns, such as time. A change over time can come from successive inclinations.
    """
    table, n = fit.table, len(fit.channels)
    drivers = [_driver(table, name, n) for name in effect.needs if name not in POSE_COLUMNS]
    if table.type.moving:  # the explained part repeats in every stretch
        return columns(fit)[:1] + drivers
    if table.type.turning:
        return _sensed_column(fit, "w") + drivers
    if not table.type.stage_angles:
        return columns(fit)[:3] + drivers
    a = specific_force(fit)
    roles = {"own": a, "other": other_in_plane(a), "out": out_of_plane(a)}
    names = {"own": "xyz", "other": "yxx", "out": "zzy"}
    forces = [
        Column(role, tuple(f"specific force along {names[role][k]} (g)" for k in range(n)), values.T[:n])
        for role, values in roles.items()
    ]
    return forces + columns(fit)[:1] + drivers


def _driver(table: Table, name: str, n: int) -> Column:
    if name == "t_s":
        return _time(table, n)
    return _column(name, column_label(name), table.column(name), n)


def _logged_columns(table: Table, n: int) -> list[Column]:
    """Time, and temperature where it was measured and moved."""
    columns = [_time(table, n)]
    if "temperature_c" in table and np.ptp(table.column("temperature_c")) > RESOLUTION_C:
        columns.append(_driver(table, "temperature_c", n))
    return columns


def _time(table: Table, n: int) -> Column:
    if "t_s" not in table:
        return _column("row", "row (number)", np.arange(1.0, table.n + 1), n)
    size, unit = in_time(float(np.ptp(table.time_s)))
    zero_s, origin_words = time_origin(table)
    return _column("time", f"time{origin_words} ({unit})", (table.time_s - zero_s) / size, n)


def _column(name: str, label: str, values: Array, n: int) -> Column:
    return Column(name, (label,) * n, np.tile(values, (n, 1)))


def choices(fit: Fit) -> dict[str, Column]:
    """Columns that a residual may be drawn against or coloured by; the most likely causes first."""
    table, n = fit.table, len(fit.channels)
    by_name = {column.name: column for column in columns(fit)}
    if table.type.stage_angles:
        by_name |= {column.name: column for column in _sensed_column(fit, "a")}
    elif not table.type.moving:
        by_name["axis"] = nearest_axis(fit)
    driver_columns = {"beta_deg" if name == "beta" else name for name in by_name}
    driver_columns |= {"t_s", "temperature_c"} & set(table.columns)
    for name, values in table.columns.items():
        if name not in driver_columns:
            by_name[name] = Column(name, (column_label(name, table.output_names),) * n, np.tile(values, (n, 1)))
    return by_name


def nearest_axis(fit: Fit) -> Column:
    """The sensor axis nearest to gravity, to the field or to the axis of rotation: 0, 1, 2."""
    n, nearest = len(fit.channels), np.argmax(np.abs(specific_force(fit)), axis=1).astype(float)
    return Column("axis", (f"axis nearest to {fit.table.type.nearest_to}",) * n, np.tile(nearest, (n, 1)), AXES)


def first_choices(names: Sequence[str], table: Table) -> tuple[str, str]:
    """The first abscissa of the residual chart, and the first column for its colours.

    A few poses that are held again and again, as in a soak, are drawn over time.
    """
    if {"beta", "time"} <= set(names) and repeats(table):
        return "time", "beta"
    colour = next((name for name in ("alpha_deg", "axis", "time", "row") if name in names), names[-1])
    return names[0], colour


def repeats(table: Table) -> bool:
    """Whether the rows are visits to a few stage angles, each `MANY_VISITS` times on average or more."""
    angles = np.column_stack([table.column("alpha_deg"), table.column("beta_deg")]).round()
    return len(angles) >= MANY_VISITS * len(np.unique(angles, axis=0))


def column_label(column: str, outputs: Collection[str] = ()) -> str:
    """The label of a column or a constant, with its unit: `rate_deg_s` as `rate (deg/s)`.

    Of the `outputs` of a sensor, `ax` is what it said, and no specific force that is known.
    """
    if column in NAMES and column not in outputs:
        return NAMES[column]
    end = next((end for end in UNITS if column.removesuffix(f"_{end}") not in ("", column)), "")
    label = column.removesuffix(f"_{end}").replace("_", " ")
    return f"{label} ({UNITS[end]})" if end else label


MOST = 4000  # rows that are drawn; more would make a page slow and a picture no clearer
WORST = 400  # of them are those that the model misses most
TURN_TEXTS = {1: ", clockwise", -1: ", anticlockwise"}


@dataclass(frozen=True)
class ChannelResidual:
    """Channel `c` of a fit, residuals in thousandths of the sensed quantity if `in_g`, else of the output."""

    fit: Fit
    c: int
    in_g: bool

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """The rows that are drawn: all, or evenly chosen ones and the worst."""
        n = self.fit.table.n
        if n <= MOST:
            return np.arange(n)
        worst = np.argsort(np.abs(self.fit.residual[self.c]))[-WORST:]
        return np.union1d(np.linspace(0, n - 1, MOST - WORST).astype(np.intp), worst)

    @property
    def thinned(self) -> str:
        """A remark if not all rows are drawn, else ""."""
        n = self.fit.table.n
        return f"{len(self.rows):,} of {n:,} rows are drawn, the worst among them" if n > MOST else ""

    @property
    def scale(self) -> float:
        """Output per g, field or deg/s."""
        return float(scales(self.fit)[self.c])

    @cached_property
    def factor(self) -> float:
        """Factor from the residual's own unit to `unit`."""
        return 1e3 / self.scale if self.in_g else 1e3

    @cached_property
    def unit(self) -> str:
        """The unit of the residual."""
        return milli_unit(self.fit) if self.in_g else residual_unit(self.fit)

    @cached_property
    def residual(self) -> Array:
        """The residual of the rows that are drawn, in `unit`."""
        return np.asarray(self.factor * self.fit.residual[self.c, self.rows])

    @cached_property
    def floor(self) -> float:
        """The noise floor in `unit`."""
        return self.factor * float(self.fit.noise.floor[self.c])

    @property
    def side(self) -> NDArray[np.intp]:
        """Direction of turning of the rows drawn: 1 clockwise, -1 anticlockwise, 0 unknown."""
        return np.asarray(np.sign(self.fit.table.optional("direction", 0.0))[self.rows], np.intp)

    @property
    def label(self) -> str:
        """Label of the residual's axis."""
        kind = self.fit.table.type
        if kind.magnitude:
            return f"residual of |{kind.symbol}| ({self.unit})"
        return f"residual of {self.fit.channels[self.c]} ({self.unit})"

    @cached_property
    def hover(self) -> list[str]:
        """Text of each row: pose, time, residual."""
        return [self._text(int(row)) for row in self.rows]

    def summary(self, points: Sequence[int]) -> str:
        """Selected points, as a number, a range of angles and an error."""
        rows = self.rows[list(points)]
        residual = self.factor * self.fit.residual[self.c, rows]
        text = f"{len(rows)} of {self.fit.table.n} selected"
        for name in ("alpha_deg", "beta_deg"):
            if name in self.fit.table:
                values = self.fit.table.column(name)[rows]
                text += f", {NAMES[name][0]} {values.min():g} to {values.max():g}°"
        times = rounded(float(rms(residual)) / self.floor, 2)
        return f"{text}: residual {self._signed(float(residual.mean()))} on average, rms {times} × the noise floor"

    def _signed(self, value: float) -> str:
        return f"{'+' if value > 0 else ''}{milli_amount(value, self.unit)}"

    def place(self, row: int) -> str:
        """The pose of a row, and its time."""
        return "<br>".join(_place(self.fit.table, row))

    def _text(self, row: int) -> str:
        residual = self.factor * float(self.fit.residual[self.c, row])
        times = rounded(abs(residual) / self.floor, 2)
        error = f"residual {self._signed(residual)}, {times} × the noise floor"
        return f"{self.place(row)}<br>{error}"


def _place(table: Table, row: int) -> Iterator[str]:
    """The pose and the time of a row, if known."""
    at = {name: float(values[row]) for name, values in table.columns.items()}
    number = int(table.numbers[row]) if table.numbers is not None else row
    if "beta_deg" in at:
        turning = TURN_TEXTS.get(int(at.get("direction", 0)), "")
        yield f"pose {number}: α {at['alpha_deg']:g}°, β {at['beta_deg']:g}°{turning}"
    elif "rate_deg_s" in at:
        yield f"row {number}: {at['rate_deg_s']:g} deg/s"
    else:
        yield f"row {number}"
    zero_s, origin_words = time_origin(table) if "t_s" in at else (0.0, "")
    details = [f"t = {at['t_s'] - zero_s:.0f} s{origin_words}"] if "t_s" in at else []
    details += [f"{at['temperature_c']:.2f} °C"] if "temperature_c" in at else []
    if details:
        yield ", ".join(details)


def residual_units(fit: Fit) -> dict[bool, str]:
    """The units of a residual: False the output's, True that of the sensed quantity."""
    sensed = fit.table.input_unit
    return {True: sensed} if fit.table.type.magnitude else {False: fit.table.unit, True: sensed}


def residual_unit(fit: Fit) -> str:
    """The unit that a residual is drawn in: thousandths of the output's."""
    return MILLI.get(fit.problem.unit, f"m{fit.problem.unit}")


def zero(fit: Fit, c: int) -> float:
    """The output at 0 g: the model's bias, else the middle of the measured range."""
    measured = fit.table.outputs[:, c]
    return fit.model.value(f"bias.{fit.channels[c]}", float(measured.max() + measured.min()) / 2)
