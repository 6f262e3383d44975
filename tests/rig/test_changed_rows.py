"""Rows that changed on the disk: each is named and refused, the others stay readable, and recovery reaches them."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from procedures.session import Pose, Reading
from rig.errors import RecordError
from rig.record import KeptPose, Record
from rig.record.measured import table_of
from rig.record.recover import is_sound, recover
from tests.rig.conftest import Rig
from tests.rig.test_doctor import PAGE, recorded
from tests.rig.test_store import begin, block


def change(record: Path, statement: str, *values: object, schema: bool = False) -> None:
    with closing(sqlite3.connect(record / "record.db")) as connection, connection:
        connection.execute(f"PRAGMA writable_schema = {'ON' if schema else 'OFF'}")
        assert connection.execute(statement, values).rowcount == 1


def flip(folder: Path, column: str, run: str, at: int = 4) -> None:
    """One bit of a run's document: the text is no JSON, or no text, any more."""
    with closing(sqlite3.connect(folder / "record.db")) as connection, connection:
        (text,) = connection.execute(f"SELECT {column} FROM runs WHERE run = ?", (run,)).fetchone()  # noqa: S608
        data = bytearray(text.encode())
        data[at] ^= 0x80
        connection.execute(f"UPDATE runs SET {column} = CAST(? AS TEXT) WHERE run = ?", (bytes(data), run))  # noqa: S608


def hide(folder: Path, table: str, which: str) -> None:
    """Remove a row from the index of the table's key, and leave the row itself: as a changed bit in the index does."""
    path, other = folder / "record.db", folder / "other.db"
    shutil.copyfile(path, other)
    with closing(sqlite3.connect(other)) as connection, connection:
        connection.execute(f"DELETE FROM {table} WHERE {which}")  # noqa: S608
        name = f"sqlite_autoindex_{table}_1"
        (root,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = ?", (name,)).fetchone()
    with closing(sqlite3.connect(other)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    page = slice((root - 1) * PAGE, root * PAGE)
    data = bytearray(path.read_bytes())
    data[page] = other.read_bytes()[page]
    path.write_bytes(data)


def two_runs(folder: Path) -> tuple[str, str]:
    return recorded(folder, 3), recorded(folder, 3)


def repeat_poses(folder: Path, times: int) -> None:
    """So many more poses in every run, which fill pages of their own."""
    with closing(sqlite3.connect(folder / "record.db")) as connection, connection:
        names = [row[1] for row in connection.execute("PRAGMA table_info(poses)") if row[1] != "number"]
        for k in range(times):
            connection.execute(
                f"INSERT INTO poses (number, {', '.join(names)}) "  # noqa: S608
                f"SELECT number + {3 * (k + 1)}, {', '.join(names)} FROM poses WHERE number < 3"
            )


def damage_page(folder: Path, bad: str, good: str) -> None:
    """Change one bit of a page with rows of the one run only, such that SQLite cannot read it."""
    path = folder / "record.db"
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    whole = path.read_bytes()

    def counts(run: str) -> bool:
        try:
            with closing(sqlite3.connect(path)) as connection:
                return bool(connection.execute("SELECT count(*) FROM poses WHERE run = ?", (run,)).fetchone())
        except sqlite3.DatabaseError:
            return False

    for place in range(PAGE, len(whole), PAGE):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x80]) + whole[place + 1 :])
        if counts(good) and not counts(bad):
            return
    raise AssertionError("no page belongs to one run alone")


def test_a_damaged_page_hides_no_other_run(rig: Rig, rig_home: Path) -> None:
    bad, good = two_runs(rig_home)
    repeat_poses(rig_home, 200)
    damage_page(rig_home, bad, good)
    ended = rig("runs")
    assert (ended.status, good in ended.out) == (0, True), ended
    assert f"run {bad}: its table of poses is damaged; `rig doctor --recover" in ended.out + ended.err
    assert rig("show", good).status == 0


