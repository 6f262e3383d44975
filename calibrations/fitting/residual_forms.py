"""Free forms of rows that need no stage angles: positions and motion.

The residual shows a form through the chain of the fitted model: of positions what it makes of the magnitude, of motion
what each stretch holds of it. All parameters of the model are the base of the likelihood, as far as the rows determine
them, and the sizes follow as those of poses do.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.effects import Effect
from calibrations.fitting.solution import Solution
from calibrations.free_forms.bases import Clips, Products, Settling, StraightLine, spline
from calibrations.free_forms.components import GENERAL, PRODUCT, Component
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.form import CROSS, Factor, Form
from calibrations.free_forms.places import DEGREE, THRESHOLDS_G
from calibrations.free_forms.places_in_time import AGES
from calibrations.free_forms.reml import Gram, Sizes, eliminate_base, estimate, gains, scale_components
from calibrations.free_forms.selection import ENTER, pools_of, select
from calibrations.free_forms.structure import with_size
from calibrations.geometry.orientation import out_of_plane
from calibrations.table import Array, Table

INTERVALS = {"own": 14, "cross": 10, "out-of-plane": 10, "temperature": 10, "time": 12, "output": 14}  # of a spline
COLUMN_INTERVALS = 8
OF_FORCE: Mapping[str, tuple[str, Factor]] = {
    "own-response": ("own", ""),
    "cross-response": ("cross", ""),
    "z-response": ("out-of-plane", ""),
    "scale-over-cross": ("cross", "force"),
    "scale-over-z": ("out-of-plane", "force"),
}
OF_TABLE: Mapping[str, tuple[str, Factor]] = {
    "temperature-bias": ("temperature", ""),
    "temperature-scale": ("temperature", "force"),
    "time-bias": ("time", ""),
    "time-scale": ("time", "force"),
}
LEADS_S = {"ahead": 15.0, "behind": -15.0}  # of the sensor, of its thermometer; together they are a lag of any length
SMALLEST = 1e-3  # noise floors: what a form adds that the data do not show


@dataclass(frozen=True, eq=False)
class ResidualForms:
    """The forms that a residual can show: products of their columns with the model's own (`gram`), and the inputs.

    columns        whitened [base, forms, residual], (rows, base + forms + 1)
    tested_effect  an effect of the model whose parameters are no part of the base
    scatter        standard deviation of the rows without forms, in that of the fit's noise
    """

    fit: Solution
    forms: Mapping[str, Form]
    gram: Gram
    columns: Array
    tested_effect: str = ""
    scatter: float = 1.0

    @staticmethod
    def of(fit: Solution, forms: Mapping[str, Form], tested_effect: str = "", scatter: float = 1.0) -> ResidualForms:
        """The forms by name and one effect (`tested_effect`), tested together with the other parameters of a fit."""
        J, own = fit.whitened[:, 1:], fit.problem.layout.of_effect(tested_effect)
        parts = {name: fit.noise.whiten(form_columns(fit, form)) for name, form in forms.items()}
        parts |= {tested_effect: J[:, own]} if tested_effect else {}
        ends = np.cumsum([0, *(part.shape[1] for part in parts.values())])
        blocks = {name: slice(int(a), int(b)) for name, a, b in zip(parts, ends[:-1], ends[1:], strict=True)}
        left = fit.whitened[:, 0] - J[:, own] @ fit.theta[own]
        X = np.hstack([J[:, ~own], *parts.values(), left[:, None]]) / scatter
        X, g = scale_components(X, _gram(fit, X, ~own, blocks))
        return ResidualForms(fit, forms, g, X, tested_effect, scatter)

    @cached_property
    def components(self) -> Mapping[str, Component]:
        """The forms as components of a search, by name."""
        return {name: _component(name, form) for name, form in self.forms.items()}

    @cached_property
    def selected(self) -> Sizes:
        """The forms that act, and their sizes."""
        components = list(self.components.values())
        return select(self.gram, self.without_forms, components, pools_of(components, False), {}, ENTER, True)

    def add(self, names: Iterable[str], sizes: Sizes) -> Sizes:
        """The sizes with those of the forms `names` that act as well."""
        pool = {name: self.components[name] for name in names}
        return select(self.gram, sizes, list(self.components.values()), [pool], {}, ENTER, False)

    @property
    def without_forms(self) -> Sizes:
        """The sizes of all forms set to zero."""
        return estimate(self.gram, {}, {})

    def excess(self, sizes: Sizes) -> float:
        """The rms of what forms of these sizes leave of the residual, over the noise of `scatter`."""
        g, u, rows = self.gram, sizes.coefficients, self.gram.indices(sizes.variances)
        squares = g.squares - 2 * float(u @ g.with_data[rows]) + float(u @ g.products[np.ix_(rows, rows)] @ u)
        used = g.base_rank + len(u) - sum(sizes.shrinkage(g, name) for name in sizes.variances)
        return float(np.sqrt(max(squares, 0.0) / max(g.rows - used, 1.0)))

    def deviance(self, sizes: Sizes) -> float:
        """-2 log restricted likelihood with forms of these sizes, in the likeliest scatter of the rows.

        The scatter is no smaller than the noise of the rows, where that is known. Few rows leave the scatter uncertain,
        and a form with many coefficients then gains less.
        """
        g = self.gram
        quadratic = g.squares - float(g.with_data[g.indices(sizes.variances)] @ sizes.coefficients)
        free_rows = g.rows - g.base_rank
        least = self.scatter**-2 if self.fit.problem.white is not None else 0.0
        variance = max(quadratic / free_rows, least)
        return quadratic / variance + free_rows * float(np.log(variance)) + sizes.deviance - quadratic

    def gain_of_tested_effect(self, sizes: Sizes) -> float:
        """Twice the gain in log-likelihood by the effect, with forms of these sizes in the model."""
        return gains(self.gram, sizes, [self.tested_effect])[self.tested_effect][0]

    def sized(self, name: str, sizes: Sizes) -> Form:
        """A form with its fitted size, and without the columns that contribute nothing."""
        form, g = self.forms[name], self.gram
        block, base = g.blocks[name], len(g.base_with_data)
        columns = self.columns[:, base + block.start : base + block.stop]
        added = sizes.of(g, name) ** 2 * np.sum(columns**2, axis=0) / self.fit.table.n
        size = float(np.sqrt(sizes.variances[name]) / g.scales[name])
        channels = 1 if form.shared else len(self.fit.table.axes)
        return with_size(form, size, added, channels)


def form_columns(fit: Solution, form: Form) -> Array:
    """d residual / d the coefficients of a form, of every axis in turn or shared by all, (channels, rows, m)."""
    problem = fit.problem
    samples, force = problem.samples, problem.sensed(fit.theta)
    axes = len(samples.axes)
    own = [form.columns(samples, force, samples.outputs[:, k], k) for k in range(axes)]
    if form.shared:
        return problem.of_output(fit.theta, np.stack(own, axis=1))
    changes = np.zeros((samples.n, axes, sum(columns.shape[1] for columns in own)))
    at = 0
    for k, columns in enumerate(own):
        changes[:, k, at : at + columns.shape[1]] = columns
        at += columns.shape[1]
    return problem.of_output(fit.theta, changes)


def forms_at(place: str, fit: Solution) -> dict[str, Form]:
    """The free forms of a place over the range of the fit's samples, by the names that they have in a search."""
    table, force = fit.problem.samples, fit.problem.sensed(fit.theta)
    return {f"{place}/{form.name}": form for form in _forms(place, table, force)}


