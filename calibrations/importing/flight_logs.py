"""Flight logs as topics: PX4 ULog by pyulog, ArduPilot DataFlash by pymavlink.

Messages of inertial sensors and magnetometers have our columns with the units of the firmware; each instance of a
sensor is a topic.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
from array import array
from collections.abc import Iterator, Mapping
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np

from calibrations.errors import DataError
from calibrations.importing.topics import Cells, Topic, library, require_size
from calibrations.table import Constant

# of a ULog message: its fields as our columns with their units
ULOG_FIELDS: Mapping[str, Mapping[str, str]] = {
    "sensor_accel": {"x": "ax (m/s2)", "y": "ay (m/s2)", "z": "az (m/s2)", "temperature": "temperature_c"},
    "sensor_gyro": {"x": "gx (rad/s)", "y": "gy (rad/s)", "z": "gz (rad/s)", "temperature": "temperature_c"},
    "sensor_mag": {"x": "mx (gauss)", "y": "my (gauss)", "z": "mz (gauss)", "temperature": "temperature_c"},
    "sensor_combined": {
        **{f"accelerometer_m_s2[{k}]": f"a{axis} (m/s2)" for k, axis in enumerate("xyz")},
        **{f"gyro_rad[{k}]": f"g{axis} (rad/s)" for k, axis in enumerate("xyz")},
    },
    "vehicle_acceleration": {f"xyz[{k}]": f"a{axis} (m/s2)" for k, axis in enumerate("xyz")},
    "vehicle_angular_velocity": {f"xyz[{k}]": f"g{axis} (rad/s)" for k, axis in enumerate("xyz")},
    "vehicle_magnetometer": {f"magnetometer_ga[{k}]": f"m{axis} (gauss)" for k, axis in enumerate("xyz")},
}
RAW = {"sensor_accel": "a", "sensor_gyro": "g", "sensor_mag": "m"}  # before the autopilot's correction
ULOG_HEADER_BYTES = 16
BLOCK_BYTES = 1 << 20  # of a log in memory at once, while its records are walked
STANDARD_ERROR = 2  # its file descriptor
CORRECTION_NOTE = "values after the autopilot's own correction: the fit finds the error that it left"


def ulog_topics(path: Path) -> list[Topic]:
    """The messages of a PX4 log, raw sensors first. Raises DataError."""
    core = library("pyulog.core", "robotics", path, "a PX4 ULog")
    require_size(path, path.stat().st_size)
    with _quiet(), path.open("rb") as file:  # the library leaves a damaged log open
        log = core.ULog(file)
    if not log.data_list:
        raise DataError(f"{path}: has no data: it is cut or damaged near its start; copy it again from the vehicle")
    remarks = list(_ulog_remarks(path, log))
    several = {d.name for d in log.data_list if d.multi_id > 0}
    topics = [_ulog_topic(data, data.name in several, tuple(remarks)) for data in log.data_list]
    return sorted(topics, key=lambda t: (t.rank, t.name))


def _ulog_topic(data: Any, is_one_of_several: bool, remarks: tuple[str, ...]) -> Topic:
    name = f"{data.name}[{data.multi_id}]" if is_one_of_several else data.name
    rows = len(data.data["timestamp"])
    fields = {k: v for k, v in ULOG_FIELDS.get(data.name, {}).items() if k in data.data}
    stamp = "timestamp_sample" if np.any(data.data.get("timestamp_sample", 0)) else "timestamp"
    renamed = {stamp: "t_s (us)", **(fields or {k: k for k in data.data if k not in ("timestamp", "timestamp_sample")})}
    ids = [int(v) for v in np.unique(data.data.get("device_id", np.zeros(1)))]
    refusal = ""
    if fields and len(ids) > 1:
        refusal = (
            f"has samples of {len(ids)} sensors (device_id {', '.join(map(str, ids))}); "
            "record a log with one sensor in this topic"
        )

    def cells() -> Cells:
        return {column: np.asarray(data.data[field], dtype=np.float64) for field, column in renamed.items()}

    notes = remarks if data.name in RAW or not fields else (*remarks, f"{name}: {CORRECTION_NOTE}")
    constants: dict[str, Constant] = {"device_id": float(ids[0])} if fields and ids[0] else {}
    sensor = next((s for s in "amg" if any(v.startswith(f"{s}x ") for v in fields.values())), "")
    return Topic(name, tuple(renamed.values()), rows, cells, None, constants, notes, refusal, sensor)


def _ulog_remarks(path: Path, log: Any) -> list[str]:
    remarks = []
    if log.file_corruption:
        remarks.append(f"{path}: some records are damaged and were skipped; check the times for gaps, or copy it again")
    elif (cut_at := _cut_at(path)) is not None:
        remarks.append(f"{path}: ends inside a record, at byte {cut_at}; the complete records before it are used")
    if log.dropouts:
        lost_s = sum(dropout.duration for dropout in log.dropouts) / 1000
        remarks.append(f"{path}: the logger lost {lost_s:.3g} s of data in {len(log.dropouts)} dropouts")
    return remarks


def _cut_at(path: Path) -> int | None:
    """The byte where an incomplete last record begins, None for a complete file."""
    size, place = path.stat().st_size, ULOG_HEADER_BYTES
    with path.open("rb") as file:
        while place + 3 <= size:
            file.seek(place)
            begin, block = place, file.read(BLOCK_BYTES)
            last = begin + len(block) - 3
            while place <= last:
                following = place + 3 + block[place - begin] + 256 * block[place - begin + 1]
                if following > size:
                    return place
                place = following
    return place if place < size else None


# ArduPilot: messages and their fields as our columns; the unit of AccX is m/s2, of GyrX rad/s, of MagX mgauss.

DATAFLASH_FIELDS: Mapping[str, str] = {
    **{f"Acc{axis.upper()}": f"a{axis} (m/s2)" for axis in "xyz"},
    **{f"Gyr{axis.upper()}": f"g{axis} (rad/s)" for axis in "xyz"},
    **{f"Mag{axis.upper()}": f"m{axis} (mgauss)" for axis in "xyz"},
    "T": "temperature_c",
}
DATAFLASH_MESSAGES = re.compile(r"(ACC|GYR|IMU|MAG)\d?$")
# a format (FMT) of records that are shorter than their own head of 3 bytes: its type, length, and 20 letters or zeros
TOO_SHORT = re.compile(rb"\xa3\x95\x80[\s\S][\x00-\x02][\x00\x20-\x7e]{20}")
CORRECTIONS = re.compile(r"(INS\d?_(ACC|GYR)\w*(OFFS|SCAL)|COMPASS_(OFS|DIA|ODI|MOT))\w*$")


def dataflash_topics(path: Path) -> list[Topic]:
    """The messages of an ArduPilot log; those of inertial sensors by instance. Raises DataError."""
    reader = library("pymavlink.DFReader", "robotics", path, "an ArduPilot DataFlash log")
    require_size(path, path.stat().st_size)
    _require_lengths(path)
    with _quiet():
        log = reader.DFReader_binary(str(path))
        try:
            return _dataflash_topics(path, log)
        finally:
            log.close()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Discard what the libraries print. Compiled parts of pymavlink write to the file descriptor, a line for a byte."""
    with (
        contextlib.redirect_stderr(io.StringIO()),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.ExitStack() as stack,
    ):
        with contextlib.suppress(OSError):  # a program that has no standard error
            usual = os.dup(STANDARD_ERROR)
            stack.callback(os.close, usual)
            stack.callback(os.dup2, usual, STANDARD_ERROR)
            with Path(os.devnull).open("wb") as nothing:
                os.dup2(nothing.fileno(), STANDARD_ERROR)
        yield