def test_one_damaged_run_is_named_and_hides_no_other(rig: Rig, rig_home: Path, tmp_path: Path) -> None:
    bad, good = two_runs(rig_home)
    flip(rig_home, "constants", bad)
    listed = rig("runs")
    assert (listed.status, good in listed.out, bad in listed.out) == (0, True, False)
    assert f"run {bad}: its entry is damaged" in listed.err
    with Record() as record, pytest.raises(RecordError, match=f"run {bad}: its entry is damaged"):
        record.run(bad)
    checked = rig("doctor", "--out", str(tmp_path / "doctor.zip"))
    assert (checked.status, f"WRONG  damaged: run {bad}" in checked.out) == (1, True)
    ended = rig("doctor", "--recover", str(tmp_path / "new"))
    assert (ended.status, f"run {bad}: constants" in ended.out) == (1, True)
    with Record(tmp_path / "new") as record:
        assert [run.run for run in record.runs()] == [good, bad]
        assert record.run(bad).constants == {}
        assert table_of(record, bad).n == table_of(record, good).n == 3


def test_a_number_that_changed_in_a_document_is_noticed(tmp_path: Path) -> None:
    run = recorded(tmp_path, 1)
    change(tmp_path, "UPDATE runs SET settings = '{\"step_deg\": 18.0}'")
    with Record(tmp_path) as record:
        assert (record.runs(), len(record.damaged_runs())) == ([], 1)
        with pytest.raises(RecordError, match="entry is damaged"):
            record.run(run)


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE poses SET beta_deg = 65.0 WHERE number = 1",
        "UPDATE blocks SET rate_hz = 1001.0 WHERE number = 1",
        "UPDATE blocks SET start_s = 2.0 WHERE number = 1",
        "UPDATE poses SET up = 'y', checksum = NULL WHERE number = 1",
    ],
)
def test_a_changed_pose_is_named_until_it_is_excluded(tmp_path: Path, statement: str) -> None:
    run = recorded(tmp_path, 3)
    change(tmp_path, statement)
    with Record(tmp_path) as record:
        with pytest.raises(RecordError, match="pose 1: its values changed on the disk"):
            table_of(record, run)
        assert len(record.damaged_rows()) == 1
        record.exclude(run, [1], "damaged")
        assert list(table_of(record, run).column("beta_deg")) == [0, 2]
    done = recover(tmp_path / "record.db", tmp_path / "new")
    assert "1" in done.changed[0]
    with Record(tmp_path / "new") as record:
        assert record.poses(run) == [Pose(90, 0), Pose(90, 2)]


def test_poses_keep_their_numbers_after_a_damaged_one(rig: Rig, rig_home: Path) -> None:
    run = recorded(rig_home, 3)
    change(rig_home, "UPDATE blocks SET rate_hz = 1001.0 WHERE number = 1")
    with Record() as record:
        record.exclude(run, [1], "damaged")
    listed = rig("show", run, "--poses", "--json").document["kept"]
    assert [(pose["pose"], pose["beta_deg"]) for pose in listed] == [(0, 0), (2, 2)]
    assert rig("exclude", run, str(listed[-1]["pose"]), "--reason", "touched").status == 0
    (first,) = [pose for pose in rig("show", run, "--poses", "--json").document["kept"] if pose["excluded"] is None]
    assert first["beta_deg"] == 0


def test_changed_means_readings_and_columns_are_noticed(golden, tmp_path: Path) -> None:
    run = recorded(tmp_path, 1)
    change(tmp_path, "UPDATE dwells SET n = 399")
    change(tmp_path, "UPDATE readings SET value = 0.03")
    with Record(tmp_path) as record:
        for read in (record.dwells, record.readings):
            with golden.refused(RecordError):
                read(run)


def test_rows_of_an_older_program_have_no_checksum_and_are_read(tmp_path: Path) -> None:
    run = recorded(tmp_path, 2)
    with closing(sqlite3.connect(tmp_path / "record.db")) as connection, connection:
        for table in ("runs", "poses", "blocks", "dwells", "readings"):
            connection.execute(f"UPDATE {table} SET checksum = NULL")  # noqa: S608
    with Record(tmp_path) as record:
        assert (record.run(run).rows, len(record.dwells(run)), len(record.readings(run))) == (2, 2, 1)
        assert (record.damaged_runs(), record.damaged_rows(), table_of(record, run).n) == ([], [], 2)


