"""Files as spreadsheets and loggers write them: each has its layout found, and its numbers to the last digit."""

from __future__ import annotations

import gzip
import re
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from calibrations.errors import DataError
from calibrations.files import LARGEST_BYTES, open_text_file, text_source
from calibrations.importing.foreign import parse_csv, read_csv
from calibrations.importing.sheet import Sheet, read_cells, read_sheet

HEADER = "alpha_deg;beta_deg;vx_v"
EXPECTED = {"alpha_deg": [90.0, 90.0], "beta_deg": [0.0, 30.0], "vx_v": [3.4987, 3.3614]}


def laid(content: str) -> Sheet:
    return read_sheet(text_source(content, "some.csv"))


@pytest.mark.parametrize(
    "content",
    [
        f"{HEADER}\n90;0;3,4987\n90;30;3,3614\n",
        f"{HEADER}\n90;0;3.4987\n90;30;3.3614\n",
        "alpha_deg\tbeta_deg\tvx_v\n90\t0\t3,4987\n90\t30\t3,3614\n",
        "alpha_deg  beta_deg vx_v\n90 0   3.4987\n90 30  3.3614\n",
        'alpha_deg,beta_deg,vx_v\n90,0,"3,4987"\n90,30,"3,3614"\n',
        f"{HEADER}\ndeg;deg;mV\n90;0;3498,7\n90;30;3361,4\n",
        "alpha_deg (°);beta_deg [deg];vx_v / mV\n90;0;3498,7\n90;30;3361,4\n",
        f"Run of 3 May;;\nBench 2\n\n{HEADER}\n90;0;3,4987\n90;30;3,3614\n",
        f"Operator;Ann;;;\nRun of 3 May;;;;\n{HEADER};;\n90;0;3,4987;;\n;;;;\n90;30;3,3614;;\n;;;;\n",
        f"{HEADER}\n90;0;3,4987\n90;30;3,3614\n\x1a",
    ],
    ids=["comma", "point", "tab", "blanks", "quoted", "units-row", "units-in-names", "titles", "empty-cells", "ctrl-z"],
)
def test_a_table_with_our_names_is_read_as_it_is(content: str) -> None:
    table = parse_csv(content, "some.csv")
    assert table.kind == "poses"
    assert {name: values.tolist() for name, values in table.columns.items()} == {
        name: pytest.approx(values, rel=1e-15) for name, values in EXPECTED.items()
    }


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_the_encodings_that_spreadsheets_write(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "excel.csv"
    path.write_bytes("alpha_deg [°]\tbeta_deg [°]\tvx_v\r\n90\t0\t3,4987\r\n90\t30\t3,3614\r\n".encode(encoding))
    assert read_csv(path).column("vx_v").tolist() == EXPECTED["vx_v"]


def test_what_stands_above_the_header_is_kept() -> None:
    found = laid(f"# gravity_m_s2: 9,81\n\nRun of 3 May;;\nFs;100\n{HEADER}\n90;0;1\n90;1;2\n90;2;3\n")
    assert found.constants == {"gravity_m_s2": 9.81, "Fs": 100.0}
    assert (found.line, found.first) == (5, 6)


@pytest.mark.parametrize("cell", ["1.25", "1,25"])
def test_a_file_takes_no_memory_but_for_its_numbers(tmp_path: Path, cell: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("calibrations.importing.sheet._one_by_one")  # numpy takes it all
    path = tmp_path / "log.csv"
    path.write_text("ax;ay;az\n" + f"{cell};2;3\n" * 50_000)
    layout = read_sheet(open_text_file(path))
    tracemalloc.start()
    numbers, labels = read_cells(layout, [])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (numbers["ax"] == 1.25).all()
    assert labels == {}
    assert peak < 2 * 3 * numbers["ax"].nbytes  # an array may be there twice while it grows


@pytest.mark.parametrize("rows", [3, 300])  # the layout is taken from fewer lines than 300
def test_a_fault_far_down_is_named_with_its_line(rows: int) -> None:
    good = "".join(f"90;{k},5;2,5\n" for k in range(rows))
    for fault, says in (("90;x;2,5\n", '"x" where a number'), ("90;;2\n", "empty where"), ("90;1\n", "2 values for 3")):
        with pytest.raises(DataError, match=re.escape(f"bad.csv, line {rows + 2}")) as error:
            parse_csv(f"{HEADER}\n{good}{fault}90;1;2\n", "bad.csv")
        assert says in str(error.value)


def test_thousands_separators_are_read_where_a_decimal_separator_follows() -> None:
    with pytest.raises(DataError, match=r'"vx_v" reaches 3498\.7 V'):
        parse_csv(f"{HEADER}\n90;0;3.498,7\n", "bad.csv")
    with pytest.raises(DataError, match='line 2, column "vx_v": "3_498" where a number belongs'):
        parse_csv(f"{HEADER}\n90;0;3_498\n", "bad.csv")


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(2 * LARGEST_BYTES)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (sparse, "the file has 2.0 GiB; the limit is 1 GiB; write the mean of each pose instead of samples"),
        (
            lambda path: path.write_bytes(b"PK\x03\x04" + bytes(100)),
            "is a cut zip archive (Excel or NumPy .npz)",
        ),
        (lambda path: path.write_bytes("1;2\n".encode("utf-16-le")), "is not text (byte 1 is 0x00)"),
        (lambda path: path.write_bytes(b"a;b\n\x81\x8d"), "is not text in UTF-8; is it really a CSV file?"),
        (
            lambda path: path.write_bytes(b"ax,ay,az\n" + b"1,2,3\n" * 20_000 + b"\xe4"),
            "contains bytes that are not text",
        ),
        (lambda path: path.mkdir(), "cannot be read: Is a directory; name a file in it"),
        (lambda _: None, "cannot be read: No such file or directory"),
    ],
    ids=["2-GiB", "xlsx", "utf-16-without-mark", "bytes", "bytes-far-down", "folder", "nowhere"],
)
def test_files_that_are_no_text_are_refused(tmp_path: Path, make: Callable[[Path], object], says: str) -> None:
    make(tmp_path / "bad.csv")
    with pytest.raises(DataError, match=re.escape(f"bad.csv: {says}")):
        read_csv(tmp_path / "bad.csv")


def test_gzip_is_read_like_its_content(tmp_path: Path) -> None:
    path = tmp_path / "table.csv.gz"
    path.write_bytes(gzip.compress(f"{HEADER}\n90;0;3,4987\n90;30;3,3614\n".encode("utf-16")))
    np.testing.assert_array_equal(read_csv(path).column("vx_v"), EXPECTED["vx_v"])
    assert read_sheet(open_text_file(path)).separator == ";"
