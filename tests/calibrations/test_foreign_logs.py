"""Logs as loggers of other makers write them: read by the proposed import, or refused with a remedy."""

from __future__ import annotations

import gzip
import json
import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import openpyxl
import pytest

import calibrations as cal
from calibrations.errors import DataError
from calibrations.importing.binary import open_sheet
from calibrations.importing.cells import SHARES, parse_cell
from calibrations.importing.foreign import import_sheet
from calibrations.importing.raw_logs import average_raw_log
from calibrations.importing.units import ColumnMapping
from calibrations.table import Array, Table

RATE_HZ, STILL_S = 50.0, 1.6
EPOCH_S = 1_735_992_000.0
START = datetime(2026, 1, 4, 12, tzinfo=UTC)
G = 9.80665
DIRECTIONS = [np.array(d) / np.linalg.norm(d) for d in product((-1, 0, 1), repeat=3) if any(d)]


@cache
def log() -> tuple[Array, Array]:
    """Time in s (n,), and outputs in g (n, 3), of a sensor that was put down on 26 sides."""
    rng = np.random.default_rng(7)
    samples: list[Array] = []
    for direction in DIRECTIONS:
        samples += [direction + rng.normal(0, 0.2, 3) for _ in range(15)]
        samples += [direction] * int(STILL_S * RATE_HZ)
    outputs = [0.02, -0.015, 0.03] + np.array([1.01, 0.99, 1.005]) * samples + rng.normal(0, 1e-3, (len(samples), 3))
    return np.arange(len(samples)) / RATE_HZ, outputs


def rows(of: Callable[[float, Array], Sequence[str]], separator: str = ",", end: str = "\n") -> str:
    return "".join(separator.join(of(float(t), a)) + end for t, a in zip(*log(), strict=True))


def fixed(values: Iterable[float], digits: int = 6) -> list[str]:
    return [f"{value:.{digits}f}" for value in values]


def comma(values: Iterable[float]) -> list[str]:
    return [text.replace(".", ",") for text in fixed(values)]


def clock(t: float) -> str:
    return (START + timedelta(seconds=t)).replace(tzinfo=None).isoformat(timespec="milliseconds")


def counts(a: Array) -> list[str]:
    return [str(round(8192 * value)) for value in a]


@dataclass(frozen=True)
class Log:
    """A log as its header lines and one row, with the expected unit and the expected start time in s."""

    head: str
    row: Callable[[float, Array], Sequence[str]]
    unit: str = "g"
    begin_s: float = 0.0
    separator: str = ","
    end: str = "\n"

    @property
    def text(self) -> str:
        return self.head + rows(self.row, self.separator, self.end)


def stamped(per_s: float) -> Callable[[float, Array], Sequence[str]]:
    return lambda t, a: [f"{per_s * (EPOCH_S + t):.0f}", *fixed(a)]


