"""ULog and DataFlash logs, written byte by byte after their specifications, are read through pyulog and pymavlink."""

from __future__ import annotations

import os
import struct
import sys
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest

from calibrations.errors import DataError
from calibrations.importing import flight_logs
from calibrations.importing.binary import open_sheet
from calibrations.importing.foreign import import_sheet
from calibrations.importing.topics import SeveralTopics
from tests.foreign_files import read_foreign

N = 30
DIRECTIONS = np.random.default_rng(2).normal(size=(N, 3))
ACC = (9.81 * DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1)[:, None]).astype(np.float32)
TIME_US = 1_000_000 + 2500 * np.arange(N)


def record(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


SENSOR = "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;float temperature;"


def ulog(*sensors: tuple[str, int, int], dropout_ms: int = 0) -> bytes:
    """A log with these sensors: message, instance, device_id."""
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), record("B", bytes(40))]
    parts += [record("F", f"{name}:{SENSOR}".encode()) for name in sorted({name for name, _, _ in sensors})]
    parts += [record("F", b"vehicle_status:uint64_t timestamp;uint8_t nav_state;")]
    everything = [*sensors, ("vehicle_status", 0, 0)]
    parts += [record("A", struct.pack("<BH", i, k) + n.encode()) for k, (n, i, _) in enumerate(everything)]
    parts += [record("O", struct.pack("<H", dropout_ms))] if dropout_ms else []
    for row, stamp in enumerate(TIME_US):
        for k, (_, instance, device) in enumerate(sensors):
            values = struct.pack("<QQI4f", stamp + 300, stamp, device, *(ACC[row] + instance), 31.5)
            parts.append(record("D", struct.pack("<H", k) + values))
        parts.append(record("D", struct.pack("<HQB", len(sensors), stamp, 3)))
    return b"".join(parts)


def test_a_ulog_gives_its_accelerometer_with_units(tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog(("sensor_accel", 0, 1310988), ("sensor_mag", 0, 7), ("sensor_gyro", 0, 8), dropout_ms=250))
    sheet = open_sheet(path)
    assert sheet.topic == "sensor_accel"
    assert "sensor_mag, sensor_gyro, vehicle_status" in sheet.notes[0]
    assert sheet.notes[1].endswith("the logger lost 0.25 s of data in 1 dropouts")
    table = import_sheet(sheet, None).table
    assert (table.kind, table.unit, table.constants["device_id"]) == ("positions", "m/s2", 1310988)
    np.testing.assert_array_equal(table.outputs, ACC)
    np.testing.assert_allclose(table.time_s, TIME_US / 1e6, rtol=1e-15)
    assert set(table.column("temperature_c")) == {31.5}
    magnetometer = import_sheet(open_sheet(path, "sensor_mag"), None).table
    assert (magnetometer.content, magnetometer.unit) == ("fields", "uT")
    np.testing.assert_allclose(magnetometer.outputs, 100.0 * ACC, rtol=1e-7)


