"""The noise of magnetometers and gyroscopes whose samples' scatter is not in the table: what the widest form leaves.

Without it a model's own residual would be its noise, and nothing could be missing. For fields the form is an ellipsoid,
for rates every output as a linear function of the rates and, where they were measured, of the specific forces. What
lies beyond these forms counts as noise, so that it is rather taken as too large.

Source  Draper and Smith, Applied Regression Analysis, on lack of fit: pure error by the widest model.
"""

from __future__ import annotations

import numpy as np

from calibrations.coverage import SOFT_IRON, too_small
from calibrations.noise_estimation.mean_noise import white_std
from calibrations.table import AXES, Array, Table
from calibrations.turning import rate_deg_s, specific_force_g

FORMS = {"fields": "an ellipsoid", "rates": "outputs linear in rates and specific forces"}
FEWEST = 2  # rows more than the form has parameters


def scatter(table: Table) -> Array | None:
    """Standard deviation of each row in the residual's unit, shape (channels, n); None where rows are too few."""
    found = _of_field(table) if table.content == "fields" else _of_rates(table)
    return None if found is None or not np.all(found > 0) else np.tile(found[:, None], (1, table.n))


def told(table: Table) -> str | None:
    """What is taken for the noise of a table that does not say it, in words; None where it does, or is not asked."""
    if table.content not in FORMS or white_std(table) is not None:
        return None
    if scatter(table) is None:
        return "the noise of its means is not known, and its rows do not show it: what a model leaves is its noise"
    return (
        f"the noise of its means is not known: what {FORMS[table.content]} leaves is taken for it, and nothing beyond "
        f"is looked for; give {table.output_names[0]}_std, and so on, and n"
    )


def _of_field(table: Table) -> Array | None:
    """Of the magnitude, as a share of the field, shape (1,)."""
    if table.n < 9 + FEWEST or too_small(table, SOFT_IRON) is not None:
        return None
    m = table.outputs - table.outputs.mean(axis=0)
    m = m / np.abs(m).max()
    x, y, z = m.T
    columns = np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, x, y, z])
    xx, yy, zz, xy, xz, yz, *linear = np.linalg.lstsq(columns, np.ones(table.n), rcond=None)[0]
    A = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    away = m + np.linalg.solve(A, linear) / 2
    size = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", away, A, away), 0.0))
    left = size / size.mean() - 1
    return np.sqrt([left @ left / (table.n - 9)])


def _of_rates(table: Table) -> Array | None:
    """Of each output, in its unit, shape (3,)."""
    columns = np.column_stack([np.ones(table.n), rate_deg_s(table)])
    if all(f"a{axis}" in table for axis in AXES):
        columns = np.column_stack([columns, specific_force_g(table)])
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    answer, _, rank, _ = np.linalg.lstsq(columns, table.outputs, rcond=1e-9)
    free = table.n - int(rank)
    if free < FEWEST:
        return None
    return np.asarray(np.sqrt(np.sum((table.outputs - columns @ answer) ** 2, axis=0) / free))
