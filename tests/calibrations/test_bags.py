"""ROS bags that the library rosbags wrote, ROS 1 and 2, are read with units; what is wrong with one is told."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from calibrations.errors import DataError
from calibrations.importing.binary import open_sheet
from calibrations.importing.foreign import import_sheet
from calibrations.importing.topics import SeveralTopics

N = 25
DIRECTIONS = np.random.default_rng(3).normal(size=(N, 3))
ACC = 9.81 * DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1)[:, None]
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
IMU, FIELD, STRING = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField", "std_msgs/msg/String"


def messages(store: Any, topic: str, row: int) -> tuple[str, Any]:
    """The type and the message of a row, by the topic's name."""
    types = store.types
    seq = {"seq": row} if store is ROS1 else {}
    stamp = types["builtin_interfaces/msg/Time"](sec=1_700_000_000, nanosec=row * 10_000_000)
    frame = ("left", "right")[row % 2] if topic == "/both" else "imu"
    header = types["std_msgs/msg/Header"](**seq, stamp=stamp, frame_id=frame)
    vector = types["geometry_msgs/msg/Vector3"]
    if topic == "/mag":
        return FIELD, types[FIELD](header, vector(*(5e-6 * ACC[row])), np.zeros(9))
    if topic == "/words":
        return STRING, types[STRING]("hello")
    absent = np.array([-1.0] + 8 * [0.0])
    rest = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    rate = vector(0.0, 0.0, 0.0)
    return IMU, types[IMU](header, rest, absent, rate, absent, vector(*ACC[row]), np.zeros(9))


def write(folder: Path, storage: str, *topics: str) -> Path:
    """A bag with these topics: the path to import."""
    if storage == "ros1":
        path, store, writer = folder / "log.bag", ROS1, Writer1(folder / "log.bag")
    else:
        plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[storage]
        path, store, writer = folder / "log", ROS2, Writer2(folder / "log", version=9, storage_plugin=plugin)
    with writer:
        for topic in topics:
            kind, _ = messages(store, topic, 0)
            connection = writer.add_connection(topic, kind, typestore=store)
            serialize = store.serialize_ros1 if store is ROS1 else store.serialize_cdr
            for row in range(N):
                writer.write(connection, 10**18 + row, serialize(messages(store, topic, row)[1], kind))
    return path


def test_a_length_beyond_memory_is_damage(tmp_path: Path) -> None:
    """The length of MCAP's header record, after the mark of 8 bytes and the record's kind."""
    (path,) = write(tmp_path, "mcap", "/imu").glob("*.mcap")
    whole = bytearray(path.read_bytes())
    whole[9:17] = b"\xff" * 7 + b"\x3f"
    path.write_bytes(whole)
    with pytest.raises(DataError, match="is damaged or cut short"):
        open_sheet(path)


@pytest.mark.parametrize("storage", ["ros1", "sqlite3", "mcap"])
def test_an_imu_is_read_with_its_units_and_the_time_of_its_header(storage: str, tmp_path: Path) -> None:
    path = write(tmp_path, storage, "/words", "/imu", "/mag")
    inside = [path] if storage == "ros1" else [path, *path.glob("*.db3"), *path.glob("*.mcap")]
    for each in inside:
        sheet = open_sheet(each)
        assert sheet.topic == "/imu"
        assert "--topic: /words, /mag" in sheet.notes[0]
        table = import_sheet(sheet, None).table
        assert (table.kind, table.unit) == ("positions", "m/s2")
        np.testing.assert_array_equal(table.outputs, ACC)
        np.testing.assert_allclose(table.time_s, 0.01 * np.arange(N), atol=1e-12)
        assert not {"gx", "gy", "gz"} & set(table.columns)  # its covariance says that it is not measured
        field = import_sheet(open_sheet(each, "/mag"), None).table
        assert (field.content, field.unit) == ("fields", "uT")
        np.testing.assert_allclose(field.outputs, 5 * ACC)
        with pytest.raises(DataError, match="topic /words: holds std_msgs/msg/String; only sensor_msgs/msg/Imu"):
            open_sheet(each, "/words")
        with pytest.raises(DataError, match='no topic "/imo"; did you mean "/imu"'):
            open_sheet(each, "/imo")


def test_two_imus_have_to_be_chosen_and_a_mixed_topic_is_refused(golden, tmp_path: Path) -> None:
    path = write(tmp_path, "ros1", "/imu", "/both")
    with golden.refused(SeveralTopics):
        open_sheet(path)
    with golden.refused(DataError):
        open_sheet(path, "/both")


@pytest.mark.parametrize("storage", ["ros1", "sqlite3", "mcap"])
@pytest.mark.parametrize("share", [0.2, 0.7])
def test_a_cut_bag_is_refused_with_a_remedy(storage: str, share: float, tmp_path: Path) -> None:
    path = write(tmp_path, storage, "/imu")
    file = path if path.is_file() else next(iter([*path.glob("*.db3"), *path.glob("*.mcap")]))
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    with pytest.raises(DataError, match=r"log.*copy (it|the bag) again"):
        open_sheet(file)


def test_a_bag_without_its_schema_or_under_another_name_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "ros1", "/imu")
    bare = path.with_name("bare.bag")
    bare.write_bytes(path.read_bytes().replace(b"angular_velocity", b"angular_velocitx"))
    with pytest.raises(DataError, match=r"bare\.bag: the bag cannot be read .*its message definitions do not fit"):
        open_sheet(bare)
    other = path.rename(path.with_name("log.data"))
    with pytest.raises(DataError, match=r"is a ROS bag; rename it so that its name ends with \.bag"):
        open_sheet(other)
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="Is a directory; name a file in it"):
        open_sheet(tmp_path / "empty")


def test_a_ros_2_bag_without_its_metadata_is_refused_with_a_remedy(golden, tmp_path: Path) -> None:
    folder = tmp_path / "unfinished"
    folder.mkdir()
    (folder / "unfinished_0.db3").write_bytes(b"SQLite format 3\0")
    with golden.refused(DataError):
        open_sheet(folder)


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, "ros1", "/imu")
    for each in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, each)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(DataError, match=r"the library rosbags .*\n\n +pip install 'inertial-rig\[robotics\]'"):
        open_sheet(path)
