"""ROS bags as topics, by rosbags: ROS 1, and ROS 2 in SQLite or MCAP.

sensor_msgs/Imu and sensor_msgs/MagneticField have fixed units: m/s2, rad/s, tesla. The time is that of the header,
which the driver sets; the time in the bag is when the recorder got the message.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calibrations.errors import DataError
from calibrations.importing.topics import Cells, Topic, library, require_size
from calibrations.table import Array

IMU = "sensor_msgs/msg/Imu"
FIELD = "sensor_msgs/msg/MagneticField"
TIME = "t_s"
VECTORS = {  # of a message: the member, our columns, and the covariance, which shows whether it is measured
    IMU: (
        ("linear_acceleration", ("ax (m/s2)", "ay (m/s2)", "az (m/s2)"), "linear_acceleration_covariance"),
        ("angular_velocity", ("gx (rad/s)", "gy (rad/s)", "gz (rad/s)"), "angular_velocity_covariance"),
    ),
    FIELD: (("magnetic_field", ("mx (tesla)", "my (tesla)", "mz (tesla)"), "magnetic_field_covariance"),),
}
SUFFIXES = {b"#ROSBAG V2.0": (".bag",), b"\x89MCAP0\r\n": (".mcap",), b"SQLite format 3\0": (".db3",)}


def bag_topics(path: Path) -> list[Topic]:
    """The topics of a bag, a file or a folder with metadata.yaml. Raises DataError."""
    anyreader = library("rosbags.highlevel", "robotics", path, "a ROS bag")
    if path.is_file():
        require_size(path, path.stat().st_size)
        _require_suffix(path)
    try:
        with _open(anyreader, path) as reader:
            names = list(dict.fromkeys(connection.topic for connection in reader.connections))
            by_name = {name: [c for c in reader.connections if c.topic == name] for name in names}
            return [_topic(anyreader, path, name, connections) for name, connections in by_name.items()]
    except anyreader.AnyReaderError as error:
        raise _bag_error(path, error) from None


def _require_suffix(path: Path) -> None:
    """Raises DataError for a name by which rosbags does not know the format."""
    with path.open("rb") as file:
        head = file.read(16)
    endings = next(suffixes for mark, suffixes in SUFFIXES.items() if head.startswith(mark))
    if path.suffix not in endings:
        raise DataError(f"{path}: is a ROS bag; rename it so that its name ends with {endings[0]}")


def _open(anyreader: Any, path: Path) -> Any:
    from rosbags.typesys import Stores, get_typestore

    return anyreader.AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))


def _bag_error(path: Path, error: Exception) -> DataError:
    reason = " ".join(str(error).split())[:200]
    if "mismatch" in reason or "definition" in reason:
        remedy = "its message definitions do not fit its messages; record the bag again with the sensor's own messages"
    else:
        remedy = "copy the bag again; `rosbag reindex` (ROS 1), `ros2 bag reindex` or `mcap recover` repair a cut one"
    return DataError(f"{path}: the bag cannot be read ({reason}); {remedy}")


def _topic(anyreader: Any, path: Path, name: str, connections: Sequence[Any]) -> Topic:
    kinds = sorted({connection.msgtype for connection in connections})
    rows = sum(connection.msgcount for connection in connections)
    if len(kinds) > 1 or kinds[0] not in VECTORS:
        refusal = (
            f"holds {' and '.join(kinds)}; only {IMU} and {FIELD} can be imported. "
            "Publish the measurements as one of them, or save the topic as CSV"
        )
        return Topic(name, (), rows, refusal=refusal, sensor="")
    vectors = VECTORS[kinds[0]]
    header = (TIME, *(column for _, columns, _ in vectors for column in columns))
    sensor = "a" if kinds[0] == IMU else "m"
    return Topic(name, header, rows, lambda: _cells(anyreader, path, name, kinds[0]), sensor=sensor)


def _cells(anyreader: Any, path: Path, name: str, kind: str) -> Cells:
    """The columns of a topic. A vector whose covariance begins with -1 is not measured, and left out.

    Raises DataError for a message without its definition, a cut bag, and messages of several sensors.
    """
    stamps, values = array("q"), [array("d") for _ in VECTORS[kind]]
    unmeasured, frames = set[int](), set[str]()
    try:
        with _open(anyreader, path) as reader:
            connections = [c for c in reader.connections if c.topic == name]
            for connection, received_ns, raw in reader.messages(connections=connections):
                message = reader.deserialize(raw, connection.msgtype)
                stamp_ns = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
                stamps.append(stamp_ns or received_ns)
                frames.add(message.header.frame_id)
                for k, (member, _, covariance) in enumerate(VECTORS[kind]):
                    vector = getattr(message, member)
                    values[k].extend((vector.x, vector.y, vector.z))
                    if getattr(message, covariance)[0] == -1:
                        unmeasured.add(k)
    except (anyreader.AnyReaderError, KeyError, AttributeError) as error:
        raise _bag_error(path, error) from None
    if len(frames) > 1:
        raise DataError(
            f"{path}, topic {name}: has messages of {len(frames)} sensors (frame_id {', '.join(sorted(frames))}); "
            "record each sensor as a topic of its own"
        )
    times = np.frombuffer(stamps, dtype=np.int64)
    cells: dict[str, Array] = {TIME: np.asarray((times - times[:1]) * 1e-9, dtype=np.float64)}
    for k, (_, columns, _) in enumerate(VECTORS[kind]):
        if k not in unmeasured:
            cells |= dict(zip(columns, np.frombuffer(values[k]).reshape(-1, 3).T.copy(), strict=True))
    return cells
