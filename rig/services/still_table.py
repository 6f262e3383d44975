"""A still table as a stream: a channel, what may be followed, and times that must go on evenly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.table import Table
from rig.services.data import BESIDE, FOLLOWED
from rig.services.stream import AXIS, LATE, Stream, agreed, channel_of

MOST_MISSING = 0.1  # of a record, in gaps that are closed up
WHOLE = 0.1  # of a step, by which steps may be off whole numbers of them where single samples were lost
FEW_GAPS = 0.01  # of all steps
EVEN = "record anew, evenly and every sample (what is interpolated has less white noise than the sensor)"
UNEVEN = 1e-3  # of a record, by which times may be off an even row: those of a computer that samples reach in bursts


def of_table(table: Table, channel: str | None, rate_hz: float | None) -> Stream:
    if table.kind != "still" or "alpha_deg" in table:
        kind = "poses" if table.kind == "still" else table.kind
        raise _no_record(f"{table.source}: a table of {kind}")
    if "n" in table and (many := float(np.median(table.column("n")))) > 1:
        raise _no_record(f"{table.source}: a row is the mean of {many:.0f} samples by its column n, as of poses")
    channels = tuple(name for name in table.columns if name not in BESIDE)
    chosen = channel_of(channels, channel, table.source)
    stated = rate_hz or table.number("sample_rate_hz", 0.0)
    times = _times(table)
    rate = agreed(times.rate_hz if times else None, stated, table.source)
    unit = "V" if chosen.endswith("_v") else str(table.constants.get("unit", "count"))
    corner_hz = table.number("filter_corner_hz", np.inf)
    others = tuple(name for name in channels if name != chosen)
    found = Stream(
        table.source, chosen, rate, unit, iter([table.column(chosen)]), corner_hz, others, constants=table.constants,
        logged={name: [table.column(name)] for name in _logged(table, chosen)},
    )  # fmt: skip
    return replace(found, closed=list(times.gaps), uneven_s=times.uneven_s) if times else found


def _no_record(what: str) -> DataError:
    """What is no still record, and what to do."""
    return DataError(
        f"{what}; noise needs single samples of a sensor at rest: take a table of still, or `rig run noise-floor`"
    )


def _logged(table: Table, channel: str) -> Iterator[str]:
    """Columns that an output may follow: temperature, supply, and what is no output of a sensor by its name."""
    for name in table.columns:
        own = name not in BESIDE and AXIS.fullmatch(channel) is not None and AXIS.fullmatch(name) is None
        if name in FOLLOWED or (own and name != channel):
            yield name


@dataclass(frozen=True)
class _Times:
    """What a column of times says: the rate, the gaps in it, and by how much an even row of times is off, s."""

    rate_hz: float
    gaps: tuple[tuple[float, float], ...] = ()
    uneven_s: float = 0.0


def _times(table: Table) -> _Times | None:
    """None without a column of times. Raises DataError where they do not go on, or are too uneven."""
    if "t_s" not in table or table.n < 2:
        return None
    t_s = table.column("t_s")
    step_s, length_s = np.diff(t_s), float(t_s[-1] - t_s[0])
    typical = float(np.median(step_s))
    if step_s.min() <= 0:
        row = int(np.argmin(step_s > 0)) + 2
        raise DataError(f"{table.source}: row {row}: the time does not go on; sort the rows and remove duplicates")
    far = np.flatnonzero(np.abs(step_s - typical) > LATE * typical)
    if len(far) <= FEW_GAPS * table.n and np.all(step_s[far] > typical):
        gaps = tuple((float(t_s[i]), float(step_s[i] - typical)) for i in far)
        _check_gaps(gaps, (table.n - 1) * typical, table.source)
        return _Times((table.n - 1 - len(far)) / float(np.sum(np.delete(step_s, far))), gaps)
    lost = np.round(step_s / typical) - 1
    if 0 < lost.sum() < table.n and np.all(np.abs(step_s / typical - 1 - lost) < WHOLE):
        raise DataError(
            f"{table.source}: {lost.sum():.0f} samples are missing, here and there, the first after row {far[0] + 2}; "
            f"{EVEN}, or analyse {_longest(far, table.n)} by themselves"
        )
    off_s = float(np.max(np.abs(t_s - np.linspace(t_s[0], t_s[-1], table.n))))
    if off_s > UNEVEN * length_s:
        raise DataError(
            f"{table.source}: row {far[0] + 2} comes {step_s[far[0]]:.3g} s after the one before, others after "
            f"{typical:.3g} s; samples must be evenly spaced: {EVEN}"
        )
    return _Times((table.n - 1) / length_s, (), off_s)


def _longest(far: NDArray[np.intp], n: int) -> str:
    """The longest stretch of n rows without a late one, counted from 1; `far` are the last rows before these."""
    edges = np.array([-1, *far, n - 1])
    k = int(np.argmax(np.diff(edges)))
    return f"rows {edges[k] + 2} to {edges[k + 1] + 1}, the longest stretch without a loss,"


def _check_gaps(gaps: Sequence[tuple[float, float]], length_s: float, source: str) -> None:
    """Raises DataError where too much is missing to close the gaps up."""
    missing = sum(length for _, length in gaps)
    if missing > MOST_MISSING * length_s:
        longest = max(gaps, key=lambda gap: gap[1])
        raise DataError(
            f"{source}: {len(gaps)} gaps, {missing:g} s in all beside {length_s:g} s of samples; the longest, of "
            f"{longest[1]:g} s, is at t = {longest[0]:g} s: analyse the parts between gaps each by itself"
        )