def estimate_by_residual(before: Solution, place: str) -> Effect:
    """The free form of a place with the sizes that the residual of `before` shows.

    One form is always kept, however small: a person asked for it, and at a size near zero it changes nothing.
    """
    residual_forms = ResidualForms.of(before.in_white_noise(), forms_at(place, before))
    sizes = residual_forms.selected
    if not sizes.variances:
        gained = gains(residual_forms.gram, sizes, list(residual_forms.forms))
        best = max(gained, key=lambda name: gained[name][0])
        sizes = estimate(residual_forms.gram, {best: max(gained[best][1], SMALLEST**2)}, {best: SMALLEST**2})
    return free_form(tuple(residual_forms.sized(name, sizes) for name in sizes.variances))


def _component(name: str, form: Form) -> Component:
    price = GENERAL if form.driver == "force" else PRODUCT if form.factor else 0.0
    return Component(name, form.place, "response", price=price, form=form)


def _gram(fit: Solution, X: Array, base: NDArray[np.bool_], blocks: Mapping[str, slice]) -> Gram:
    """Products of the columns, with the priors of the model's own free forms; `base`: those of the first columns."""
    b, rows = int(base.sum()), fit.problem.layout.prior_rows[:, base]
    products = X.T @ X
    products[:b, :b] += rows.T @ rows
    products[:b, -1] += rows.T @ (rows @ fit.theta[base])
    products[-1, :b] = products[:b, -1]
    return eliminate_base(products, blocks, dict.fromkeys(blocks, 1.0), b, len(X))


