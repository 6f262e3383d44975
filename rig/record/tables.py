"""A run as the table that analysis takes: the mean, std and number of every pose's samples.

The displacement sensor is left out: of a carriage that stands still it tells nothing, and noise is no regressor.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from calibrations.noise_estimation.mean_noise import measured_inflation
from calibrations.table import Array, Table
from procedures.session import Samples
from rig.bench import D63
from rig.errors import RecordError
from rig.record.angles import as_they_were
from rig.record.values import Kept, Run

AXES = ("vx", "vy", "vz")  # channels whose scatter is kept; others are regressors
MOST_BLOCKS = 256  # spread over the run, that its noise is measured on: bounds the memory
SURE = 0.1  # relative standard error above which the filter's formula knows a mean's noise better


def poses_table(run: Run, poses: Iterable[Kept]) -> Table:
    """A row for each of the run's `poses`. Raises RecordError where there is none yet."""
    rows: list[dict[str, float]] = []
    paths: list[str] = []
    numbers: list[int] = []
    blocks: list[Samples] = []
    stride = 1 + run.rows // MOST_BLOCKS
    for number, kept in enumerate(poses):
        rows.append(_row(kept))
        paths.append(kept.pose.path)
        numbers.append(kept.number)
        if number % stride == 0:
            blocks.append(kept.samples)
    if not rows:
        raise RecordError(f"run {run.run} holds no pose yet; `rig resume` goes on with it")
    names = [name for name in rows[0] if all(name in row for row in rows)]
    columns = {name: np.array([row[name] for row in rows]) for name in names}
    labels = {"path": tuple(paths)} if any(paths) else {}
    columns, angle_stds = as_they_were(run, columns)
    constants = {**run.constants, **angle_stds, "sample_rate_hz": blocks[0].rate_hz, **inflations(blocks)}
    table = Table.from_columns(run.kind, _useful(columns), constants, run.run, labels)
    return replace(table, numbers=np.array(numbers))


def _row(kept: Kept) -> dict[str, float]:
    """One pose's numbers by column."""
    pose, samples = kept.pose, kept.samples
    row: dict[str, float] = {"alpha_deg": pose.alpha_deg, "beta_deg": pose.beta_deg, "direction": pose.direction}
    row |= {"mount_deg": pose.mount_deg, "flip": pose.flip, "t_s": kept.t_s}
    beside = {name: getattr(kept, name) for name in ("temperature_c", "alpha_read_deg", "beta_read_deg")}
    row |= {name: value for name, value in beside.items() if value is not None}
    means = samples.volts.mean(axis=0)
    row |= {f"{name}_v": float(m) for name, m in zip(samples.channels, means, strict=True) if name != D63}
    if len(samples.volts) > 1:
        stds = samples.volts.std(axis=0, ddof=1)
        row |= {f"{name}_std_v": float(s) for name, s in zip(samples.channels, stds, strict=True) if name in AXES}
    return row | {"n": len(samples.volts)}


def _useful(columns: dict[str, Array]) -> dict[str, Array]:
    """How the sensor is mounted is a column only where it was ever changed."""
    return {k: column for k, column in columns.items() if k not in ("mount_deg", "flip") or column.any()}


def inflations(blocks: Sequence[Samples], axes: Sequence[str] = AXES) -> dict[str, float]:
    """How much more a mean scatters than one of independent samples, from the blocks as long as the first."""
    first = blocks[0]
    places = [k for k, name in enumerate(first.channels) if name in axes]
    alike = np.stack([b.volts[:, places] for b in blocks if b.volts.shape == first.volts.shape])
    names = [f"noise_inflation_{first.channels[k][1:]}" for k in places]
    found = zip(names, *measured_inflation(alike), strict=True)
    return {name: float(factor) for name, factor, std in found if std < SURE * factor}
