"""Still intervals of a raw log: a table of positions from samples of a sensor that was put down again and again.

A window is still when its standard deviation, the three axes together, is near that of the quietest windows. An
interval of still windows is trimmed at both ends, where the hand is still near.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.table import Array, Constant, Table

WINDOW_S = 0.5
SHORTEST_S = 1.0
TRIM_S = 0.2
QUIET_QUANTILE = 0.05  # of the windows, taken as certainly still
MOVING = 3.0  # times the quiet standard deviation
TURNED = 3.0  # times the noise of a sample, at least, in what gravity on many sides scatters: it is hundreds
SHAKEN = 10.0  # the same, reached when it is turned by hand; never reached in a log that never rests or only rests


def positions(log: Table, rate_hz: float) -> Table:
    """The mean of each still interval of `log` (columns ax, ay, az or mx, my, mz, others averaged too).

    `norm_std` is the noise of the magnitude alone: a hand that sways turns the sensor but leaves |a| as it is.

    Raises DataError if fewer than two are found.
    """
    samples = log.outputs
    bounds = still_intervals(samples, rate_hz)
    if len(bounds) < 2:
        found = "one still interval" if bounds else "no still intervals"
        needed = (
            "a log of positions has many of 1 s or more, and the sensor is turned between them; "
            "one that only rests is for `rig noise`"
        )
        raise DataError(f"{log.source}: found {found}; {needed}")
    if _is_alike(samples, bounds):
        raise DataError(
            f"{log.source}: {', '.join(log.output_names)} are the same in all {len(bounds)} still intervals, to the "
            "noise of a sample; an accelerometer that is turned between them shows gravity on another side in each"
        )
    names = [name for name in log.columns if not name.endswith("_std")]
    columns: dict[str, list[float]] = {name: [] for name in names}
    columns |= {f"{name}_std": [] for name in (*log.output_names, "norm")} | {"n": []}
    centre = sphere_centre(np.array([samples[first:last].mean(axis=0) for first, last in bounds]))
    for first, last in bounds:
        for name in names:
            columns[name].append(float(np.mean(log.columns[name][first:last])))
        for name in log.output_names:
            columns[f"{name}_std"].append(_effective_std(log.columns[name][first:last]))
        columns["norm_std"].append(_effective_std(np.linalg.norm(samples[first:last] - centre, axis=1)))
        columns["n"].append(last - first)
    if "t_s" not in columns:
        columns["t_s"] = [(first + last) / 2 / rate_hz for first, last in bounds]
    constants: Mapping[str, Constant] = {k: v for k, v in log.constants.items() if k != "filter_corner_hz"}
    return Table.from_columns("positions", columns, constants, log.source)


def _is_alike(samples: Array, bounds: list[tuple[int, int]]) -> bool:
    """Whether the means of still intervals differ no more than samples in one do, as a gyroscope's."""
    means = np.array([samples[first:last].mean(axis=0) for first, last in bounds])
    noise = np.median([np.linalg.norm(samples[first:last].std(axis=0)) for first, last in bounds])
    return bool(np.linalg.norm(means.std(axis=0)) < TURNED * noise)


def sphere_centre(means: Array) -> Array:
    """Centre of the sphere through the means: |m|^2 = 2 m.c + const, linear in c."""
    middle: Array = means.mean(axis=0)
    offsets = means - middle
    if len(means) < 5:
        return middle
    A = np.column_stack([2 * offsets, np.ones(len(means))])
    solution: Array = np.linalg.lstsq(A, np.sum(offsets**2, axis=1), rcond=None)[0]
    return np.asarray(middle + solution[:3], dtype=np.float64)


def is_raw_log(table: Table) -> bool:
    """Whether rows are samples rather than means: many rows, without a count of averaged samples."""
    return table.kind == "positions" and table.n >= 1000 and "n" not in table


def still_intervals(samples: Array, rate_hz: float) -> list[tuple[int, int]]:
    """First row and row after the last of each still interval. `samples` has shape (n, 3)."""
    width = max(4, round(WINDOW_S * rate_hz))
    spread = _moving_std(samples, width)
    quiet = float(np.quantile(spread, QUIET_QUANTILE))
    if np.max(spread) < SHAKEN * quiet:
        return []
    still = spread < MOVING * max(quiet, np.finfo(float).tiny)
    trim, shortest = round(TRIM_S * rate_hz), round(SHORTEST_S * rate_hz)
    runs = [(a + trim, b + width - 1 - trim) for a, b in _runs(still)]
    return [(a, b) for a, b in runs if b - a >= shortest]


def _moving_std(samples: Array, width: int) -> Array:
    """Root of the summed variances in each window, shape (n - width + 1,)."""
    centred = samples - samples.mean(axis=0)
    first = np.cumsum(np.vstack([np.zeros((1, 3)), centred]), axis=0)
    second = np.cumsum(np.vstack([np.zeros((1, 3)), centred**2]), axis=0)
    mean = (first[width:] - first[:-width]) / width
    variance = (second[width:] - second[:-width]) / width - mean**2
    return np.asarray(np.sqrt(np.maximum(variance.sum(axis=1), 0.0)))


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _effective_std(x: Array) -> float:
    """Standard deviation that, divided by sqrt(n), is that of the mean: correlation of the samples is in it.

    From the autocovariance, summed until it first falls below zero (initial positive sequence).
    """
    n = len(x)
    centred = x - x.mean()
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    acov = np.fft.irfft(spectrum, size)[: n // 2] / n
    below = np.flatnonzero(acov <= 0)
    end = int(below[0]) if len(below) else len(acov)
    return float(np.sqrt(max(acov[0] + 2 * acov[1:end].sum(), 0.0) * n / (n - 1)))
