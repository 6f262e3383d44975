"""A run as the table that analysis takes: the mean, std and number of every pose's samples."""

from __future__ import annotations

import numpy as np

from calibrations.table import Array, Table
from rig.errors import RecordError
from rig.record.store import Record
from rig.record.values import Kept

AXES = ("vx", "vy", "vz")  # channels whose scatter is kept; others are regressors


def table_of(record: Record, run_id: str) -> Table:
    """The table of a run, measured or imported. Raises UnknownRun, or RecordError where nothing is kept yet."""
    run = record.run(run_id)
    numbers, labels = record.columns(run_id)
    if numbers:
        return Table.from_columns(run.kind, numbers, run.constants, run.run, labels)
    rows: list[dict[str, float]] = []
    paths: list[str] = []
    for kept in record.kept(run_id):
        rows.append(_row(kept))
        paths.append(kept.pose.path)
        rate_hz = kept.samples.rate_hz
    if not rows:
        raise RecordError(f"run {run_id} holds no pose yet; `rig resume {run_id}` goes on with it")
    names = [name for name in rows[0] if all(name in row for row in rows)]
    columns = {name: np.array([row[name] for row in rows]) for name in names}
    labels = {"path": tuple(paths)} if any(paths) else {}
    return Table.from_columns(run.kind, _useful(columns), {**run.constants, "sample_rate_hz": rate_hz}, run.run, labels)


def _row(kept: Kept) -> dict[str, float]:
    """One pose's numbers by column."""
    pose, samples = kept.pose, kept.samples
    row: dict[str, float] = {"alpha_deg": pose.alpha_deg, "beta_deg": pose.beta_deg, "direction": pose.direction}
    row |= {"mount_deg": pose.mount_deg, "flip": pose.flip, "t_s": kept.t_s}
    if kept.temperature_c is not None:
        row["temperature_c"] = kept.temperature_c
    means = samples.volts.mean(axis=0)
    row |= {f"{name}_v": float(mean) for name, mean in zip(samples.channels, means, strict=True)}
    if len(samples.volts) > 1:
        stds = samples.volts.std(axis=0, ddof=1)
        row |= {f"{name}_std_v": float(s) for name, s in zip(samples.channels, stds, strict=True) if name in AXES}
    return row | {"n": len(samples.volts)}


def _useful(columns: dict[str, Array]) -> dict[str, Array]:
    """How the sensor is mounted is a column only where it was ever changed."""
    return {k: column for k, column in columns.items() if k not in ("mount_deg", "flip") or column.any()}
