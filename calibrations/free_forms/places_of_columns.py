"""Components that the output and logged columns drive: converter, supply, vibration, any other column.

A column with scatter in its readings is tried as logged, and as its level beneath the scatter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.effects.logged import level, level_is_known, reading_error
from calibrations.free_forms.bases import StraightLine, spline
from calibrations.free_forms.chain import State
from calibrations.free_forms.components import PRODUCT, Component, free, per_axis
from calibrations.free_forms.form import Factor, Form
from calibrations.free_forms.poses import PoseData
from calibrations.table import Array, Table

SMOOTH = 2 * math.log(2)  # price of the second of two readings of a column
LEAST_SCATTER = 0.03  # of the readings' rms: with less the readings of a column are its level


def over_output(data: PoseData, first: State) -> list[Component]:
    if data.channels < 2:
        return []
    low, high = float(data.outputs.min()), float(data.outputs.max())
    middle, half = (low + high) / 2, (high - low) / 2 or 1.0

    def powers(s: State) -> Array:
        u = (s.response - middle) / half
        return np.stack([u**2, u**3], axis=2)

    return [
        Component("output/adc-nonlinearity", "output", "output", "adc-nonlinearity", columns=powers),
        free(Form("output", "curve", "output", (spline(data.outputs.ravel(), 22),), shared=True), first),
    ]


@dataclass(frozen=True, eq=False)
class ColumnReading:
    """Values of a column, or of a column an axis, (n,) each: as logged, or their level, with its relative rms error."""

    values: tuple[Array, ...]
    is_level: bool = False
    error: float = 0.0

    @property
    def price(self) -> float:
        """The additional gain that a component needs if this reading drives it."""
        return SMOOTH * self.is_level

    @property
    def constants(self) -> tuple[tuple[str, float], ...]:
        """Constants of a catalogue effect that this reading drives."""
        return (("level", float(self.is_level)),)

    def component_name(self, name: str) -> str:
        """The name of a component that this reading drives."""
        return f"{name}-of-level" if self.is_level else name


def _readings(table: Table, names: Sequence[str], power: int = 1) -> list[ColumnReading]:
    """Columns to a power as logged, and as their level where scatter is a part of them."""
    logged = tuple(table.column(name) ** power for name in names)
    levels = tuple(level(table, name, power) for name in names)
    scatter = max(float(np.std(x - y) / (np.std(x) or 1.0)) for x, y in zip(logged, levels, strict=True))
    if scatter < LEAST_SCATTER:
        return [ColumnReading(logged)]
    if not all(level_is_known(table, name, power) for name in names):
        return [ColumnReading(logged)]  # what the outputs follow differs from row to row by itself
    error = max(reading_error(table, name, power) for name in names)
    return [ColumnReading(logged, error=float(np.hypot(scatter, error))), ColumnReading(levels, True, error)]


def over_columns(data: PoseData, first: State) -> list[Component]:
    """Components of the supply, of the scatter of the samples, and of every other column that changes."""
    table = data.table
    components: list[Component] = []
    if "supply_v" in table and np.ptp(table.column("supply_v")) > 0:
        for supply in _readings(table, ("supply_v",)):
            cause = "supply-sensitivity"  # IEEE Std 1293: of the bias, and of the scale factor
            components += [_supply_component(supply), *_over_column("column:supply_v", supply, first, cause)]
    if data.spread is not None and np.all(np.ptp(data.spread, axis=1) > 0):
        for squares in _readings(table, table.std_names, power=2):
            components += _vibration_components(squares, first)
    for name in data.logged:
        for reading in _readings(table, (name,)):
            components += _over_column(f"column:{name}", reading, first)
    return components


def _supply_component(supply: ColumnReading) -> Component:
    """The output in proportion to the supply."""
    place, cause = "column:supply_v", "supply-sensitivity"
    (volts,) = supply.values
    excess = (volts / volts.mean() - 1)[:, None]
    columns = per_axis(lambda state, k: state.response[k, :, None] * excess)
    return Component(
        supply.component_name(f"{place}/{cause}"), place, "output", cause, f"{place}/{cause}", supply.price, columns,
        constants=supply.constants, error=supply.error,
    )  # fmt: skip


def _vibration_components(squares: ColumnReading, first: State) -> list[Component]:
    """A bias over the mean square of the samples of each axis, whose coefficient may follow the force."""
    place, cause = "column:std", "vibration-rectification"
    columns = per_axis(lambda _, k: (squares.values[k] - squares.values[k].mean())[:, None])
    curves = tuple(spline(q, 6) for q in squares.values)
    lines = tuple(StraightLine(float(q.min()), float(q.max())) for q in squares.values)
    curve = Form(place, squares.component_name("curve"), "variance", curves, level=squares.is_level)
    scale = Form(place, squares.component_name("scale-line"), "variance", lines, "force", level=squares.is_level)
    return [
        Component(
            squares.component_name(f"{place}/{cause}"), place, "response", cause, f"{place}/{cause}", squares.price,
            columns, constants=squares.constants, error=squares.error,
        ),
        free(curve, first, price=squares.price, family=f"{place}/curve", error=squares.error),
        free(scale, first, price=PRODUCT + squares.price, family=f"{place}/scale-line", error=squares.error),
    ]  # fmt: skip


def _over_column(place: str, reading: ColumnReading, first: State, cause: str = "") -> list[Component]:
    """Bias and scale factor over a logged column, as a line, which is a form of the `cause`, and as a curve."""
    (x,) = reading.values
    line, curve = (StraightLine(float(x.min()), float(x.max())),), (spline(x, 8),)
    factors: tuple[tuple[str, Factor, float], ...] = (("", "", 0.0), ("scale-", "force", PRODUCT))
    components = []
    for prefix, factor, price in factors:
        for kind, bases in (("line", line), ("curve", curve)):
            form = Form(place, reading.component_name(f"{prefix}{kind}"), place, bases, factor, level=reading.is_level)
            family = f"{place}/{prefix}{kind}"
            components.append(
                free(
                    form, first, cause if kind == "line" else "",
                    price=price + reading.price, family=family, error=reading.error,
                )
            )  # fmt: skip
    return components
