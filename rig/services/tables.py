"""DATA of a command as one table: a file, a run of the record, or several of one sensor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from calibrations.errors import DataError
from calibrations.importing.foreign import read_csv, sort_out_rows
from calibrations.importing.raw_logs import average_raw_log
from calibrations.table import Table
from rig.errors import RecordError, RigError, UnknownRun

if TYPE_CHECKING:
    from rig.record.store import Record


EXCLUDED = "excluded"
INFLUENCES = ("temperature_c", "supply_v")  # columns that an output may follow
BESIDE = ("t_s", *INFLUENCES, "n", "direction", "path")  # columns that are not channels


def average_log(log: Table, notify: Callable[[str], None]) -> Table:
    """The table; a raw log is averaged over its still intervals, with a remark to `notify`.

    Duplicate rows count once, and the clock continues where it starts again. Raises DataError without any still
    interval.
    """
    table = average_raw_log(log)
    if table is not log:
        rows = table.type.taken.format(table.n)
        notify(f"{log.source} is a log of raw samples: the table has {rows}, from {log.n} samples.")
    table, remarks = sort_out_rows(table)
    for remark in remarks:
        notify(remark)
    return _without_excluded_rows(table, notify)


def _without_excluded_rows(table: Table, notify: Callable[[str], None]) -> Table:
    """The table without the rows that its column `excluded` marks; a run has `rig exclude` instead."""
    is_excluded = table.optional(EXCLUDED, 0.0) != 0
    if not is_excluded.any():
        return table
    notify(
        f"{table.source}: {np.count_nonzero(is_excluded)} of {table.n} rows are left out: their column `{EXCLUDED}` is "
        "not 0."
    )
    if is_excluded.all():
        raise DataError(f"{table.source}: its column `{EXCLUDED}` excludes every row; write 0 for the rows to use")
    return table.rows(~is_excluded)


def load(data: str, kind: str | None = None, notify: Callable[[str], None] = lambda _: None) -> Table:
    """The table of `data`: a file, else a run, or several joined by SEPARATOR. `notify` receives remarks.

    Raises DataError naming file, line and column; UnknownRun naming the nearest run.
    """
    if len(names := names_of(data)) > 1:
        return load_all(names, notify)
    if Path(data).is_dir():
        raise DataError(f"{data}: this is a folder; give a file in it, or a run (`rig runs` lists them)")
    if Path(data).is_file():
        return average_log(read_csv(Path(data), kind), notify)
    table = _run_table(data)
    if kind is not None and table.kind != kind:
        raise RecordError(f"run {data} is a table of {table.kind}, not of {kind}")
    return table


def _run_table(data: str) -> Table:
    from rig.record.measured import table_of
    from rig.record.store import Record  # a file needs no database

    if data.startswith(("/", "./", "../")) or data.count("/") > 1:  # else it may be RUN/SENSOR
        raise UnknownRun(_no_file_text(Path(data)))
    try:
        with Record.to_find(data) as record:
            return table_of(record, data)
    except UnknownRun as error:
        raise UnknownRun(f"{data}: there is no such file, and {error}") from None


def _no_file_text(path: Path) -> str:
    """The message for a path without a file: its folder is missing, or the nearest name there."""
    if not path.parent.is_dir():
        return f"{path}: there is no such file, and no folder {path.parent}"
    names = [entry.name for entry in path.parent.iterdir()]
    from drivers.errors import did_you_mean  # an analysis of a file needs no driver

    return f"{path}: there is no such file.{did_you_mean(path.name, (), names)}"


# Several runs or files of one sensor as one table.

SEPARATOR = " + "  # between their names, where one text names all


def names_of(data: str) -> list[str]:
    """The runs and files that a text names: `A + B` names two."""
    return [data] if Path(data).exists() else [name.strip() for name in data.split(SEPARATOR)]


def with_run_ids(data: str) -> str:
    """The same data by the id of each run, which stays valid: for `last sweep`, the present one. Other names stay."""
    return SEPARATOR.join(_with_run_id(name) for name in names_of(data))


def _with_run_id(name: str) -> str:
    selector, slash, sensor = name.partition("/")
    if Path(name).exists() or not selector:
        return name
    from rig.record.store import Record  # as above

    try:
        with Record.to_find(selector) as record:
            run = record.run(selector)
    except (RigError, OSError):  # the analysis says what is wrong with the name
        return name
    return name if run.batch and not slash else f"{run.run}{slash}{sensor}"


def load_all(names: Sequence[str], notify: Callable[[str], None] = lambda _: None) -> Table:
    """The tables that `names` name, joined. Raises what `load` and `join_tables` raise."""
    tables = [load(name, notify=notify) for name in names]
    sources = [table.source for table in tables]
    if duplicate := next(
        (name for name, source in zip(names, sources, strict=True) if sources.count(source) > 1), None
    ):
        raise DataError(f"{duplicate} is given twice; give the same data once")
    if len(tables) == 1:
        return tables[0]
    return join_runs(tables, [_begin_time(name) for name in names], notify)


def join_runs(
    tables: Sequence[Table], starts: Sequence[datetime | None], notify: Callable[[str], None] = lambda _: None
) -> Table:
    """The tables of runs, joined; times count from the start of the first if the `starts` of all are known."""
    from calibrations.joined import has_clock_restart, join_tables  # a single table does not need it

    start_times = [start for start in starts if start is not None]
    if len(start_times) == len(tables):
        tables = [
            _later(t, (start - start_times[0]).total_seconds()) for t, start in zip(tables, start_times, strict=True)
        ]
    if has_clock_restart(tables):
        notify(
            "The time starts again in each of these; the analysis assumes that one followed directly after the other."
        )
    return join_tables(tables)


def _begin_time(name: str) -> datetime | None:
    """The start of a run on real instruments, whose times count from it."""
    if Path(name).is_file():
        return None
    from rig.record.store import Record

    with suppress(UnknownRun), Record.to_find(name) as record:
        return begin_time(record, name.partition("/")[0])
    return None


def begin_time(record: Record, run: str) -> datetime | None:
    """The start of a run; None on a simulated bench, whose times count from power-on."""
    from rig.bench import Bench

    recorded = record.run(run)
    simulated = recorded.bench.get("instruments") and Bench.model_validate(recorded.bench).simulated
    return None if simulated else datetime.fromisoformat(recorded.created)


def _later(table: Table, by_s: float) -> Table:
    if "t_s" not in table:
        return table
    return replace(table, columns=MappingProxyType({**table.columns, "t_s": table.column("t_s") + by_s}))