def _forms(place: str, table: Table, force: Array) -> Sequence[Form]:
    if place in OF_FORCE:
        return _forms_of_force(place, force, len(table.axes))
    if place in OF_TABLE:
        return _forms_of_temperature_or_time(place, table)
    if place == "output":
        return [Form(place, "curve", "output", (spline(table.outputs.ravel(), INTERVALS[place]),), shared=True)]
    if place == "force":
        return [Form(place, "curve", "force", (Products(DEGREE),))]
    if place == "column:std":
        squares = [table.column(name) ** 2 for name in table.std_names]
        lines = tuple(StraightLine(float(q.min()), float(q.max())) for q in squares)
        return [Form(place, "line", "variance", lines)]
    return _forms_of_column(place, table.column(place.removeprefix("column:")))


def _forms_of_force(place: str, force: Array, count: int) -> list[Form]:
    """Forms over a component of the forces (n, 3), for `count` axes."""
    driver, factor = OF_FORCE[place]
    over = {"own": force, "cross": force[:, list(CROSS)], "out-of-plane": out_of_plane(force)}[driver]
    forms = [Form(place, "curve", driver, tuple(spline(over[:, k], INTERVALS[driver]) for k in range(count)), factor)]
    if place == "own-response":
        forms.append(Form(place, "thresholds", "own", (Clips(THRESHOLDS_G),)))
    return forms


def _forms_of_temperature_or_time(place: str, table: Table) -> list[Form]:
    """A line and a curve; with times also a lag of the temperature; over time also a settling."""
    driver, factor = OF_TABLE[place]
    x = table.column("temperature_c") if driver == "temperature" else table.time_s
    start, end = float(x.min()), float(x.max())
    line = (StraightLine(start, end),)
    forms = [
        Form(place, "line", driver, line, factor),
        Form(place, "curve", driver, (spline(x, INTERVALS[driver]),), factor),
    ]
    if driver == "temperature" and "t_s" in table:
        forms += [Form(place, name, driver, line, factor, lead_s=lead) for name, lead in LEADS_S.items()]
    if driver == "time":
        span = end - start or 1.0
        forms.append(Form(place, "settling", driver, (Settling(start, span, span / len(x), AGES),), factor))
    return forms


def _forms_of_column(place: str, x: Array) -> list[Form]:
    """A line and a curve over a logged column (n,), each of the bias and of the scale factor."""
    line, curve = (StraightLine(float(x.min()), float(x.max())),), (spline(x, COLUMN_INTERVALS),)
    return [
        Form(place, "line", place, line),
        Form(place, "curve", place, curve),
        Form(place, "scale-line", place, line, "force"),
        Form(place, "scale-curve", place, curve, "force"),
    ]
