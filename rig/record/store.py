"""The record: writes and reads runs, one transaction at a time.

A pose, its samples and the state of the simulated bench are one transaction, so a kill loses only the present pose.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import URL, Column, Connection, Row, func, insert, select, true, update
from sqlalchemy import Table as SqlTable
from sqlalchemy.exc import DatabaseError

from calibrations.table import Table
from procedures.session import Dwell, Pose, Reading
from rig.errors import RecordError, UnknownRun
from rig.files import RECORD, home
from rig.lab_url import lab_url, mask_url
from rig.lease import is_held
from rig.record import codec
from rig.record.checksum import is_damaged, with_checksum
from rig.record.file import FILE, RECOVER, open_file
from rig.record.rows import (
    KEPT_COLUMNS,
    LAST,
    POSE_COLUMNS,
    damage_text,
    dwell_of,
    excluded_rows,
    has_checksums,
    insert_or_replace,
    kept_of,
    known_names,
    listed_rows,
    lost_pose_error,
    lost_rows,
    new_run,
    pose_of,
    put_state,
    require_rows,
    require_sound,
    require_whole,
    run_of,
    runs_of_sensor,
    select_changed_rows,
    select_imported_rows,
    select_named_rows,
    several_error,
    timestamp,
    unknown_error,
)
from rig.record.schema import (
    blocks,
    columns,
    dwells,
    events,
    log,
    poses,
    readings,
    runs,
    states,
)
from rig.record.values import Event, KeptPose, LogLine, Run

MOST_LINES = 1000  # of the log in memory


class Record:
    """The record in the folder `place` (default: the folder of the application), or on the server with this URL.

    A context manager. Raises RecordError if the file cannot be opened, is damaged, or belongs to a newer program;
    LabAway without a connection to the server.
    """

    def __init__(self, place: Path | URL | None = None) -> None:
        self.folder = home() if isinstance(place, URL) else place or home()  # also of the locks
        self.path = self.folder / FILE
        self.remarks: list[str] = []  # on the file: it was repaired during this command
        if isinstance(place, URL):
            from rig.record.lab import open_server

            self.where, self.engine = mask_url(place), open_server(place)
        else:
            self.where, self.engine = str(self.path), open_file(self.path, self.remarks.append)
        self._lines: list[dict[str, Any]] = []  # of the log, not written yet

    @classmethod
    def to_read(cls) -> Self:
        """The record for reading: of a lab if it is chosen (`--record URL`, RIG_RECORD), else of this rig."""
        if not (url := os.environ.get(RECORD)):
            return cls()
        return cls(lab_url(url, RECORD))

    @classmethod
    def to_find(cls, run: str, local_only: bool = False) -> Self:
        """Open the record to search for a run, or only the rig's own one. Creates no record. Raises UnknownRun."""
        if not (home() / FILE).is_file() and (local_only or not cls.is_there()):
            raise UnknownRun(f"no run {run!r}: there is no record yet in {home()}; run a procedure first")
        return cls() if local_only else cls.to_read()

    @staticmethod
    def is_there() -> bool:
        """Whether the record for reading exists. A record on a server is checked when it is opened."""
        return bool(os.environ.get(RECORD)) or (home() / FILE).is_file()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.engine.dispose()

    # writing

    def begin(
        self,
        procedure: str,
        settings: Mapping[str, Any],
        *,
        bench: Mapping[str, Any],
        identities: Mapping[str, Any],
        configuration: str,
        constants: Mapping[str, str | float],
        source: str,
        kind: str = "poses",
    ) -> str:
        """Add a run of `procedure` in the state "running", for a table of `kind`. Returns its id."""
        values = {"kind": kind, "procedure": procedure, "state": "running", "settings": dict(settings)}
        values |= {"bench": dict(bench), "identities": dict(identities), "configuration": configuration}
        with self.engine.begin() as connection:
            return new_run(connection, values | {"constants": dict(constants), "source": source})

    def keep(self, run: str, number: int, recorded: KeptPose, state: Mapping[str, Any] | None) -> None:
        """Add pose, samples and the `state` of the simulated bench, in one transaction."""
        key = {"run": run, "number": number}
        pose = {name: getattr(recorded.pose, name) for name in POSE_COLUMNS}
        samples = {name: getattr(recorded.samples, name) for name in ("rate_hz", "start_s")}
        samples |= {"channels": list(recorded.samples.channels), "codec": codec.CODEC}
        samples |= {"samples": codec.encode(recorded.samples.volts)}
        measured = recorded.dwell
        dwell = {"n": measured.n, "means": dict(measured.means), "stds": dict(measured.stds)}
        with self.engine.begin() as connection:
            pose |= {name: getattr(recorded, name) for name in KEPT_COLUMNS}
            for table, values in ((poses, pose), (blocks, samples), (dwells, dwell)):
                connection.execute(insert(table), with_checksum(table, key | values))
            if state is not None:
                put_state(connection, run, state)
            self._put_lines(connection)

    def keep_readings(self, run: str, new_readings: Iterable[Reading], state: Mapping[str, Any] | None) -> None:
        """Add readings and the `state` of the simulated bench, in one transaction. An existing name is replaced."""
        with self.engine.begin() as connection:
            for reading in new_readings:
                row = with_checksum(readings, {"run": run, "at": timestamp(), **vars(reading)})
                insert_or_replace(connection, readings, row, ("run", "name"))
            if state is not None:
                put_state(connection, run, state)
            self._put_lines(connection)

    def log(self, run: str, clock_s: float, source: str, event: str, text: str) -> None:
        """Add a line to the log of a run. It is written with the next pose, or with MOST_LINES other lines."""
        line = {"run": run, "at": timestamp(), "clock_s": clock_s, "who": source, "what": event, "text": text}
        self._lines.append(line)
        if len(self._lines) >= MOST_LINES:
            with self.engine.begin() as connection:
                self._put_lines(connection)

    def exclude(self, run: str, numbers: Iterable[int], reason: str | None) -> None:
        """Exclude poses from every analysis, with a reason that stays as an event; None includes them again.

        For a row of an imported table only the event is written. All are excluded in one transaction. Raises
        RecordError for an unknown pose.
        """
        with self.engine.begin() as connection:
            for number in numbers:
                is_pose = (poses.c.run == run) & (poses.c.number == number)
                updated = connection.execute(update(poses).where(is_pose).values(excluded=reason)).rowcount
                if not updated and not 0 <= number < select_imported_rows(connection, run):
                    raise RecordError(f"run {run} has no pose {number}; `rig show {run} --poses` lists its poses")
                change = f"pose {number} {'included' if reason is None else 'excluded'}"
                connection.execute(
                    insert(events), {"run": run, "at": timestamp(), "what": change, "text": reason or "again"}
                )

    def keep_state(self, run: str, state: Mapping[str, Any]) -> None:
        """Store the state of the simulated bench before the first pose."""
        with self.engine.begin() as connection:
            put_state(connection, run, state)

    def set_state(
        self, run: str, state: str, message: str | None = None, results: Mapping[str, Any] | None = None
    ) -> None:
        """Set the state: running, complete, stopped or failed. The last three end the run."""
        end_time = None if state == "running" else timestamp()
        values = {"state": state, "message": message, "ended": end_time, "results": dict(results or {})}
        with self.engine.begin() as connection:
            connection.execute(update(runs).where(runs.c.run == run).values(values))
            self._put_lines(connection)

    def set_results(self, run: str, results: Mapping[str, Any]) -> None:
        """Replace the results of a run after its end."""
        with self.engine.begin() as connection:
            connection.execute(update(runs).where(runs.c.run == run).values(results=dict(results)))

    def note(self, run: str, event: str, text: str) -> None:
        """Add an event to a run."""
        with self.engine.begin() as connection:
            connection.execute(insert(events), {"run": run, "at": timestamp(), "what": event, "text": text})

    def add_table(self, table: Table, settings: Mapping[str, Any] | None = None) -> str:
        """Add an imported table as a run, with the settings of the import. Returns its id."""
        values = {"kind": table.kind, "procedure": "import", "state": "complete", "bench": {}}
        values |= {"settings": dict(settings or {})}
        values |= {"configuration": table.digest, "constants": dict(table.constants), "source": table.source}
        # one column at a time: two copies of a large table do not fit into memory
        cells: Iterator[dict[str, Any]] = chain(
            ({"name": name, "numbers": np.asarray(column, "<f8").tobytes()} for name, column in table.columns.items()),
            ({"name": name, "texts": list(column)} for name, column in table.labels.items()),
        )
        with self.engine.begin() as connection:
            run = new_run(connection, values | {"ended": timestamp()})
            for position, cell in enumerate(cells):
                row = with_checksum(columns, {**cell, "position": position})
                connection.execute(insert(columns), {**row, "run": run})
        return run

    # reading

    def runs(self) -> list[Run]:
        """Every readable run, newest first; `damaged_runs` has the others."""
        with self._reading() as connection:
            rows, _ = listed_rows(connection)
        return [self._with_true_state(run_of(row)) for row in rows if not is_damaged(runs, row._mapping)]

    def damaged_runs(self) -> list[str]:
        """A sentence for each run with a damaged entry, newest first, and for each with a damaged table of poses."""
        with self._reading() as connection:
            rows, unreadable = listed_rows(connection)
        entries = [damage_text(row.run) for row in rows if is_damaged(runs, row._mapping)]
        return [*entries, *(damage_text(run, "table of poses") for run in unreadable)]

    def damaged_rows(self) -> list[str]:
        """A phrase for each row of a run, except its entry, that changed on the disk or is lost."""
        with self._reading() as connection:
            return [*lost_rows(connection), *select_changed_rows(connection)]

    def run(self, name: str) -> Run:
        """The run with this id, or whose id alone begins so, or the only one of the sensor with this name or serial.

        `last` is the newest run; `last PROCEDURE`, `last SENSOR` and `last PROCEDURE SENSOR` the newest of these.
        Raises UnknownRun with a suggestion; RecordError if the entry of the run is damaged.
        """
        with self._reading() as connection:
            rows, names = select_named_rows(connection, name), known_names(connection, name)
        if len(rows) == 1:
            if is_damaged(runs, rows[0]._mapping):
                raise RecordError(f"{self.where}: {damage_text(rows[0].run)}")
            return self._with_true_state(run_of(rows[0]))
        if rows:
            raise several_error(rows, name, self.where)
        of_sensor = runs_of_sensor(all_runs := self.runs(), name)
        if len(of_sensor) == 1 or (of_sensor and name.startswith(f"{LAST} ")):
            return of_sensor[0]
        raise unknown_error(name, self.where, of_sensor, all_runs, names)

    def poses(self, run: str) -> list[Pose]:
        """The poses in order, without the excluded ones."""
        is_included = (poses.c.run == run) & poses.c.excluded.is_(None)
        query = select(poses).where(is_included).order_by(poses.c.number)
        with self._reading() as connection:
            required = has_checksums(connection, run)
            return [pose_of(require_sound(row, poses, required=required)) for row in connection.execute(query)]

    def excluded(self, run: str) -> dict[int, str]:
        """The reason of each excluded pose, or row of an imported table, by its number."""
        is_excluded = (poses.c.run == run) & poses.c.excluded.is_not(None)
        query = select(poses.c.number, poses.c.excluded).where(is_excluded).order_by(poses.c.number)
        with self._reading() as connection:
            if select_imported_rows(connection, run):
                return excluded_rows(self.events(run))
            return {row.number: row.excluded for row in connection.execute(query)}

    def next_number(self, run: str) -> int:
        """The number of the next pose. Excluded poses count."""
        highest = self._greatest(poses.c.number, run)
        return 0 if highest is None else int(highest) + 1

    def last_t_s(self, run: str) -> float | None:
        """The time of the last pose; None before the first."""
        last: float | None = self._greatest(poses.c.t_s, run)
        return last

    def readings(self, run: str) -> list[Reading]:
        """The run's readings, in the order of their names."""
        rows = self._sound_rows(readings, run, readings.c.name)
        return [Reading(row.name, row.value, row.unit, row.std) for row in rows]

    def kept(self, run: str) -> Iterator[KeptPose]:
        """Every pose with its samples, in order, with the excluded ones. Only a few are in memory at a time."""
        match = (poses.c.run == blocks.c.run) & (poses.c.number == blocks.c.number)
        query = select(poses, blocks).join_from(poses, blocks, match).where(poses.c.run == run)
        with self._reading() as connection:
            excluded = require_whole(connection, run)
            required = has_checksums(connection, run)
            options = connection.execution_options(yield_per=32)
            for row in options.execute(query.order_by(poses.c.number)):
                excluded.discard(row.number)
                if row.excluded is not None and any(is_damaged(t, row._mapping, required) for t in (poses, blocks)):
                    continue
                yield kept_of(require_sound(row, poses, blocks, required=required))
            for number in sorted(excluded):
                raise lost_pose_error(run, number)

    def dwells(self, run: str, after_number: int = -1) -> list[tuple[int, Dwell]]:
        """Means and scatter of every pose with a number above `after_number`, without the excluded ones.

        For runs of an older program they are computed from the samples, which is slower.
        """
        match = (poses.c.run == dwells.c.run) & (poses.c.number == dwells.c.number)
        query = select(poses, dwells).join_from(poses, dwells, match, isouter=True)
        is_later = (poses.c.run == run) & (poses.c.number > after_number) & poses.c.excluded.is_(None)
        with self._reading() as connection:
            excluded = require_whole(connection, run) if after_number < 0 else set()
            required = has_checksums(connection, run)
            selected = connection.execute(query.where(is_later).order_by(poses.c.number))
            rows = [require_sound(row, poses, dwells, required=required) for row in selected]
        for number in sorted(excluded - {row.number for row in rows}):
            raise lost_pose_error(run, number)
        is_old = any(row.n is None for row in rows)
        older = {recorded.number: recorded.dwell for recorded in self.kept(run)} if is_old else {}
        return [(row.number, older.get(row.number) or dwell_of(row)) for row in rows]

    def state(self, run: str) -> dict[str, Any] | None:
        """The state of the simulated bench after the last pose; None on a real bench."""
        with self._reading() as connection:
            return connection.execute(select(states.c.state).where(states.c.run == run)).scalar_one_or_none()

    def events(self, run: str) -> list[Event]:
        """The events of a run, in order."""
        query = select(events.c.at, events.c.what, events.c.text).where(events.c.run == run)
        with self._reading() as connection:
            return [Event(*row) for row in connection.execute(query.order_by(events.c.event))]

    def lines(self, run: str, events: Sequence[str] = ()) -> list[LogLine]:
        """The log of a run, in order; only the kinds in `events`, if there are any."""
        columns = [log.c[name] for name in ("at", "clock_s", "who", "what", "text")]
        is_wanted = (log.c.run == run) & (log.c.what.in_(events) if events else true())
        with self._reading() as connection:
            return [LogLine(*row) for row in connection.execute(select(*columns).where(is_wanted).order_by(log.c.line))]

    def columns(self, run: str) -> tuple[dict[str, NDArray[np.float64]], dict[str, tuple[str, ...]]]:
        """The columns of an imported table: numbers, and texts, by name."""
        rows = self._sound_rows(columns, run, columns.c.position)
        numbers = {row.name: np.frombuffer(row.numbers, "<f8") for row in rows if row.numbers is not None}
        return numbers, {row.name: tuple(row.texts) for row in rows if row.numbers is None}

    @contextmanager
    def _reading(self) -> Iterator[Connection]:
        """A connection for reading. An impossible value is a RecordError."""
        try:
            with self.engine.connect() as connection:
                yield connection
        except (ValueError, TypeError, LookupError, OverflowError, DatabaseError) as error:
            reason = f"{type(error).__name__}: {error}".partition("\n")[0]
            raise RecordError(f"{self.where}: the record is damaged; {RECOVER} ({reason})") from None

    def _greatest(self, column: Column[Any], run: str) -> Any:
        """The greatest value in a column of a run; None without any."""
        with self._reading() as connection:
            return connection.execute(select(func.max(column)).where(column.table.c.run == run)).scalar_one()

    def _sound_rows(self, table: SqlTable, run: str, order: Column[Any]) -> list[Row[Any]]:
        """The rows of a run in a table. Raises RecordError where one is lost or has changed on the disk."""
        with self._reading() as connection:
            require_rows(connection, table, run)
            required = has_checksums(connection, run)
            query = select(table).where(table.c.run == run).order_by(order)
            return [require_sound(row, table, required=required) for row in connection.execute(query)]

    def _put_lines(self, connection: Connection) -> None:
        """Write the lines of the log. After a failure they are dropped."""
        lines, self._lines = self._lines, []
        if lines:
            connection.execute(insert(log), lines)

    def _with_true_state(self, run: Run) -> Run:
        """The run; in the state "stopped" if it is "running" without a process, because its process was killed."""
        if run.state != "running" or is_held(self.folder, run.run):
            return run
        return replace(run, state="stopped", message="its process was killed")
