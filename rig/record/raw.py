"""A run whose rows are single samples, as one table: those of the poses that belong to the record itself.

A procedure names them by their path: `still 0`, `still 1` ... of a table of kind `still`.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from calibrations.table import Array, Table
from rig.errors import RecordError
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
    constants = {**run.constants, "sample_rate_hz": stretches[0].samples.rate_hz}
    return Table.from_columns(run.kind, columns, constants, run.run)


def _times_s(kept: Kept) -> Array:
    """Times of a stretch's samples on the run's own clock, s."""
    n, rate_hz = len(kept.samples.volts), kept.samples.rate_hz
    return np.asarray(kept.t_s + (np.arange(n) - n / 2) / rate_hz)