def _require_lengths(path: Path) -> None:
    """Raises DataError for records of less than 3 bytes: pymavlink would read the same bytes for ever."""
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        match = TOO_SHORT.search(content)
        format_place = None if match is None else (match.start(), match[0][4])
    if format_place is not None:
        raise DataError(
            f"{path}: is damaged: the format at byte {format_place[0]} has records of {format_place[1]} bytes, "
            "which cannot be; copy it again from the vehicle"
        )


def _dataflash_topics(path: Path, log: Any) -> list[Topic]:
    names = [name for name, number in log.name_to_id.items() if log.counts[number]]
    message_names = [name for name in names if DATAFLASH_MESSAGES.match(name)]
    columns: dict[str, dict[str, array[float]]] = {}
    corrections: dict[str, float] = {}
    while (message := log.recv_match(type=[*message_names, "PARM"])) is not None:
        fields = message.to_dict()
        kind = fields.pop("mavpackettype")
        if kind == "PARM":
            if CORRECTIONS.match(str(fields.get("Name"))):
                corrections[str(fields["Name"])] = float(fields["Value"])
            continue
        name = f"{kind}[{fields['I']}]" if "I" in fields else kind
        topic_columns = columns.setdefault(name, {})
        clock = fields.get("SampleUS") or fields.get("TimeUS") or 1000 * fields.get("TimeMS", 0)
        topic_columns.setdefault("t_s (us)", array("d")).append(clock)
        for field, column in DATAFLASH_FIELDS.items():
            if field in fields:
                topic_columns.setdefault(column, array("d")).append(fields[field])
    remarks = _dataflash_remarks(path, log)
    topics = [_dataflash_topic(name, cells, corrections, remarks) for name, cells in columns.items()]
    refusal = "has no accelerometer, gyroscope or magnetometer; choose ACC, GYR, IMU or MAG"
    unread = [
        name for name in names if name not in message_names and name not in ("FMT", "FMTU", "UNIT", "MULT", "PARM")
    ]
    return topics + [Topic(n, (), log.counts[log.name_to_id[n]], refusal=refusal, sensor="") for n in unread]