def test_odd_numbers_keep_their_checksum(tmp_path: Path) -> None:
    with Record(tmp_path) as record:
        run = begin(record)
        record.keep(run, 0, KeptPose(Pose(90, -0.0, 1, "\u00e9\x00", 1, 1), block([[2.0, 1.0]]), 3, float("nan")), None)
        record.keep_readings(run, [Reading("a", 1, "m", None)], None)
        assert (len(list(record.kept(run))), len(record.readings(run)), record.damaged_rows()) == (1, 1, [])


def test_a_record_that_lost_its_end_is_recovered(tmp_path: Path) -> None:
    run = recorded(tmp_path / "old", 54)
    path = tmp_path / "old" / "record.db"
    path.write_bytes(path.read_bytes()[:-PAGE])
    assert recover(path, tmp_path / "new").rows["poses"] > 50
    with Record(tmp_path / "new") as record:
        assert len(list(record.kept(run))) > 50
    assert sorted(file.name for file in (tmp_path / "new").iterdir()) == ["record.db"]


def test_a_failed_recovery_does_not_block_the_next(tmp_path: Path) -> None:
    recorded(tmp_path / "old", 1)
    (tmp_path / "letters").write_text("no database" * 1000)
    with pytest.raises(RecordError, match="no row is readable"):
        recover(tmp_path / "letters", tmp_path / "new")
    assert recover(tmp_path / "old" / "record.db", tmp_path / "new").rows["poses"] == 1


def test_poses_without_the_entry_of_their_run_are_in_reach(tmp_path: Path) -> None:
    run = recorded(tmp_path / "old", 2)
    with Record(tmp_path / "old") as record:
        procedure = record.run(run).procedure
    change(tmp_path / "old", "DELETE FROM runs")
    shutil.rmtree(tmp_path / "new", ignore_errors=True)
    assert recover(tmp_path / "old" / "record.db", tmp_path / "new").changed
    with Record(tmp_path / "new") as record:
        assert (record.run(run).state, record.run(run).procedure) == ("failed", procedure)
        assert table_of(record, run).n == 2


@pytest.mark.parametrize("table", ["poses", "blocks"])
def test_a_row_that_an_index_hides_is_named(tmp_path: Path, table: str) -> None:
    run = recorded(tmp_path, 4)
    hide(tmp_path, table, "number = 2")
    with Record(tmp_path) as record:
        for read in (lambda: list(record.kept(run)), lambda: record.dwells(run), lambda: table_of(record, run)):
            with pytest.raises(RecordError, match=f"run {run}, pose 2: a part of it is lost on the disk"):
                read()
        assert record.damaged_rows() == [f"run {run}, pose 2: a part of it is lost on the disk"]
    recover(tmp_path / "record.db", tmp_path / "new")
    with Record(tmp_path / "new") as record:
        assert [kept.number for kept in record.kept(run)] == [0, 1, 2, 3], "the row itself is sound"


def test_readings_and_columns_that_an_index_hides_are_named(tmp_path: Path) -> None:
    run = recorded(tmp_path, 1)
    with Record(tmp_path) as record:
        whole = table_of(record, run)
        imported = record.add_table(whole)
    hide(tmp_path, "readings", "1")
    hide(tmp_path, "columns", "name = 'vx_v'")
    with Record(tmp_path) as record:
        with pytest.raises(RecordError, match="a row of its readings is lost"):
            record.readings(run)
        with pytest.raises(RecordError, match="a row of its columns is lost"):
            record.columns(imported)
    recover(tmp_path / "record.db", tmp_path / "new")
    with Record(tmp_path / "new") as record:
        assert table_of(record, imported).digest == whole.digest
        assert len(record.readings(run)) == 1


def test_samples_whose_pose_is_lost_are_not_recovered(tmp_path: Path) -> None:
    run = recorded(tmp_path, 3)
    change(tmp_path, "DELETE FROM poses WHERE number = 1")
    recover(tmp_path / "record.db", tmp_path / "new")
    with Record(tmp_path / "new") as record:
        assert [kept.number for kept in record.kept(run)] == [0, 2]
        assert record.damaged_rows() == []


