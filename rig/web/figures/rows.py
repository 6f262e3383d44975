"""Which rows of a fit are drawn, in which unit, and what each tells when it is pointed at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.compare import scales
from calibrations.fit import Fit
from calibrations.noise import rms
from calibrations.numerals import minus, plain
from calibrations.pictures.columns import Column, columns, specific_force
from calibrations.pictures.view import shown_unit
from calibrations.table import Array, Table
from calibrations.units import milli

MOST = 4000  # rows that are drawn; more would make a page slow and a picture no clearer
WORST = 400  # of them are those that the model misses most
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
TURNING = {1: ", clockwise", -1: ", anticlockwise"}


@dataclass(frozen=True)
class Shown:
    """Channel `c` of a fit, residuals in thousandths of what is sensed if `in_g`, else of the output."""

    fit: Fit
    c: int
    in_g: bool

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """Those that are drawn: all, or evenly chosen ones and the worst."""
        n = self.fit.table.n
        if n <= MOST:
            return np.arange(n)
        worst = np.argsort(np.abs(self.fit.residual[self.c]))[-WORST:]
        return np.union1d(np.linspace(0, n - 1, MOST - WORST).astype(np.intp), worst)

    @property
    def thinned(self) -> str:
        """Says so where not all rows are drawn."""
        n = self.fit.table.n
        return f"{len(self.rows):,} of {n:,} rows are drawn, the worst among them" if n > MOST else ""

    @property
    def scale(self) -> float:
        """Output per g, field or deg/s."""
        return float(scales(self.fit)[self.c])

    @property
    def factor(self) -> float:
        """From the residual's own unit to `unit`."""
        return 1e3 / self.scale if self.in_g else 1e3

    @property
    def unit(self) -> str:
        """What the residual is drawn in."""
        return milli(self.fit) if self.in_g else shown_unit(self.fit)

    @cached_property
    def residual(self) -> Array:
        """Of the rows drawn, in `unit`."""
        return np.asarray(self.factor * self.fit.residual[self.c, self.rows])

    @property
    def floor(self) -> float:
        """The noise floor in `unit`."""
        return self.factor * float(self.fit.noise.floor[self.c])

    @property
    def label(self) -> str:
        """Of the residual's axis."""
        of = "" if self.fit.table.kind == "positions" else f" of {self.fit.channels[self.c]}"
        return f"residual{of} ({self.unit})"

    @cached_property
    def hover(self) -> list[str]:
        """What each row tells: its pose, its time, what the model leaves."""
        return [self._told(int(row)) for row in self.rows]

    def summary(self, points: Sequence[int]) -> str:
        """Selected points, as a number, a range of angles and an error."""
        rows = self.rows[list(points)]
        left = self.factor * self.fit.residual[self.c, rows]
        told = f"{len(rows)} of {self.fit.table.n} selected"
        for name in ("alpha_deg", "beta_deg"):
            if name in self.fit.table:
                values = self.fit.table.column(name)[rows]
                told += f", {NAMES[name][0]} {values.min():g} to {values.max():g}°"
        times = plain(float(rms(left)) / self.floor, 2)
        return f"{told}: residual {minus(f'{left.mean():+.3g}')} {self.unit} on average, rms {times} × the noise floor"

    def place(self, row: int) -> str:
        """The pose of a row, and when it was."""
        return "<br>".join(_place(self.fit.table, row))

    def _told(self, row: int) -> str:
        left = float(self.fit.residual[self.c, row])
        times = plain(abs(left) / float(self.fit.noise.floor[self.c]), 2)
        error = f"residual {minus(f'{self.factor * left:+.3g}')} {self.unit}, {times} × the noise floor"
        return f"{self.place(row)}<br>{error}"


def _place(table: Table, row: int) -> Iterator[str]:
    """The pose of a row, and when it was, as far as is known."""
    at = {name: float(values[row]) for name, values in table.columns.items()}
    number = int(table.numbers[row]) if table.numbers is not None else row
    if "beta_deg" in at:
        turning = TURNING.get(int(at.get("direction", 0)), "")
        yield f"pose {number}: α {at['alpha_deg']:g}°, β {at['beta_deg']:g}°{turning}"
    elif "rate_deg_s" in at:
        yield f"row {number}: {at['rate_deg_s']:g} deg/s"
    else:
        yield f"row {number}"
    beside = [f"t = {at['t_s']:.0f} s"] if "t_s" in at else []
    beside += [f"{at['temperature_c']:.2f} °C"] if "temperature_c" in at else []
    if beside:
        yield ", ".join(beside)


def choices(fit: Fit) -> dict[str, Column]:
    """All that a residual may be drawn against or coloured by: first what it is likely to follow."""
    table, n = fit.table, len(fit.channels)
    found = {column.name: column for column in columns(fit)}
    if table.kind == "poses":
        for k, a in zip("xyz", specific_force(fit).T, strict=True):
            found[f"a{k}"] = Column(f"a{k}", (f"specific force along {k} (g)",) * n, np.tile(a, (n, 1)))
    drawn = {"beta_deg" if name == "beta" else name for name in found} | {"t_s", "temperature_c"} & set(table.columns)
    for name, values in table.columns.items():
        if name not in drawn:
            found[name] = Column(name, (named(name),) * n, np.tile(values, (n, 1)))
    return found


def named(column: str) -> str:
    """A table's column for people, with its unit."""
    if column in NAMES:
        return NAMES[column]
    head, _, last = column.rpartition("_")
    return f"{head.replace('_', ' ')} ({UNITS[last]})" if head and last in UNITS else column.replace("_", " ")


def first_choices(found: Sequence[str]) -> tuple[str, str]:
    """What to draw against, and what to colour by, to begin with."""
    colour = next((name for name in ("alpha_deg", "time", "row") if name in found), found[-1])
    return found[0], colour


def residual_units(fit: Fit) -> dict[bool, str]:
    """What a residual can be given in: False the output's unit, True that of what is sensed."""
    sensed = fit.table.input_unit
    return {True: sensed} if fit.table.kind == "positions" else {False: fit.table.unit, True: sensed}
