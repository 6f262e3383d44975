"""The record keeps what it was given, in order, and says clearly what it cannot do."""

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibrations.table import Table
from drivers.recorder import Samples
from procedures.session import Pose, Reading
from rig.errors import RecordError, UnknownRun
from rig.record import KeptPose, Record
from rig.record.measured import table_of
from rig.record.schema import SCHEMA

ANGLES = st.floats(-400, 400)
POSES = st.builds(
    Pose,
    ANGLES,
    ANGLES,
    st.sampled_from([-1, 0, 1]),
    st.text(max_size=8),
    st.sampled_from([0.0, 90.0]),
    st.integers(0, 1),
)


def begin(record: Record) -> str:
    parts = {"bench": {"seed": 1}, "identities": {}, "configuration": "abc", "source": "a test"}
    return record.begin("sweep", {"step_deg": 10.0}, constants={"sensor": "ADXL203"}, **parts)


def block(values: object) -> Samples:
    return Samples(np.array(values, dtype=np.float64), ("vx", "vy"), 1000.0, 2.5)


@settings(max_examples=25)
@given(st.lists(POSES, max_size=4))
def test_poses_are_read_as_they_were_written(tmp_path_factory: pytest.TempPathFactory, poses: list[Pose]) -> None:
    with Record(tmp_path_factory.mktemp("record")) as record:
        run = begin(record)
        for number, pose in enumerate(poses):
            record.keep(run, number, KeptPose(pose, block([[number, 1.0]]), 3.5, 21.5), {"number": number})
        kept = list(record.kept(run))
        assert [each.pose for each in kept] == record.poses(run) == poses
        assert [float(each.samples.volts[0, 0]) for each in kept] == list(range(len(poses)))
        assert record.state(run) == ({"number": len(poses) - 1} if poses else None)
        assert record.run(run).rows == len(poses)


def test_the_table_of_a_run_has_its_poses() -> None:
    with Record() as record:
        run = begin(record)
        samples = block([[2.0, 1.0], [4.0, 1.0], [6.0, 1.0]])
        record.keep(run, 0, KeptPose(Pose(90, 0, 1, "A+ to B-"), samples, 3.5, 21.5), None)
        record.keep(run, 1, KeptPose(Pose(90, 10, 1, "A+ to B-"), samples, 9.5, None), None)
        table = table_of(record, run)
    assert table.kind == "poses"
    assert {name: list(column) for name, column in table.columns.items()} == {
        "alpha_deg": [90, 90],
        "beta_deg": [0, 10],
        "direction": [1, 1],
        "t_s": [3.5, 9.5],
        "vx_v": [4, 4],
        "vy_v": [1, 1],
        "vx_std_v": [2, 2],
        "vy_std_v": [0, 0],
        "n": [3, 3],
    }
    assert table.labels == {"path": ("A+ to B-",) * 2}
    assert table.constants == {"sensor": "ADXL203", "sample_rate_hz": 1000.0}


def test_a_changed_mounting_is_a_column_of_the_table() -> None:
    with Record() as record:
        run = begin(record)
        record.keep(run, 0, KeptPose(Pose(90, 0, mount_deg=90.0, flip=1), block([[2.0, 1.0]]), 3.5, 21.5), None)
        table = table_of(record, run)
    assert (table.column("mount_deg")[0], table.column("flip")[0]) == (90, 1)
    assert "vx_std_v" not in table


def test_an_imported_table_is_read_again_bit_for_bit() -> None:
    columns = {"ax": [0.1, 1 / 3], "ay": [1e-300, 2.0], "az": [-0.0, 3.0]}
    table = Table.from_columns("positions", columns, {"unit": "count", "g": 9.81}, "their.csv", {"path": ("a", "b")})
    with Record() as record:
        run = record.add_table(table)
        back = table_of(record, run)
        shown = record.run(run)
    assert (back.digest, back.constants, back.labels, back.source) == (table.digest, table.constants, table.labels, run)
    assert (shown.state, shown.procedure, str(shown.rows), shown.source) == ("complete", "import", "2", "their.csv")