def recorded_file(folder: Path) -> tuple[int, str, Path, bytes]:
    """A run of three poses: its number, the digest of its table, and the file of the record with its bytes."""
    run = recorded(folder, 3)
    with Record(folder) as record:
        whole = table_of(record, run).digest
    path = folder / "record.db"
    return run, whole, path, path.read_bytes()


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        (b"CREATE TABLE poses", b"CREATE TABLE poqes"),
        (b"poses", b"poqes"),
        (b"alpha_deg FLOAT", b"alpha_dfg FLOAT"),
        (b"sqlite_autoindex_runs_1", b"sqlite_autoindey_runs_1"),
    ],
)
def test_a_damaged_schema_loses_no_row(tmp_path: Path, right: bytes, wrong: bytes) -> None:
    run, whole, path, data = recorded_file(tmp_path)
    assert right in data[:PAGE]
    path.write_bytes(data[:PAGE].replace(right, wrong, 1) + data[PAGE:])
    assert not recover(path, tmp_path / "new").changed
    with Record(tmp_path / "new") as record:
        assert table_of(record, run).digest == whole


PLACES: dict[str, Callable[[bytes], int]] = {  # of one changed bit in the first page
    "the kind of the page": lambda _: 100,
    "the list of its entries": lambda _: 108 + 2 * 5,
    "the length of an entry": lambda page: page.index(b"tableposesposes") - 6,
    "the number of pages in the file": lambda _: 31,
    "the bytes of a page": lambda _: 16,
}


def with_bit(data: bytes, at: int, bit: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("bit", [0, 4])
def test_one_changed_bit_outside_the_texts_of_the_schema_loses_no_row(tmp_path: Path, place: str, bit: int) -> None:
    run, whole, path, data = recorded_file(tmp_path)
    path.write_bytes(with_bit(data, PLACES[place](data[:PAGE]), bit))
    recovered = recover(path, tmp_path / "new")
    assert (recovered.damaged, recovered.changed, recovered.spoilt) == ((), (), ())
    with Record(tmp_path / "new") as record:
        assert table_of(record, run).digest == whole


def test_rows_of_a_table_whose_place_is_lost_are_reported(tmp_path: Path) -> None:
    run = recorded(tmp_path, 3)
    path = tmp_path / "record.db"
    data = path.read_bytes()
    path.write_bytes(with_bit(data, data.index(b"readingsreadings") + 16, 6))
    assert recover(path, tmp_path / "new").damaged == ("readings",)
    with Record(tmp_path / "new") as record:
        assert (table_of(record, run).n, record.readings(run)) == (3, [])


def test_rows_in_the_log_of_a_file_with_a_damaged_schema_are_recovered(tmp_path: Path) -> None:
    run = recorded(tmp_path / "old", 3)
    path = tmp_path / "old" / "record.db"
    with closing(sqlite3.connect(path)) as open_file:
        open_file.execute("PRAGMA wal_autocheckpoint = 0")
        open_file.execute("UPDATE runs SET state = 'stopped', message = 'in the log'")
        open_file.commit()
        shutil.copytree(path.parent, tmp_path / "crashed")
    assert (tmp_path / "crashed" / "record.db-wal").stat().st_size
    crashed = tmp_path / "crashed" / "record.db"
    crashed.write_bytes(with_bit(crashed.read_bytes(), 100, 3))
    recover(crashed, tmp_path / "new")
    with Record(tmp_path / "new") as record:
        assert (record.run(run).message, table_of(record, run).n) == ("in the log", 3)


def test_a_sound_schema_stays_as_it_is(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "new" / "folder"
    run = recorded(folder, 1)
    path = folder / "record.db"
    assert is_sound(path)
    with Record(folder) as record:
        assert record.run(run).rows == 1
    change(folder, "UPDATE sqlite_master SET name = 'poqes' WHERE name = 'poses'", schema=True)
    assert not is_sound(path)
