"""The white noise of a mean of correlated samples.

Samples behind a first-order low-pass are correlated from one to the next by rho = exp(-2 pi f_corner / f_sample), so
that the variance of a mean of n is std^2 / n (1 + rho) / (1 - rho).
"""

from __future__ import annotations

import numpy as np

from calibrations.table import OUTPUTS, Array, Table


def white_std(table: Table) -> Array | None:
    """Standard deviation of each mean, in the output's unit, shape (n, axes); None where it is not known."""
    names = [_std_name(name) for name in OUTPUTS[table.kind] if name in table]
    if "n" not in table or not all(name in table for name in names):
        return None
    std = np.column_stack([table.column(name) for name in names])
    if not np.all(std > 0):
        return None
    mean: Array = std * np.sqrt(inflation(table) / table.column("n"))[:, None]
    return mean


def norm_std(table: Table, std: Array) -> Array:
    """Standard deviation of each mean's magnitude, in the output's unit, shape (n, 1); `std` is that of the axes."""
    if "norm_std" in table:
        return (table.column("norm_std") * np.sqrt(inflation(table) / table.column("n")))[:, None]
    centre = (table.outputs.max(axis=0) + table.outputs.min(axis=0)) / 2
    along = table.outputs - centre
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.sum((along * std) ** 2, axis=1, keepdims=True)))


def inflation(table: Table) -> float:
    """(1 + rho) / (1 - rho) of the table's filter; 1 where corner or rate is not given."""
    if "filter_corner_hz" not in table.constants or "sample_rate_hz" not in table.constants:
        return 1.0
    rho = np.exp(-2 * np.pi * table.number("filter_corner_hz", 0.0) / table.number("sample_rate_hz", 1.0))
    return float((1 + rho) / (1 - rho))


def _std_name(output: str) -> str:
    """`vx_v` -> `vx_std_v`, `ax` -> `ax_std`."""
    return output.replace("_v", "_std_v") if output.endswith("_v") else f"{output}_std"
