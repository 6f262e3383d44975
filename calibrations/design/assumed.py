"""A model taken to be true before any data: what a plan is made for.

Values are the model's own; where it has none, those that a sensor typically has. The noise is white, that of Ang's
sensor. For effects that only add their share to the output neither changes which poses are best; for others (a dead
zone, hysteresis) the best poses are those for these values (local optimality: Chernoff, 1953).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calibrations.chain import nominal_pose, specific_force
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.noise import white_only
from calibrations.parameters import Layout
from calibrations.problem import Problem
from calibrations.table import AXES, Array, Constant, Table

SAMPLE_STD_V = 3.1e-3 / 4  # Ang V: peak to peak is four times rms
CALM = {"reference_c": ("temperature_c", 25.0), "reference_v": ("supply_v", 5.0)}  # constants of effects; held there


def assumed(
    model: Model, columns: Mapping[str, Array], constants: Mapping[str, Constant], axes: Sequence[str] = AXES[:2]
) -> Fit:
    """`model` on the poses of `columns` (alpha_deg, beta_deg, ..., each of shape (n,)), as if it had been fitted there.

    Its residual is 0. Temperature and supply do not change. Raises ModelError and TooFewRows as a fit does.
    """
    table = _sensed(model, columns, constants, axes)
    problem = Problem.of(model, table)
    theta = _values(problem.layout)
    noise = white_only(problem.white, problem.gap_s, len(problem.channels))
    nothing = np.zeros((len(problem.channels), table.n))
    return Fit(problem.layout.model, problem, theta, noise, nothing, problem.jacobian(theta))


def _sensed(
    model: Model, columns: Mapping[str, Array], constants: Mapping[str, Constant], axes: Sequence[str]
) -> Table:
    """A table of the poses, with outputs of 1 V/g."""
    n = len(columns["alpha_deg"])
    known = {name: value for term in model.terms for name, value in term.constants.items()}
    calm = {column: np.full(n, known.get(name, usual)) for name, (column, usual) in CALM.items()}
    noise = {f"v{axis}_std_v": np.full(n, SAMPLE_STD_V) for axis in axes}
    flat = {f"v{axis}_v": np.zeros(n) for axis in axes}
    table = Table.from_columns("poses", {"n": np.ones(n)} | calm | dict(columns) | noise | flat, constants, "a plan")
    a = specific_force(nominal_pose(table))
    outputs = {f"v{axis}_v": a[:, AXES.index(axis)] for axis in axes}
    return Table.from_columns("poses", {**table.columns, **outputs}, constants, "a plan")


def _values(layout: Layout) -> Array:
    """The model's own values; of a parameter without one what it starts from, and its typical size where that is 0."""
    start = layout.starts()[0]
    free = layout.known() is None
    unset = [free and (s.term, s.parameter.name, s.axis) not in layout.from_data for s in layout.slots]
    return np.where((start == 0) & unset, layout.typical, start)