def test_ids_sort_by_time_and_runs_are_listed_newest_first() -> None:
    with Record() as record:
        first, second = begin(record), begin(record)
        assert [run.run for run in record.runs()] == [second, first]
        assert first.split("-")[2] == "sweep"


def test_an_unknown_run_names_the_nearest() -> None:
    with Record() as record:
        run = begin(record)
        with pytest.raises(UnknownRun, match=f"Did you mean '{run}'"):
            record.run(f"{run[:-1]}?")


def test_a_run_without_poses_is_no_table_yet(golden) -> None:
    with Record() as record, golden.refused(RecordError):
        table_of(record, begin(record))


def test_one_measurement_is_not_many() -> None:
    with Record() as record:
        run = replace(record.run(begin(record)), rows=1)
    kinds = ("poses", "positions", "turns", "still")
    assert [replace(run, kind=kind).extent for kind in kinds] == [
        "1 pose",
        "1 position",
        "1 turn or rest",
        "1 pose or block",
    ]
    assert replace(run, bench={}).extent == "1 row"
    assert replace(run, kind="turns", rows=23).extent == "23 turns and rests"


def test_events_are_listed_in_order() -> None:
    with Record() as record:
        run = begin(record)
        record.note(run, "answer mounting", "yes")
        record.note(run, "not stopped", "alpha")
        assert [(event.what, event.text) for event in record.events(run)] == [
            ("answer mounting", "yes"),
            ("not stopped", "alpha"),
        ]


def test_a_commit_is_on_the_disk_when_it_returns() -> None:
    with Record() as record, record.engine.connect() as connection:
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
        assert connection.exec_driver_sql("PRAGMA synchronous").scalar() == 2  # FULL


def test_a_record_of_a_newer_program_is_left_alone(tmp_path: Path) -> None:
    with Record(tmp_path) as record:
        path = record.path
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(RecordError, match="newer version"):
        Record(tmp_path)


def test_a_file_that_is_no_record_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "record.db").write_text("my letters, not a database" * 50)
    with pytest.raises(RecordError, match="damaged"):
        Record(tmp_path)


