"""Residuals as charts and texts show them: the rows, their unit, and the text of each row under the pointer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.discovery.places import scales
from calibrations.fit import Fit
from calibrations.noise.means import rms
from calibrations.presentation.charts.columns import NAMES
from calibrations.presentation.text import minus, rounded
from calibrations.table import MILLI, Array, Table


def milli_unit(fit: Fit) -> str:
    """The unit of `in_milli`."""
    return MILLI[fit.table.input_unit]


def in_milli(values: Array, fit: Fit) -> Array:
    """Values per channel, in the residual's unit, as mg, thousandths of the field, or mdeg/s."""
    return np.asarray(1e3 * values / scales(fit))


def pooled_milli(fit: Fit) -> tuple[float, float]:
    """Rms of the residual over all channels, and the noise floor, in the unit of `in_milli`."""
    error, floor = in_milli(fit.rmse, fit), in_milli(fit.noise.floor, fit)
    return float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(floor**2)))


MOST = 4000  # rows that are drawn; more would make a page slow and a picture no clearer
WORST = 400  # of them are those that the model misses most
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
        return milli_unit(self.fit) if self.in_g else residual_unit(self.fit)

    @cached_property
    def residual(self) -> Array:
        """Of the rows drawn, in `unit`."""
        return np.asarray(self.factor * self.fit.residual[self.c, self.rows])

    @property
    def floor(self) -> float:
        """The noise floor in `unit`."""
        return self.factor * float(self.fit.noise.floor[self.c])

    @property
    def side(self) -> NDArray[np.intp]:
        """Direction of turning of the rows drawn: 1 clockwise, -1 anticlockwise, 0 unknown."""
        return np.asarray(np.sign(self.fit.table.optional("direction", 0.0))[self.rows], np.intp)

    @property
    def label(self) -> str:
        """Of the residual's axis."""
        kind = self.fit.table.type
        if kind.magnitude:
            return f"residual of |{kind.symbol}| ({self.unit})"
        return f"residual of {self.fit.channels[self.c]} ({self.unit})"

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
        times = rounded(float(rms(left)) / self.floor, 2)
        return f"{told}: residual {minus(f'{left.mean():+.3g}')} {self.unit} on average, rms {times} × the noise floor"

    def place(self, row: int) -> str:
        """The pose of a row, and when it was."""
        return "<br>".join(_place(self.fit.table, row))

    def _told(self, row: int) -> str:
        left = float(self.fit.residual[self.c, row])
        times = rounded(abs(left) / float(self.fit.noise.floor[self.c]), 2)
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


def residual_units(fit: Fit) -> dict[bool, str]:
    """What a residual can be given in: False the output's unit, True that of what is sensed."""
    sensed = fit.table.input_unit
    return {True: sensed} if fit.table.type.magnitude else {False: fit.table.unit, True: sensed}


def residual_unit(fit: Fit) -> str:
    """The unit that a residual is drawn in: thousandths of the output's."""
    return MILLI.get(fit.problem.unit, f"m{fit.problem.unit}")


def zero(fit: Fit, c: int) -> float:
    """The output at 0 g: the model's bias, else the middle of what was measured."""
    terms = [term for term in fit.model.terms if term.name == "bias"]
    values = {e.axis: e.value for term in terms for e in term.estimates}
    measured = fit.table.outputs[:, c]
    return float(values.get(fit.channels[c], (measured.max() + measured.min()) / 2))