QUATERNION = ["0", "0", "0", "1", "-1"]
ROS = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
ROS += [*(f"field.orientation.{k}" for k in "xyzw"), "field.orientation_covariance0"]
ROS += [f"field.{of}.{k}" for of in ("angular_velocity", "linear_acceleration") for k in "xyz"]
DOT = "sep=,\r\nDeviceTag:,DOT 1\r\nOutputRate:,50 Hz\r\n\r\nPacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,\r\n"
MT = "// Start Time: Unknown\n// Update Rate: 50.0Hz\nPacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\n"
ST = "STEVAL-MKI109V3\nLSM6DSO ODR 50 Hz FS 4 g\n\nTIMESTAMP [us]\tA_X [mg]\tA_Y [mg]\tA_Z [mg]\tG_X [mdps]\n"
BOSCH = "Bosch Sensortec GmbH\nSensor: BMI270\n\nTime(s)\tAccX(g)\tAccY(g)\tAccZ(g)\tTemp(degC)\n"
PX4 = "timestamp,timestamp_sample,device_id,x,y,z,temperature,error_count,clip_counter[0],samples\n"
PHYPHOX = '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)"\n'
SHIMMER = '"sep=\t"\r\nTimestamp_CAL\tAccel_X_CAL\tAccel_Y_CAL\tAccel_Z_CAL\t\r\nms\tm/(s^2)\tm/(s^2)\tm/(s^2)\t\r\n'
BETAFLIGHT = "loopIteration, time (us), accSmooth[0], accSmooth[1], accSmooth[2], flags (flags)\n"
SEPARATOR = "sep=;\r\ntime [ms];ax [mg];ay [mg];az [mg]\r\n"
NOON_S = (START - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds()
LOGS = {
    "german": Log("Zeit [s];ax [g];ay [g];az [g]\r\n", lambda t, a: comma([t, *a]), separator=";", end="\r\n"),
    "row of units": Log("time,acc_x,acc_y,acc_z\ns,m/s^2,m/s^2,m/s^2\n", lambda t, a: fixed([t, *(G * a)]), "m/s2"),
    "units in names": Log("time_s,ax_g,ay_g,az_g,\n", lambda t, a: [*fixed([t, *a]), ""]),
    "quoted": Log('"time (s)","ax (g)","ay (g)","az (g)"\n', lambda t, a: [f'"{x}"' for x in fixed([t, *a])]),
    "line ends of a Mac": Log("time (s),ax (g),ay (g),az (g)\r", lambda t, a: fixed([t, *a]), end="\r"),
    "separator named": Log(SEPARATOR, lambda t, a: comma([1e3 * t, *(1e3 * a)]), separator=";", end="\r\n"),
    "thousands": Log("t (ms),x (mg),y (mg),z (mg)\n", lambda t, a: [f'"{v:,.2f}"' for v in (1e3 * t, *(1e3 * a))]),
    "epoch in ms": Log("timestamp_ms,accX,accY,accZ\n", stamped(1e3), "g", EPOCH_S),
    "epoch in us": Log("timestamp,accX,accY,accZ\n", stamped(1e6), "g", EPOCH_S),
    "epoch in ns": Log("time_ns,accX,accY,accZ\n", stamped(1e9), "g", EPOCH_S),
    "epoch in s": Log("time,accX,accY,accZ\n", lambda t, a: fixed([EPOCH_S + t, *a]), "g", EPOCH_S),
    "dates": Log("time,accX,accY,accZ\n", lambda t, a: [f"{clock(t)}Z", *fixed(a)], "g", NOON_S),
    "time of day": Log("time;accX;accY;accZ\n", lambda t, a: [clock(t)[11:], *fixed(a)], "g", 43200, ";"),
    "rostopic echo": Log(
        ",".join(ROS) + "\n",
        lambda t, a: [f"{1e9 * (EPOCH_S + t):.0f}", "1", "2", "imu", *QUATERNION, "0", "0", "0", *fixed(G * a)],
        "m/s2",
        EPOCH_S,
    ),
    "ulog2csv": Log(
        PX4,
        lambda t, a: [f"{1e6 * (5 + t):.0f}", "1", "1310988", *fixed(G * a), "25.0", "0", "0", "8"],
        "m/s2",
        5,
    ),
    "mavlogdump": Log(
        "timestamp,TimeUS,I,SampleUS,AccX,AccY,AccZ\n",
        lambda t, a: [*fixed([EPOCH_S + t]), "1", "0", "1", *fixed(G * a)],
        "m/s2",
        EPOCH_S,
    ),
    "Betaflight": Log(BETAFLIGHT, lambda t, a: ["8", f" {1e6 * t:.0f}", *counts(a), " 0"], "count"),
    "Xsens MT Manager": Log(MT, lambda t, a: ["1", f"{1e4 * t:.0f}", *fixed(G * a)], "m/s2", 0, "\t"),
    "Movella DOT": Log(DOT, lambda t, a: ["1", f"{1e6 * t:.0f}", *fixed(G * a), ""], "m/s2", end="\r\n"),
    "ST": Log(ST, lambda t, a: [f"{1e6 * t:.0f}", *fixed(1e3 * a, 2), "0.1"], separator="\t"),
    "Bosch": Log(BOSCH, lambda t, a: [*fixed([t, *a]), "25.1"], separator="\t"),
    "phyphox": Log(PHYPHOX, lambda t, a: [f"{v:.9E}" for v in (t, *(G * a))], "m/s2"),
    "Sensor Logger": Log(
        "time,seconds_elapsed,z,y,x\n",
        lambda t, a: [f"{1e9 * (EPOCH_S + t):.0f}", *fixed([t, *(G * a[::-1])])],
        "m/s2",
        EPOCH_S,
    ),
    "Shimmer": Log(SHIMMER, lambda t, a: [*fixed([1e3 * (EPOCH_S + t), *(G * a)]), ""], "m/s2", EPOCH_S, "\t", "\r\n"),
    "MATLAB": Log("", lambda t, a: [f"{v:.7e}" for v in (t, *(G * a))], "m/s2", separator="   "),
    "named values": Log("", lambda t, a: [f"t:{t:.3f}", *(f"acc_{k}:{v:.5f}" for k, v in zip("xyz", a, strict=True))]),
    "JSON by lines": Log("", lambda t, a: [json.dumps({"time": t, "accX": a[0], "accY": a[1], "accZ": a[2]})]),
    "first reading missing": Log("time_s,accX,accY,accZ\n-0.02,nan,NaN,nan\n", lambda t, a: fixed([t, *a])),
}


def imported(path: Path) -> Table:
    """The table by the import that the first message proposes."""
    sheet = replace(open_sheet(path), skipped=SHARES["few"])
    with pytest.raises(DataError) as refused:
        average_raw_log(import_sheet(sheet, None).table)
    command = re.search(r"^    rig import (.*)$", str(refused.value), re.MULTILINE)
    assert command, refused.value
    words = shlex.split(command[1])[1:]
    options = list(zip(words[::2], words[1::2], strict=True))
    columns = [ColumnMapping.parse(value) for option, value in options if option == "--column"]
    return average_raw_log(import_sheet(sheet, dict(options)["--kind"], columns).table)


def check(table: Table, unit: str, begin_s: float) -> None:
    one_g = {"g": 1.0, "m/s2": G, "count": 8192.0}[unit]
    assert (table.kind, table.unit, table.n) == ("positions", unit, len(DIRECTIONS))
    expected = np.array([0.02, -0.015, 0.03] + np.array([1.01, 0.99, 1.005]) * DIRECTIONS)
    assert np.abs(table.outputs / one_g - expected).max() < 1e-3
    first_s, last_s = table.column("t_s")[[0, -1]]
    assert begin_s < first_s < begin_s + 2
    assert last_s - first_s == pytest.approx(25 * (15 / RATE_HZ + STILL_S), abs=0.1)


@pytest.mark.parametrize("name", LOGS)
def test_a_log_is_read_by_the_proposed_import(name: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(LOGS[name].text.encode())
    check(imported(path), LOGS[name].unit, LOGS[name].begin_s)


def test_python_takes_a_log_as_the_command_line_does(tmp_path: Path) -> None:
    t, outputs = log()
    columns = {"t_s": t, **dict(zip(("ax", "ay", "az"), outputs.T, strict=True))}
    check(cal.table(columns, "positions", {"unit": "g"}), "g", 0)
    path = tmp_path / "log.csv"
    path.write_text("# unit: g\nt_s,ax,ay,az\n" + rows(lambda t, a: fixed([t, *a])), encoding="utf-8")
    table = cal.read(path)
    check(table, "g", 0)
    fit = cal.fit(table, "linear")
    assert fit.params["bias.x"].value == pytest.approx(0.02, abs=1e-3)
    assert fit.params["scale-factor.y"].value == pytest.approx(0.99, abs=1e-3)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-8-sig", "cp1252", "gzip"])
def test_a_log_is_read_in_any_encoding(encoding: str, tmp_path: Path) -> None:
    text = "Zeit (ms);acc_x (m/s²);acc_y (m/s²);acc_z (m/s²)\n" + rows(lambda t, a: fixed([1e3 * t, *(G * a)]), ";")
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    content = gzip.compress(text.encode()) if encoding == "gzip" else (mark + text).encode(encoding)
    (tmp_path / "log.txt").write_bytes(content)
    check(imported(tmp_path / "log.txt"), "m/s2", 0)


@pytest.mark.parametrize("form", ["titles and an empty column", "dates", "numbers as texts"])
def test_a_workbook_is_read_whatever_its_name_and_layout(form: str, tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    left = [None] if form == "titles and an empty column" else []
    if left:
        book.active.append(["Tumble test of unit 17"])
        book.active.append([])
    book.active.append([*left, "Time" if form == "dates" else "Time (s)", "ax (g)", "ay (g)", "az (g)"])
    for t, a in zip(*log(), strict=True):
        time = (START + timedelta(seconds=t)).replace(tzinfo=None) if form == "dates" else t
        cells = comma([t, *a]) if form == "numbers as texts" else [time, *a.tolist()]
        book.active.append([*left, *cells])
    book.save(tmp_path / "log.xlsx")
    path = (tmp_path / "log.xlsx").rename(tmp_path / "log.csv")
    check(imported(path), "g", NOON_S if form == "dates" else 0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t_s,ax,ay,az\n0,0x0A08,0xFE01,0x2000\n", "line 2, column .ax.: .0x0A08. is hexadecimal"),
        ("t;ax;ay;az\n1,0;2,0;3,0\n", "3 values for 4 columns"),
        ("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name\nACC, 1, 0, 1.0\n", "import the .bin log"),
        ("0,12,imu_link,0,0,0,1.0\n1,12,imu_link,0,0,0,1.0\n", "line 1: a header line .* is missing; write one"),
        ("t,x,y,z,x,y,z\n1,2,3,4,5,6,7\n", 'the column "x" occurs twice; rename one'),
        ("$PIMU,10,0.01,0.02,1.00*5A\n", "remove .*checksum"),
        (">ax:10:0.01\n>ay:10:0.02\n", "Teleplot log .* save it as CSV"),
        ("[2026-01-04 12:00:00.000] 0.01,0.02,1.0\n", "time in brackets; replace"),
        ("(1735992000.000000) can0 1A0#0A08FE012000\n", "decode its frames to a CSV"),
        ("LabVIEW Measurement\t\nWriter_Version\t2\n", "begins with X_Value"),
        ("<!DOCTYPE html><html><body>404</body></html>\n", "download the file itself"),
        ("version https://git-lfs.github.com/spec/v1\noid sha256:4d\n", "git lfs pull"),
    ],
)
def test_another_text_is_refused_with_a_remedy(text: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=says):
        import_sheet(open_sheet(path), None)


@pytest.mark.parametrize(
    ("cell", "seconds"),
    [
        ("1970-01-02 00:00:01", 86401.0),
        ("1970/01/01T01:00:00,5+02:00", -3599.5),
        ("1970-01-01T01:00:00.5-0130", 9000.5),
        ("23:59:59.25", 86399.25),
    ],
)
def test_a_date_or_a_time_of_day_is_seconds(cell: str, seconds: float) -> None:
    assert parse_cell(cell) == seconds


@pytest.mark.parametrize("cell", ["24:00:00", "12:60:00", "2026-13-01 00:00:00", "12:00", "1:2:3:4"])
def test_a_text_that_is_no_time_is_refused(cell: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_cell(cell)