def test_a_folder_that_cannot_be_made_is_named(golden, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with golden.refused(RecordError):
        Record(tmp_path / "file" / "home")


def test_a_record_whose_header_asks_for_an_unknown_format_is_damaged(golden, tmp_path: Path) -> None:
    Record(tmp_path).close()
    with (tmp_path / "record.db").open("r+b") as file:
        file.seek(44)  # the number of the schema's format, which is at most 4
        file.write(b"\0\0\0\x05")
    with golden.refused(RecordError):
        Record(tmp_path)


def test_a_damaged_block_names_its_pose(golden) -> None:
    with Record() as record:
        run = begin(record)
        record.keep(run, 0, KeptPose(Pose(90, 0), block([[2.0, 1.0]]), 3.5, 21.5), None)
        with record.engine.begin() as connection:
            connection.exec_driver_sql("UPDATE blocks SET samples = x'00'")
        with golden.refused(RecordError):
            list(record.kept(run))


def test_a_record_of_the_first_version_is_brought_up_to_date(tmp_path: Path) -> None:
    with Record(tmp_path) as record:
        run = begin(record)
        record.keep(run, 0, KeptPose(Pose(90, 0), block([[2.0, 1.0]]), 3.5, 21.5), None)
    with closing(sqlite3.connect(tmp_path / "record.db")) as connection:
        for column in ("excluded", "alpha_read_deg", "beta_read_deg", "up", "rate_deg_s"):
            connection.execute(f"ALTER TABLE poses DROP COLUMN {column}")
        connection.execute("ALTER TABLE runs DROP COLUMN uid")
        for table in ("runs", "poses", "blocks", "dwells", "columns"):
            connection.execute(f"ALTER TABLE {table} DROP COLUMN checksum")
        connection.executescript("DROP TABLE readings; PRAGMA user_version = 1")
    with Record(tmp_path) as record:
        record.keep_readings(run, [Reading("level-x", 0.02, "deg", 0.001)], None)
        record.exclude(run, [0], "touched")
        assert [kept.excluded for kept in record.kept(run)] == ["touched"]
    with closing(sqlite3.connect(tmp_path / "record.db")) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (SCHEMA,)


def test_dial_readings_are_read_again_with_the_pose() -> None:
    with Record() as record:
        run = begin(record)
        kept = KeptPose(Pose(90, 0), block([[2.0, 1.0]]), 3.5, 21.5, alpha_read_deg=90.083, beta_read_deg=-0.083)
        record.keep(run, 0, kept, None)
        (found,) = record.kept(run)
        assert (found.alpha_read_deg, found.beta_read_deg, found.pose) == (90.083, -0.083, Pose(90, 0))


def test_a_reading_is_replaced_by_one_of_its_name() -> None:
    with Record() as record:
        run = begin(record)
        for value in (0.1, 0.2):
            record.keep_readings(run, [Reading("level-x", value, "deg")], {"at": value})
        assert record.readings(run) == [Reading("level-x", 0.2, "deg", None)]
        assert record.state(run) == {"at": 0.2}


def test_an_excluded_pose_stays_in_the_record_with_its_reason() -> None:
    with Record() as record:
        run = begin(record)
        for number in range(3):
            kept = KeptPose(Pose(90, 10.0 * number), block([[number, 1.0], [number, 1.0]]), number, 21.5)
            record.keep(run, number, kept, None)
        record.exclude(run, [1], "a lorry passed")
        assert [kept.excluded for kept in record.kept(run)] == [None, "a lorry passed", None]
        assert [pose.beta_deg for pose in record.poses(run)] == [0.0, 20.0]
        assert list(table_of(record, run).column("beta_deg")) == [0.0, 20.0]
        assert list(table_of(record, run).numbered(np.array([0, 1]))) == [0, 2]  # as `rig exclude` takes them
        assert record.next_number(run) == 3
        record.exclude(run, [1], None)
        assert len(record.poses(run)) == 3
        with pytest.raises(RecordError, match=f"run {run} has no pose 7"):
            record.exclude(run, [7], "nothing")


def test_means_and_scatter_come_without_the_samples() -> None:
    with Record() as record:
        run = begin(record)
        for number in range(3):
            record.keep(run, number, KeptPose(Pose(90, number), block([[2.0, 1.0], [4.0, number]]), 3.5, 21.5), None)
        record.exclude(run, [1], "touched")
        first, last = record.dwells(run)
        assert first == (0, next(record.kept(run)).dwell)
        assert last[0] == 2
        assert last[1].means == {"vx": 3.0, "vy": 1.5}
        assert record.dwells(run, after_number=0) == [last]
        with record.engine.begin() as connection:  # as a run of an older program
            connection.exec_driver_sql("DELETE FROM dwells WHERE number = 0")
        assert record.dwells(run) == [first, last]


def test_two_runs_of_one_second_do_not_share_a_name(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = iter(["aaa0", "aaa1", "bbb0"])
    monkeypatch.setattr("rig.record.rows.secrets.token_hex", lambda _: next(drawn))
    with Record() as record:
        assert begin(record) != begin(record)


def test_a_part_of_an_id_names_its_run_if_it_is_the_only_one() -> None:
    with Record() as record:
        first = begin(record)
        assert record.run(first[:-1]).run == first
        begin(record)
        with pytest.raises(UnknownRun, match=r"2 runs in .* begin with '20'.*write more of the id"):
            record.run("20")
        for odd in ("", "%", "_" * len(first)):
            with pytest.raises(UnknownRun, match="no run"):
                record.run(odd)


def test_means_of_an_older_record_come_from_its_samples() -> None:
    with Record() as record:
        run = begin(record)
        for number in range(3):
            samples = block([[number, 1.0], [number + 1.0, 3.0]])
            record.keep(run, number, KeptPose(Pose(90, number), samples, 3.5, 21.5), None)
        present = record.dwells(run)
        with record.engine.begin() as to:
            to.exec_driver_sql("DELETE FROM dwells WHERE number > 0")  # an older program wrote none
        assert record.dwells(run) == present
        assert [number for number, _ in record.dwells(run, after_number=1)] == [2]
        assert present[1][1].means == {"vx": 1.5, "vy": 2.0}