def _dataflash_remarks(path: Path, log: Any) -> list[str]:
    """The bytes between records that belong to none, and a cut last record; pymavlink skips both without a word."""
    kinds = [k for k, offsets in enumerate(log.offsets) if len(offsets) and k in log.formats]
    first = np.concatenate([np.asarray(log.offsets[k], dtype=np.int64) for k in kinds])
    ends = first + np.repeat([log.formats[k].len for k in kinds], [len(log.offsets[k]) for k in kinds])
    order = np.argsort(first)
    first, ends = first[order], ends[order]
    holes = np.flatnonzero(first[1:] > ends[:-1])
    remarks = []
    if len(holes):
        skipped, place = int((first[1:] - ends[:-1])[holes].sum()), int(ends[holes[0]])
        remarks.append(f"{path}: {skipped} bytes are no record and were skipped, the first at {place}; copy it again")
    if ends[-1] > path.stat().st_size:
        remarks.append(f"{path}: ends inside a record, at byte {first[-1]}; the complete records before it are used")
    return remarks


def _dataflash_topic(
    name: str, columns: Mapping[str, array[float]], corrections: Mapping[str, float], remarks: list[str]
) -> Topic:
    cells = {column: np.frombuffer(values, dtype=np.float64) for column, values in columns.items()}
    if "temperature_c" in cells and not np.any(cells["temperature_c"]):
        del cells["temperature_c"]  # not measured
    sensor = next((s for s in "amg" if any(k.startswith(f"{s}x ") for k in cells)), "")
    prefixes = {"a": "INS", "g": "INS", "m": "COMPASS"}
    kinds = {"a": "ACC", "g": "GYR", "m": "COMPASS"}
    applied = {k: v for k, v in corrections.items() if k.startswith(prefixes.get(sensor, "-")) and kinds[sensor] in k}
    constants: dict[str, Constant] = {**applied}
    notes = (
        *remarks,
        f"{name}: {CORRECTION_NOTE}" + (f" ({len(applied)} parameters are kept with the run)" if applied else ""),
    )
    return Topic(name, tuple(cells), len(cells["t_s (us)"]), lambda: cells, None, constants, notes, "", sensor)
