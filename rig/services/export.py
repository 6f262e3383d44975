"""Export of runs in other formats.

csv           the table for the analysis, one row for each pose
event-model   the documents of the Bluesky event model: start, descriptor, events, stop; each line is one JSON object,
              {"name": .., "doc": ..}; the samples stay in the record

There is no Parquet and no HDF5: each needs a large dependency for one table, and their readers also read CSV.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, uuid5

from calibrations.importing.foreign import write_csv
from calibrations.table import Table
from rig.errors import ExportError
from rig.files import draft_of, require_out
from rig.record import Event, Record, Run
from rig.record.history import history
from rig.record.measured import table_of
from rig.services.tables import load

OTHER_ENDINGS = (
    ".parquet",
    ".h5",
    ".hdf5",
    ".xlsx",
    ".xls",
    ".ods",
    ".mat",
    ".npy",
    ".npz",
    ".json",
    ".jsonl",
)  # endings
UNITS = {"deg": "deg", "v": "V", "s": "s", "c": "degC"}


def export(data: str, kind: str, path: Path) -> int:
    """Write `data` (a run or a file) to `path`, completely or not at all. Returns the number of rows.

    Raises ExportError for an unknown format, by name or by the ending of `path`, or a format that needs a run;
    OutputError if `path` cannot be written.
    """
    if kind in ("parquet", "hdf5"):
        raise ExportError(f"this version does not write {kind}; use --format csv, which {kind} programs also read")
    if kind == "csv" and path.suffix.lower() in OTHER_ENDINGS:
        raise ExportError(f"{path}: this version writes CSV, and no {path.suffix}; give a name that ends in .csv")
    require_out(path)
    with draft_of(path) as draft:
        return _write_events(data, draft) if kind == "event-model" else _write_csv(data, draft)


def _write_csv(data: str, path: Path) -> int:
    table = load(data)
    write_csv(table, path)
    return table.n


def _write_events(data: str, path: Path) -> int:
    if Path(data).is_file():
        raise ExportError(f"{data} is a file; give the id of a run, because event-model documents describe a run")
    with Record.to_read() as record:
        run = record.run(data)
        table, events = table_of(record, run.run), history(record, run.run)
    lines = [json.dumps({"name": name, "doc": document}) for name, document in documents(run, table, events)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return table.n


def documents(run: Run, table: Table, events: Sequence[Event]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The run as event-model documents, (name, document). Their ids are derived from the id of the run.

    `events`: the history of the run, for the document of its end.
    """
    start, descriptor = _uid(run.run, "start"), _uid(run.run, "descriptor")
    began = datetime.fromisoformat(run.created).timestamp()
    end_s = datetime.fromisoformat(run.ended).timestamp() if run.ended else began
    yield (
        "start",
        {
            "uid": start,
            "time": began,
            "scan_id": 1,
            "run": run.run,
            "plan_name": run.procedure,
            "plan_args": dict(run.settings),
            "constants": dict(run.constants),
        },
    )
    keys = {name: _key(name, run, table) for name in table.columns}
    yield "descriptor", {"uid": descriptor, "run_start": start, "time": began, "name": "primary", "data_keys": keys}
    times = table.time_s - table.time_s[0] + began
    for number, time in enumerate(times):
        yield (
            "event",
            {
                "uid": _uid(run.run, str(number)),
                "descriptor": descriptor,
                "seq_num": number + 1,
                "time": float(time),
                "data": {name: float(column[number]) for name, column in table.columns.items()},
                "timestamps": dict.fromkeys(table.columns, float(time)),
            },
        )
    status = {"complete": "success", "stopped": "abort", "running": "abort"}.get(run.state, "fail")
    end = {"uid": _uid(run.run, "stop"), "run_start": start, "time": end_s, "exit_status": status}
    end |= {"reason": run.message or "", "num_events": {"primary": table.n}}
    yield "stop", {**end, "history": [asdict(event) for event in events]}


def _key(name: str, run: Run, table: Table) -> dict[str, Any]:
    key: dict[str, Any] = {"source": run.source, "dtype": "number", "shape": []}
    is_output = name in (*table.output_names, *table.std_names) and not name.endswith("_v")
    unit = table.unit if is_output else UNITS.get(name.rpartition("_")[2])
    return {**key, "units": unit} if unit else key


def _uid(run: str, kind: str) -> str:
    return str(uuid5(NAMESPACE_URL, f"{run}/{kind}"))
