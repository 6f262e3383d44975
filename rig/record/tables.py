"""A run as the table that analysis takes: the mean, std and number of every pose's samples."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from calibrations.table import Table
from rig.errors import RecordError
from rig.record.store import Record
from rig.record.values import Kept, Run

AXES = ("vx", "vy", "vz")  # channels whose scatter is kept; others are regressors


def table_of(record: Record, run_id: str) -> Table:
    """The table of a run, measured or imported. Raises UnknownRun, or RecordError where nothing is kept yet."""
    run = record.run(run_id)
    numbers, labels = record.columns(run_id)
    if numbers:
        return Table.from_columns(run.kind, numbers, run.constants, run.run, labels)
    kept = [_row(each) for each in record.kept(run_id)]
    if not kept:
        raise RecordError(f"run {run_id} holds no pose yet; `rig resume {run_id}` goes on with it")
    names = [name for name in kept[0][0] if all(name in row for row, _ in kept)]
    columns = {name: np.array([row[name] for row, _ in kept]) for name in names if _useful(name, kept)}
    paths = tuple(path for _, path in kept)
    return Table.from_columns(
        run.kind, columns, _constants(record, run), run.run, {"path": paths} if any(paths) else {}
    )


def _row(kept: Kept) -> tuple[dict[str, float], str]:
    """One pose's numbers by column, and its path."""
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
    return row | {"n": len(samples.volts)}, pose.path


def _useful(name: str, kept: list[tuple[dict[str, float], str]]) -> bool:
    """How the sensor is mounted is a column only where it was ever changed."""
    return name not in ("mount_deg", "flip") or any(row[name] for row, _ in kept)


def _constants(record: Record, run: Run) -> Mapping[str, str | float]:
    first = next(record.kept(run.run))
    return {**run.constants, "sample_rate_hz": first.samples.rate_hz}