def test_two_imus_in_a_ulog_have_to_be_chosen(tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog(("sensor_accel", 0, 5), ("sensor_accel", 1, 6)))
    with pytest.raises(SeveralTopics, match=r"--topic 'sensor_accel\[0\]'") as error:
        open_sheet(path)
    assert list(error.value.topics) == ["sensor_accel[0]", "sensor_accel[1]", "vehicle_status"]
    cells = open_sheet(path, "sensor_accel[1]").cells
    assert cells is not None
    np.testing.assert_array_equal(cells["ax (m/s2)"], ACC[:, 0] + np.float32(1))
    both = ulog(("sensor_accel", 0, 5))
    swapped = both.replace(struct.pack("<QI", TIME_US[N // 2], 5), struct.pack("<QI", TIME_US[N // 2], 6))
    path.write_bytes(swapped)
    with pytest.raises(DataError, match=r"topic sensor_accel: has samples of 2 sensors \(device_id 5, 6\)"):
        open_sheet(path, "sensor_accel")


def test_the_cut_end_of_a_ulog_is_told_and_a_cut_header_is_refused(tmp_path: Path) -> None:
    path, whole = tmp_path / "flight.ulg", ulog(("sensor_accel", 0, 5))
    path.write_bytes(whole[:-20])
    sheet = open_sheet(path)
    assert any("ends inside a record, at byte" in note for note in sheet.notes)
    assert import_sheet(sheet, None).table.n == N - 1
    for size in (10, 60, 300):
        path.write_bytes(whole[:size])
        with pytest.raises(DataError, match=r"flight\.ulg"):
            open_sheet(path)
    path.write_bytes(b"ULogEnc\x01" + bytes(300))
    with pytest.raises(DataError, match=r"encrypted PX4 ULog; decrypt it with decrypt_ulog\.py"):
        open_sheet(path)


def fmt(kind: int, name: str, form: str, columns: str) -> bytes:
    sizes = {"Q": 8, "B": 1, "f": 4, "h": 2, "N": 16}
    length = 3 + sum(sizes[c] for c in form)
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name.encode(), form.encode(), columns.encode())


def dataflash(instances: int = 1) -> bytes:
    parts = [
        b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", 0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"),
        fmt(129, "ACC", "QBQfff", "TimeUS,I,SampleUS,AccX,AccY,AccZ"),
        fmt(130, "MAG", "QBhhh", "TimeUS,I,MagX,MagY,MagZ"),
        fmt(131, "PARM", "QNf", "TimeUS,Name,Value"),
        fmt(132, "ATT", "Qf", "TimeUS,Roll"),
    ]
    parts += [b"\xa3\x95\x83" + struct.pack("<Q16sf", 5, b"INS_ACCOFFS_X", 0.25)]
    for row, stamp in enumerate(TIME_US):
        for i in range(instances):
            parts.append(b"\xa3\x95\x81" + struct.pack("<QBQ3f", stamp + 100, i, stamp, *(ACC[row] + i)))
        parts.append(b"\xa3\x95\x82" + struct.pack("<QB3h", stamp, 0, *(10 * ACC[row]).astype(int)))
        parts.append(b"\xa3\x95\x84" + struct.pack("<Qf", stamp, 0.5))
    return b"".join(parts)


def test_a_dataflash_log_gives_its_accelerometer_and_tells_the_correction(tmp_path: Path) -> None:
    path = tmp_path / "00000012.BIN"
    path.write_bytes(dataflash())
    sheet = open_sheet(path)
    assert sheet.topic == "ACC[0]"
    assert "MAG[0], ATT" in sheet.notes[0]
    assert "after the autopilot's own correction" in sheet.notes[1]
    table = import_sheet(sheet, None).table
    np.testing.assert_array_equal(table.outputs, ACC)
    np.testing.assert_allclose(table.time_s, TIME_US / 1e6, rtol=1e-15)
    assert table.constants["INS_ACCOFFS_X"] == 0.25
    magnetometer = import_sheet(open_sheet(path, "MAG[0]"), None).table
    np.testing.assert_allclose(magnetometer.outputs, 0.1 * (10 * ACC).astype(int))
    with pytest.raises(DataError, match="topic ATT: has no accelerometer"):
        open_sheet(path, "ATT")


def test_a_format_without_a_length_is_refused(golden, tmp_path: Path) -> None:
    """pymavlink would read the same bytes for ever."""
    path = tmp_path / "00000012.BIN"
    for name in (b"ATT\0", bytes(4)):
        path.write_bytes(dataflash().replace(b"\x84\x0fATT\0", b"\x84\x00" + name))
        with golden.refused(DataError):
            open_sheet(path)


def test_two_imus_in_a_dataflash_log_have_to_be_chosen(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(dataflash(instances=2))
    with pytest.raises(SeveralTopics, match=r"--topic 'ACC\[0\]'"):
        open_sheet(path)
    np.testing.assert_array_equal(read_foreign(path, None, topic="ACC[0]").outputs, ACC)


def test_damage_in_a_dataflash_log_is_told_with_its_place(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path, whole = tmp_path / "a.bin", dataflash()
    middle = whole.index(b"\xa3\x95\x81", len(whole) // 2)
    path.write_bytes(whole[:middle] + b"\0" * 7 + whole[middle:])
    sheet = open_sheet(path)
    assert any(f"7 bytes are no record and were skipped, the first at {middle}" in note for note in sheet.notes)
    assert import_sheet(sheet, None).table.n == N
    assert capfd.readouterr() == ("", ""), "the library prints a line for each byte"
    os.write(2, b"later")
    assert capfd.readouterr().err == "later"
    path.write_bytes(whole[:-20])
    sheet = open_sheet(path)
    assert any("ends inside a record, at byte" in note for note in sheet.notes)
    assert import_sheet(sheet, None).table.n == N
    for size in (50, 100):
        path.write_bytes(whole[:size])
        with pytest.raises(DataError, match=r"a\.bin"):
            open_sheet(path)


@pytest.mark.parametrize(("module", "content"), [("pyulog", ulog()), ("pymavlink", dataflash())])
def test_a_missing_library_is_named_with_its_extra(
    module: str, content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "log").write_bytes(content)
    for each in [name for name in sys.modules if name.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, each)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(DataError, match=rf"the library {module} .*\n\n +pip install 'inertial-rig\[robotics\]'"):
        open_sheet(tmp_path / "log")


@pytest.mark.parametrize("block", [16, 1000, 1 << 20])
@pytest.mark.parametrize("cut", [0, 7, 60])
def test_the_cut_end_of_a_ulog_is_found_block_by_block(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int, cut: int
) -> None:
    whole, path = ulog(("sensor_accel", 0, 7)), tmp_path / "cut.ulg"
    starts, place = [], 16
    while place < len(whole):
        starts.append(place)
        place += 3 + whole[place] + 256 * whole[place + 1]
    path.write_bytes(whole[: len(whole) - cut])
    monkeypatch.setattr(flight_logs, "BLOCK_BYTES", block)
    last = max(start for start in starts if start < len(whole) - cut)
    assert flight_logs._cut_at(path) == (None if cut == 0 else last)


def test_a_ulog_without_data_is_refused_without_the_words_of_the_library(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "head.ulg"
    path.write_bytes(ulog(("sensor_accel", 0, 7))[:30])
    with pytest.raises(DataError, match="cut or damaged near its start"):
        open_sheet(path)
    assert capsys.readouterr() == ("", "")


def test_a_log_that_the_library_cannot_read_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, opened = tmp_path / "damaged.ulg", list[BinaryIO]()
    path.write_bytes(ulog(("sensor_accel", 0, 7)))

    def fail(file: BinaryIO) -> None:
        opened.append(file)
        raise ValueError

    monkeypatch.setattr("pyulog.core.ULog", fail)
    with pytest.raises(ValueError):  # noqa: PT011 the error above
        flight_logs.ulog_topics(path)
    assert opened[0].closed
