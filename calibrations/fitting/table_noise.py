"""Noise of a table that its own samples do not give: slow noise by a noise model, scatter by the widest form.

Slow noise    A noise model, fitted to a still record of the same sensor, gives Gauss-Markov processes: several per
              decade of time constants for flicker noise, one much slower than the record for a random walk. White
              noise, quantisation noise and what is faster than a row are in the scatter of the samples; a sinusoid
              averages out in a dwell.
Scatter       The rows of a magnetometer or gyroscope may come without the scatter of their samples. Then the residual
              of the widest form is their noise: an ellipsoid for fields; for rates, outputs linear in the rates and, if
              measured, in the specific forces. Otherwise a model's own residual would be its noise, and no effect could
              be missing. Errors beyond the widest form count as noise, so that the noise is rather overestimated.

Source  Machlup, J. Appl. Phys. 25 (1954); McWhorter: 1/f noise as a sum of relaxations evenly spaced in log time;
        Draper and Smith, Applied Regression Analysis, on lack of fit: pure error by the widest model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.criteria import FEWEST_FREE_ROWS
from calibrations.errors import DataError, ModelError
from calibrations.geometry.rate_table import rate_deg_s, specific_force_g
from calibrations.geometry.sphere import SOFT_IRON, coverage_fault
from calibrations.means.noise import BEYOND, Processes, white_std
from calibrations.model import Model
from calibrations.table import AXES, Array, Table
from calibrations.tables import KINDS

PER_DECADE = 2.0  # processes of flicker


def with_noise(table: Table, model: Model) -> Table:
    """The table, its slow noise known. Raises DataError, ModelError where the model does not know its channels.

    The noise of its outputs is then no longer estimated from the residual of a model.
    """
    if not table.type.known_input:
        kinds = " and ".join(name for name, kind in KINDS.items() if kind.known_input)
        raise DataError(f"{table.source}: a noise model is for {kinds}, but this table is of {table.content}")
    if "t_s" not in table:
        raise DataError(f"{table.source}: slow noise needs the column t_s: when each row was measured")
    if model.unit != table.unit:
        raise ModelError(
            f"{model.name}: its values are {f'in {model.unit}' if model.unit else 'not fitted'}, and {table.source} is "
            f"in {table.unit}; fit it to a still record of the same output: rig fit RUN --model still --out FILE"
        )
    return replace(table, noise={axis: slow_processes(model, axis, table) for axis in table.axes})


def slow_processes(model: Model, axis: str, table: Table) -> Processes:
    """The processes of one axis at the times of a table."""
    if not any(e.axis == axis for e in model.params.values()):
        raise ModelError(f"{model.name}: the noise model has no values for the axis {axis}, which {table.source} has")
    gap_s, span_s = _typical_gap_s(table), float(np.ptp(table.time_s))
    walk = model.value(f"rate-random-walk.coefficient.{axis}")
    slowest_s = BEYOND * span_s
    processes = [*_flicker(model.value(f"flicker-noise.coefficient.{axis}"), gap_s / 2, slowest_s)]
    processes += [(walk * np.sqrt(slowest_s / 2), slowest_s)]
    sigma, time_s = (model.value(f"gauss-markov-noise.{name}.{axis}") for name in ("sigma", "time_constant"))
    processes += [(sigma, time_s)]
    return tuple((float(std), float(tau_s)) for std, tau_s in processes if std > 0)


def _typical_gap_s(table: Table) -> float:
    """The median time from one row to the next, s. Raises DataError if it is 0, and for a single row."""
    if table.n < 2:
        raise DataError(f"{table.source}: slow noise needs two rows or more, and this table has one; measure more rows")
    if not (gap_s := float(np.median(np.diff(np.sort(table.time_s))))) > 0:
        raise DataError(
            f"{table.source}: column t_s: more than half of the rows have the same time as another row, so that slow "
            "noise cannot be separated from the scatter of the rows; give each row its own time, in s, with enough "
            "decimals"
        )
    return gap_s


def _flicker(coefficient: float, fastest_s: float, slowest_s: float) -> Processes:
    """B^2 / (2 pi f) as relaxations of equal variance B^2 D / pi, D the logarithmic step of their time constants."""
    count = int(PER_DECADE * np.log10(slowest_s / fastest_s)) + 1
    taus_s = np.geomspace(fastest_s, slowest_s, count)
    std = coefficient * np.sqrt(np.log(taus_s[1] / taus_s[0]) / np.pi)
    return tuple((std, tau_s) for tau_s in taus_s.tolist())


def scatter(table: Table) -> Array | None:
    """Standard deviation of each row in the residual's unit, shape (channels, n).

    None where rows are too few, and for a kind that has no widest form.
    """
    std = WIDEST[table.content](table) if table.content in WIDEST else None
    return None if std is None or not np.all(std > 0) else np.tile(std[:, None], (1, table.n))


def scatter_remark(table: Table) -> str | None:
    """The assumption on the noise of a table that does not state it, in words; None where it does, or needs none."""
    form = table.type.widest_form
    if not form or white_std(table) is not None:
        return None
    if scatter(table) is None:
        return (
            "the noise of the means is not known, and the rows do not show it: the residual of a model counts as noise"
        )
    return (
        f"the noise of the means is not known: the residual of {form} counts as noise, and no effect is searched for "
        f"in it; give {table.output_names[0]}_std, and so on, and n"
    )


def _of_field(table: Table) -> Array | None:
    """White noise of the magnitude, as a share of the field, shape (1,)."""
    if table.n < 9 + FEWEST_FREE_ROWS or coverage_fault(table, SOFT_IRON) is not None:
        return None
    return excess_over_ellipsoid(table)


def excess_over_ellipsoid(table: Table) -> Array:
    """Standard deviation of the magnitude about the ellipsoid nearest to the outputs, as a share of it, shape (1,)."""
    m = table.outputs - table.outputs.mean(axis=0)
    m = m / np.abs(m).max()
    x, y, z = m.T
    columns = np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, x, y, z])
    xx, yy, zz, xy, xz, yz, *linear = np.linalg.lstsq(columns, np.ones(table.n), rcond=None)[0]
    A = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    centred = m + np.linalg.solve(A, linear) / 2
    size = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", centred, A, centred), 0.0))
    departure = size / size.mean() - 1
    return np.sqrt([departure @ departure / (table.n - 9)])


def _of_rates(table: Table) -> Array | None:
    """White noise of each output, in its unit, shape (3,)."""
    columns = np.column_stack([np.ones(table.n), rate_deg_s(table)])
    if all(f"a{axis}" in table for axis in AXES):
        columns = np.column_stack([columns, specific_force_g(table)])
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    answer, _, rank, _ = np.linalg.lstsq(columns, table.outputs, rcond=1e-9)
    free = table.n - int(rank)
    if free < FEWEST_FREE_ROWS:
        return None
    return np.asarray(np.sqrt(np.sum((table.outputs - columns @ answer) ** 2, axis=0) / free))


WIDEST = {"fields": _of_field, "rates": _of_rates}
