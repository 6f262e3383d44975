"""A free form: a basis, what drives it, and how it enters the signal chain.

driver        x of the function f                      unit
own           specific force along the own axis         g
cross         along the other axis in the plane         g
out-of-plane  along the axis out of the plane           g
force         all three components                      g
alpha, beta   stage angle                               rad
temperature   temperature, led by `lead_s`              deg C
time          time of the record                        s
output        output before the form                    the output's
variance      square of the samples' standard deviation the output's, squared
column:NAME   a logged column                           its own

factor        what f is multiplied by
force         specific force along the own axis, g
cross         along the other axis in the plane, g
out-of-plane  along the axis out of the plane, g
side          side of beta's last move, +-1
load          magnitude of the force along the other axis, g
pressed       not multiplied: limits of slip elements grow by that magnitude
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from calibrations.effects.kernels import play, slip_elements
from calibrations.effects.logged import leading_temperature, level
from calibrations.free_forms.bases import Basis, Play, Preisach, Products, Spline
from calibrations.free_forms.poses import side, turning_forces
from calibrations.geometry.orientation import other_in_plane, out_of_plane, reported_force
from calibrations.table import Array, Table

Factor = Literal["", "force", "cross", "out-of-plane", "side", "load", "pressed"]
CROSS = (1, 0, 0)  # of x, y, z: the other axis in the plane
OUT_OF_PLANE = (2, 2, 1)  # the same: the axis out of the plane
ANGLES = ("alpha", "beta")
TILT = "tilt-over-time"  # the place of a base that turns slowly, and of a sensor that turns on its stage
TURNING_AXES = "temperature-axes"  # the place of sensing axes that turn in their case
TURNED = {"about-x": "tilt", "about-y": "alpha", "about-z": "beta"}  # the angle that each of its forms changes
OF_FORCE = ("own", "cross", "out-of-plane", "force", "way")  # drivers of what the sensor makes of the force
MODELLED = ("own", "cross", "out-of-plane", "output")  # drivers that the parameters of a model change


@dataclass(frozen=True)
class Form:
    """One function f of unknown form. `bases` holds one basis an axis, or one for all.

    place       place of the signal chain, such as own-response
    name        the form within the place, such as curve
    sizes       standard deviation of the coefficients, an axis or one for all axes; () before a fit
    kept        number of columns that are used, from the smoothest on
    shared      whether all axes have one function (stage angles, output)
    approach_deg, lead_s  of the factor `side` and of slip elements; of the temperature
    level       whether a logged column drives it without the scatter of its readings
    """

    place: str
    name: str
    driver: str
    bases: tuple[Annotated[Basis, Field(discriminator="kind")], ...]
    factor: Factor = ""
    sizes: tuple[float, ...] = ()
    kept: tuple[int, ...] = ()
    shared: bool = False
    approach_deg: float = 0.0
    lead_s: float = 0.0
    level: bool = False

    def basis(self, k: int) -> Basis:
        """The basis of axis k."""
        return self.bases[k if len(self.bases) > 1 else 0]

    def count(self, k: int) -> int:
        """Number of columns of axis k."""
        return self.kept[k if len(self.kept) > 1 else 0] if self.kept else self.basis(k).count

    def needs(self) -> tuple[str, ...]:
        """Columns without which the form cannot be computed."""
        column = self.driver.removeprefix("column:")
        by_driver = {"temperature": ("temperature_c",), "time": ("t_s",)}
        required = by_driver.get(self.driver, (column,) if column != self.driver else ())
        return (*required, *(("direction",) if self.factor == "side" and self.approach_deg else ()))

    @property
    def angle(self) -> str:
        """The angle that it changes: "alpha", "beta", "tilt" (of the base about its x axis), or "" for none."""
        if self.place == TILT:
            return TURNED[self.name]
        return self.driver if self.place == f"stage-angle-{self.driver}" else ""

    @property
    def of_force(self) -> bool:
        """Whether a drift of the sensitivity multiplies it."""
        return self.driver in OF_FORCE

    @property
    def scales(self) -> bool:
        """Whether it is a change of the sensitivity."""
        return self.factor == "force"

    @property
    def of_table(self) -> bool:
        """Whether the columns follow from the table alone, so that no parameter of a model changes them."""
        return self.driver not in (*MODELLED, "force") and self.factor in ("", "side")

    def columns(self, table: Table, force: Array, response: Array, k: int) -> Array:
        """Columns of axis k, shape (n, count).

        From the force along the sensing axes (n, 3), g, and the output of the axis before the form (n,).
        """
        basis = self.basis(k)
        if isinstance(basis, Products):
            columns = basis(force)
        elif isinstance(basis, Preisach):
            columns = np.asarray(_hysteretic(table, basis, self.approach_deg)[k])
        elif isinstance(basis, Play):
            lagging = _lag_by_play(table, basis, self.lead_s) if self.driver == "temperature" else None
            is_pressed = self.factor == "pressed"
            columns = (
                np.asarray(_slip_forces(table, basis, self.approach_deg, is_pressed)[k]) if lagging is None else lagging
            )
        elif self.driver in MODELLED:
            columns = self.columns_at(self.drive(table, force, response, k), k)
        else:
            columns = _of_table(self, table, k)[:, : self.count(k)]
        multiplied = self.factor not in ("", "pressed")
        return np.asarray(columns * self._factor(table, force, k)[:, None]) if multiplied else columns

    def columns_at(self, x: Array, k: int) -> Array:
        """Columns of axis k at values of the driver (n,), shape (n, count)."""
        basis = self.basis(k)
        assert not isinstance(basis, (Play, Preisach, Products))  # noqa: S101 more than one value drives these
        return np.asarray(basis(x)[:, : self.count(k)])

    def sum_columns(self, table: Table, force: Array, response: Array, k: int, coefficients: Array) -> Array:
        """The sum of the columns of axis k with these coefficients, shape (n,)."""
        basis = self.basis(k)
        if isinstance(basis, Spline) and self.driver in MODELLED:
            total = basis.sum_columns(self.drive(table, force, response, k), coefficients)
            return total * self._factor(table, force, k) if self.factor else total
        return np.asarray(self.columns(table, force, response, k) @ coefficients)

    def drive(self, table: Table, force: Array, response: Array, k: int) -> Array:
        """The driver of the function of axis k, shape (n,)."""
        if self.driver == "own":
            return force[:, k]
        if self.driver == "cross":
            return force[:, CROSS[k]]
        if self.driver == "out-of-plane":
            return out_of_plane(force)[:, k]
        if self.driver in ANGLES:
            return np.radians(table.column(f"{self.driver}_deg"))
        if self.driver == "temperature":
            return leading_temperature(table, self.lead_s)
        if self.driver == "time":
            return table.time_s
        if self.driver == "output":
            return response
        name, power = (table.std_names[k], 2) if self.driver == "variance" else (self.driver.removeprefix("column:"), 1)
        return level(table, name, power) if self.level else table.column(name) ** power

    def _factor(self, table: Table, force: Array, k: int) -> Array:
        if self.factor == "force":
            return force[:, k]
        if self.factor == "cross":
            return force[:, CROSS[k]]
        if self.factor == "out-of-plane":
            return out_of_plane(force)[:, k]
        if self.factor == "load":
            return np.abs(force[:, CROSS[k]])
        return side(table, self.approach_deg)


@lru_cache(maxsize=32)
def _of_table(form: Form, table: Table, k: int) -> Array:
    """Columns of axis k where a column of the table drives them, which no parameter of a model changes."""
    no_force = np.zeros((table.n, 3))
    basis = form.basis(k)
    assert not isinstance(basis, (Play, Preisach, Products))  # noqa: S101 forces drive these
    return basis(form.drive(table, no_force, no_force[:, 0], k))


@lru_cache(maxsize=32)
def _lag_by_play(table: Table, basis: Play, lead_s: float) -> Array:
    """Temperature less its value behind plays of these widths, over the widths, shape (n, widths)."""
    temperature = leading_temperature(table, lead_s)
    return np.column_stack([(temperature - play(temperature, width)) / width for width in basis.widths])


@lru_cache(maxsize=32)
def _hysteretic(table: Table, basis: Preisach, approach_deg: float) -> Array:
    """Columns of a Preisach hysteresis of the force along each axis, shape (3, n, count)."""
    driver = reported_force(table)
    widths = np.array(basis.widths)
    forces = slip_elements(driver, turning_forces(table, approach_deg), np.ones_like(driver), widths, np.zeros(3))
    plays = np.moveaxis(driver[:, None, :] - forces, 2, 0)
    return np.ascontiguousarray([basis.columns_of(followers) for followers in plays])


@lru_cache(maxsize=32)
def _slip_forces(table: Table, basis: Play, approach_deg: float, is_pressed: bool) -> Array:
    """Forces of the slip elements over their widths, and the decay of their first state, shape (3, n, columns)."""
    widths = np.array(basis.widths)
    driver = reported_force(table)
    path, even = turning_forces(table, approach_deg), np.ones_like(driver)
    by_load = even + np.abs(other_in_plane(driver)) if is_pressed else even
    forces = slip_elements(driver, path, by_load, widths, np.zeros(3))
    columns = np.moveaxis(forces, 2, 0) / widths
    if basis.memory:
        first = np.moveaxis(slip_elements(driver, path, by_load, widths, np.ones(3)), 2, 0) / widths
        columns = np.concatenate([columns, first - columns], axis=2)
    return np.ascontiguousarray(columns)
