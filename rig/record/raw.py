"""A run whose rows are single samples, as one table: those of the poses that belong to the record itself.

A procedure names them by their path: `still 0`, `still 1` ... of a table of kind `still`. In a table of `motion` the
displacement sensor's volts have become the displacement, and the attitude stands beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from calibrations.table import Array, Table
from rig.bench import D63
from rig.errors import RecordError
from rig.record.angles import as_they_were
from rig.record.displacement import displacement_m
from rig.record.values import Kept, Run


def samples_table(run: Run, poses: Iterable[Kept]) -> Table:
    """Every sample of the run's kind with its time. Raises RecordError where nothing is kept yet."""
    stretches = [kept for kept in poses if kept.pose.path.split(" ")[0] == run.kind]
    if not stretches:
        raise RecordError(f"run {run.run} holds no record of kind {run.kind} yet; `rig resume` goes on with it")
    names = stretches[0].samples.channels
    volts = np.concatenate([kept.samples.volts for kept in stretches])
    columns = {"t_s": np.concatenate([_times_s(kept) for kept in stretches])}
    columns |= {f"{name}_v": volts[:, k] for k, name in enumerate(names)}
    if run.kind == "motion":
        columns |= _attitude(stretches) | {"displacement_m": displacement_m(run, columns.pop(f"{D63}_v"))}
    columns, angle_stds = as_they_were(run, columns)
    constants = {**run.constants, **angle_stds, "sample_rate_hz": stretches[0].samples.rate_hz}
    return Table.from_columns(run.kind, columns, constants, run.run)


def _attitude(stretches: Sequence[Kept]) -> dict[str, Array]:
    """Stage angles and, where all of it is known, the temperature: one value for each stretch."""
    lengths = [len(kept.samples.volts) for kept in stretches]
    each: dict[str, list[float | None]] = {
        "alpha_deg": [kept.pose.alpha_deg for kept in stretches],
        "beta_deg": [kept.pose.beta_deg for kept in stretches],
        "alpha_read_deg": [kept.alpha_read_deg for kept in stretches],
        "beta_read_deg": [kept.beta_read_deg for kept in stretches],
        "temperature_c": [kept.temperature_c for kept in stretches],
    }
    return {name: np.repeat(np.array(v, dtype=float), lengths) for name, v in each.items() if None not in v}


def _times_s(kept: Kept) -> Array:
    """Times of a stretch's samples on the run's own clock, s."""
    n, rate_hz = len(kept.samples.volts), kept.samples.rate_hz
    return np.asarray(kept.t_s + (np.arange(n) - n / 2) / rate_hz)
