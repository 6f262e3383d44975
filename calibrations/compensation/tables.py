"""Curves of unknown form in a compensation: a piecewise cubic table of each, and the graph of a free form with it.

A table is the curve itself, not an approximation: a spline is a cubic between its knots. Its bounds over an interval
are those of Bernstein coefficients, so that the proof of the inverse holds with it.

Source  Farouki, The Bernstein polynomial basis: a centennial retrospective, CAGD 29 (2012) 379.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from calibrations.compensation.graph import ONE, ZERO, Node, look_up, number, power
from calibrations.compensation.trace import NodeArray, NotTraced, RunTime, as_nodes, as_traced
from calibrations.effects import Values
from calibrations.effects.logged import sensor_temperature_c
from calibrations.free_forms.bases import Clips, Products, Ramp, Spline, StraightLine
from calibrations.free_forms.effect import FreeForm, coefficients_of
from calibrations.free_forms.form import CROSS, OUT_OF_PLANE, Form
from calibrations.table import Array

PARTS = 8  # of a piece, whose bounds are taken together
ROUNDING = 64 * np.finfo(float).eps  # of the largest coefficient, for the arithmetic of a piece


@dataclass(frozen=True)
class CubicTable:
    """A function that is a cubic in u = 0..1 on each piece of width `step` from `low` on, and constant beyond.

    `pieces` holds c0, c1, c2, c3 of c0 + c1 u + c2 u^2 + c3 u^3.
    """

    low: float
    step: float
    pieces: tuple[tuple[float, float, float, float], ...]

    def __call__(self, x: Any) -> Array:
        """The function at x, any shape."""
        n = len(self.pieces)
        s = np.clip((np.asarray(x, float) - self.low) / self.step, 0.0, float(n))
        i = np.minimum(np.nan_to_num(s).astype(int), n - 1)
        c0, c1, c2, c3 = np.moveaxis(self._array[i], -1, 0)
        u = s - i
        return np.asarray(((c3 * u + c2) * u + c1) * u + c0)

    @cached_property
    def _array(self) -> Array:
        return np.array(self.pieces)

    def bounds(self, low: Array, high: Array) -> tuple[Array, Array, Array, Array]:
        """Least and greatest value, and least and greatest slope, of the function for x from `low` to `high`."""
        edges, values, slopes = self._parts
        ends = self(low), self(high)
        value = [np.minimum(*ends), np.maximum(*ends)]
        slope = [np.full(np.shape(low), np.inf), np.full(np.shape(low), -np.inf)]
        outside = (low <= edges[0]) | (high >= edges[-1])  # constant there
        slope = [np.where(outside, 0.0, end) for end in slope]
        reach = self.step * 1e-9  # a knot belongs to both pieces
        for k in range(len(values)):
            overlaps = (low <= edges[k + 1] + reach) & (high >= edges[k] - reach)
            value[0] = np.where(overlaps, np.minimum(value[0], values[k].min()), value[0])
            value[1] = np.where(overlaps, np.maximum(value[1], values[k].max()), value[1])
            slope[0] = np.where(overlaps, np.minimum(slope[0], slopes[k].min()), slope[0])
            slope[1] = np.where(overlaps, np.maximum(slope[1], slopes[k].max()), slope[1])
        margin = ROUNDING * float(np.abs(self._array).max())
        return value[0] - margin, value[1] + margin, slope[0] - margin / self.step, slope[1] + margin / self.step

    @cached_property
    def _parts(self) -> tuple[Array, Array, Array]:
        """Edges of all parts, and the Bernstein coefficients of value and slope in each: their hull holds both."""
        h = 1 / PARTS
        edges, values, slopes = [self.low], [], []
        for i, (c0, c1, c2, c3) in enumerate(self.pieces):
            for j in range(PARTS):
                u = j * h
                d0 = c0 + u * (c1 + u * (c2 + u * c3))
                d1, d2, d3 = h * (c1 + u * (2 * c2 + 3 * u * c3)), h**2 * (c2 + 3 * u * c3), h**3 * c3
                b = np.array([d0, d0 + d1 / 3, d0 + 2 * d1 / 3 + d2 / 3, d0 + d1 + d2 + d3])
                values.append(b)
                slopes.append(3 * np.diff(b) / (h * self.step))
                edges.append(self.low + self.step * (i + (j + 1) * h))
        return np.array(edges), np.array(values), np.array(slopes)


def spline_table(basis: Spline, coefficients: Array) -> CubicTable:
    """The function of a spline basis with these coefficients of its first columns."""
    b = basis.on_splines[:, : len(coefficients)] @ coefficients
    b0, b1, b2, b3 = b[:-3], b[1:-2], b[2:-1], b[3:]
    c = np.column_stack([b0 + 4 * b1 + b2, 3 * (b2 - b0), 3 * (b0 - 2 * b1 + b2), b3 - b0 + 3 * (b1 - b2)]) / 6
    step = (basis.high - basis.low) / basis.intervals
    return CubicTable(basis.low, step, tuple((float(p), float(q), float(r), float(s)) for p, q, r, s in c))


def trace_free_form(effect: FreeForm, a: NodeArray, v: NodeArray, table: RunTime, p: Values) -> NodeArray:
    """Contribution of the free form to the outputs, (1, 3), for forces a and outputs v before it, (1, 3) each.

    Raises NotTraced for a form that no product can follow.
    """
    contribution = as_nodes(np.zeros((1, 3)))
    for k in range(len(table.axes)):
        for form in effect.forms:
            contribution[0, k] += _part(form, coefficients_of(form, p, k), a.nodes[0], v.nodes[0, k], table, k)
    return as_traced(NodeArray(contribution))


def _part(form: Form, u: Array, a: Sequence[Node], v: Node, table: RunTime, k: int) -> Node:
    """The value of one form at axis k, with its coefficients u: its function, times its factor."""
    f = _function(form, u, a, v, table, k)
    if form.factor == "force":
        return a[k] * f
    if form.factor == "cross":
        return a[CROSS[k]] * f
    if form.factor == "out-of-plane":
        return a[OUT_OF_PLANE[k]] * f
    if form.factor == "load":
        return abs(a[CROSS[k]]) * f
    if form.factor:
        raise NotTraced(f"the {form.factor} is not known at run time")
    return f


def _function(form: Form, u: Array, a: Sequence[Node], v: Node, table: RunTime, k: int) -> Node:
    """The sum of the basis functions of axis k, times their coefficients u."""
    basis = form.basis(k)
    if isinstance(basis, Products):
        return _weighted_sum(u, [prod(map(power, a, powers), start=ONE) for powers in basis.powers])
    x = _driver(form, a, v, table, k)
    if isinstance(basis, Spline):
        return look_up(spline_table(basis, u), x) if len(u) else number(0.0)
    if isinstance(basis, StraightLine):
        slope = float(np.sum(u)) / basis.half_width
        return number(slope) * x + number(-slope * (basis.low + basis.high) / 2)
    if isinstance(basis, Ramp):
        return _weighted_sum(u, [ONE, abs(x), x])
    if isinstance(basis, Clips):
        clips = [x.clipped(number(-width), number(width)) for width in basis.widths]
        return _weighted_sum([c / width for c, width in zip(u, basis.widths, strict=False)], clips)
    raise NotTraced(f"its basis {basis.kind} cannot be written as code")


def _driver(form: Form, a: Sequence[Node], v: Node, table: RunTime, k: int) -> Node:
    """The driver of a function of axis k."""
    if form.driver in ("own", "cross", "out-of-plane"):
        return a[{"own": k, "cross": CROSS[k], "out-of-plane": OUT_OF_PLANE[k]}[form.driver]]
    if form.driver == "output":
        return v
    if form.driver == "temperature":
        column: Any = sensor_temperature_c(table, form.lead_s)  # type: ignore[arg-type]
        return as_traced(column).nodes[0]  # type: ignore[no-any-return]
    if form.driver.startswith("column:"):
        return table.column(form.driver.removeprefix("column:")).nodes[0]  # type: ignore[no-any-return]
    raise NotTraced(f"the {form.driver} is not known at run time")


def _weighted_sum(weights: Iterable[float], nodes: Sequence[Node]) -> Node:
    """The sum of the nodes times their weights; nodes without a weight stay out."""
    return sum((number(float(weight)) * node for weight, node in zip(weights, nodes, strict=False)), start=ZERO)
