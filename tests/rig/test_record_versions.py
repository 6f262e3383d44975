"""Records of every version of the program are opened by this one: read, written to, and gone on with.

`tests/data/records` has, of each version before this one, a sweep of six poses that was stopped after four, as that
program wrote it; from version 4 on also an imported table of six rows.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from rig.record import Record
from rig.record.measured import table_of
from rig.record.recover import recover
from rig.record.schema import NEW_COLUMNS, SCHEMA, metadata
from tests.docs.markdown import ROOT

FILES = sorted((ROOT / "tests" / "data" / "records").glob("schema-*.sql"))


def restored(file: Path, folder: Path) -> Path:
    """The record that a dump is of."""
    folder.mkdir(parents=True, exist_ok=True)
    with closing(sqlite3.connect(folder / "record.db")) as connection:
        connection.executescript(file.read_text())
    return folder


def version(file: Path) -> int:
    """The schema of a dump."""
    return int(file.stem.rpartition("-")[2])


def shape(path: Path) -> dict[str, set[tuple[str, str]]]:
    """The columns of every table with their types."""
    with closing(sqlite3.connect(path)) as connection:
        tables = metadata.tables
        return {name: {(row[1], row[2]) for row in connection.execute(f"PRAGMA table_info({name})")} for name in tables}


def test_every_older_version_can_be_upgraded() -> None:
    assert sorted(NEW_COLUMNS) == list(range(1, SCHEMA))
    assert [version(file) for file in FILES] == list(range(1, SCHEMA))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_an_older_record_becomes_one_of_this_version(file: Path, tmp_path: Path) -> None:
    old = restored(file, tmp_path / "old")
    with Record(old) as record:
        *imported, run = sorted(record.runs(), key=lambda run: run.state)
        assert (run.state, run.rows, run.procedure) == ("stopped", 4, "sweep")
        table = table_of(record, run.run)
        assert table.n == 4
        assert list(table.column("alpha_deg")) == [90.0] * 4
        record.exclude(run.run, [0], "touched")
        record.log(run.run, 0.0, "run", "doing", "nothing")
        record.set_state(run.run, "stopped")
        assert record.lines(run.run)[-1].text == "nothing"
        assert [(other.state, other.rows) for other in imported] == [("complete", 6)] * (version(file) > 3)
        for other in imported:
            assert list(table_of(record, other.run).column("vx_v"))[2] == 3.4998
    with Record(tmp_path / "new") as fresh:
        assert shape(old / "record.db") == shape(fresh.path)
    with closing(sqlite3.connect(old / "record.db")) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (SCHEMA,)
        assert connection.execute("PRAGMA foreign_key_check").fetchall() == []


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_table_that_is_newer_than_the_record_is_no_loss(file: Path, tmp_path: Path) -> None:
    recovered = recover(restored(file, tmp_path / "old") / "record.db", tmp_path / "new")
    assert (recovered.rows["poses"], recovered.damaged) == (4, ())
