"""The columns that all methods choose from: every effect of the catalogue, linearised about the fitted base model.

Nonlinear effects are there at a few fixed shapes. Whitened by the white noise that the table states, which is all that
is known before anything is searched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.fitting.problem_kinds import make_problem
from calibrations.model.file import read_model
from calibrations.table import Array, Table

SMALLEST = 1e-3  # of a column's length: less beside the base model is not there


@dataclass(frozen=True)
class Library:
    """`y` (rows,) and the candidates' columns (rows, k), white and freed of the base model, `base` (rows, p).

    Rows are those of x, then those of y, in order of time; `floor` (rows,) is the noise by which they were divided.
    """

    y: Array
    base: Array
    groups: dict[str, list[Array]]
    floor: Array

    def freed(self, columns: Array) -> Array:
        """White columns without what the base model explains."""
        return np.asarray(columns - self.base @ (self.base.T @ columns))


def library(table: Table) -> Library:
    """The candidates that this table can excite."""
    before = fit(read_model("linear"), table)
    floor = before.problem.white if before.problem.white is not None else np.ones_like(before.residual)
    white = floor.ravel()
    base = np.linalg.qr(before.jacobian.reshape(len(white), -1) / white[:, None])[0]
    made = Library(before.residual.ravel() / white, base, {}, white)
    made = Library(made.freed(made.y), base, {}, white)
    for name, effect in catalogue().items():
        if (
            before.model.holds(name)
            or effect.excluded(table) is not None
            or not set(effect.after) <= {"bias", "scale-factor"}
        ):
            continue
        problem = make_problem(before.model.with_effect(effect), table)
        mine = problem.layout.of_effect(name)
        groups = []
        for theta in problem.layout.starts():
            columns = problem.jacobian(theta, mine).reshape(len(white), -1)
            change = (problem.residual(theta) - before.residual).reshape(-1, 1)
            groups.append(_kept(made, np.hstack([change, columns]) / white[:, None]))
        groups = [group for group in groups if group.shape[1]]
        if groups:
            made.groups[name] = groups
    return made


def _kept(made: Library, columns: Array) -> Array:
    """Orthonormal columns of what the base model leaves."""
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0] / size[size > 0]
    free = made.freed(columns)
    free = free[:, np.linalg.norm(free, axis=0) > SMALLEST]
    if not free.size:
        return free
    U, s, _ = np.linalg.svd(free / np.linalg.norm(free, axis=0), full_matrices=False)
    return np.asarray(U[:, s > 1e-3 * s[0]])
