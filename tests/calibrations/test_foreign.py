"""Other people's files: separators, headers, units, constants; and what is wrong with one, with its place."""

from __future__ import annotations

import gzip
import re
import time
from pathlib import Path

import numpy as np
import pytest

from calibrations import files
from calibrations.errors import DataError, MissingColumn
from calibrations.importing.foreign import read_csv, write_csv
from calibrations.importing.units import ColumnMapping
from calibrations.table import Table
from tests.calibrations.synthetic import components, poses, turns
from tests.foreign_files import read_foreign

THREE = [ColumnMapping(name, str(k)) for k, name in enumerate(("ax", "ay", "az"), start=1)]


def read(tmp_path: Path, text: str, *columns: str, kind: str | None = None, **constants: float | str) -> Table:
    path = tmp_path / "theirs.txt"
    path.write_text(text, encoding="utf-8")
    return read_foreign(path, kind, [ColumnMapping.parse(column) for column in columns], constants)


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "   ", ", "])
def test_files_with_any_separator_are_read(tmp_path: Path, separator: str) -> None:
    text = "\n".join(separator.join(row) for row in (("ax", "ay", "az"), ("1", "-2.5", "3e-3"), ("4", "5", "6")))
    table = read(tmp_path, text)
    assert table.kind == "positions"
    assert table.outputs.tolist() == [[1, -2.5, 3e-3], [4, 5, 6]]


@pytest.mark.parametrize(("separator", "header"), [(";", True), (";", False), ("\t", True), ("\t", False)])
def test_files_with_decimal_commas_are_read(tmp_path: Path, separator: str, header: bool) -> None:
    rows = [("ax", "ay", "az")] * header + [("1,5", "-2,25", "3"), ("1,5e2", "0,5", "1")]
    mapped = () if header else ("ax=1", "ay=2", "az=3")
    table = read(tmp_path, "\n".join(separator.join(row) for row in rows), *mapped)
    assert table.outputs.tolist() == [[1.5, -2.25, 3], [150, 0.5, 1]]


def test_columns_without_a_header_are_numbered(tmp_path: Path) -> None:
    table = read(tmp_path, "0 7 8 9\n1 17 18 19\n", "az=4", "ax=2", "ay=3", "t_s=1:ms")
    assert table.outputs.tolist() == [[7, 8, 9], [17, 18, 19]]
    assert table.column("t_s").tolist() == [0, 1e-3]


def test_gzip_byte_order_mark_and_windows_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "theirs.csv.gz"
    path.write_bytes(gzip.compress(b"\xef\xbb\xbfax,ay,az\r\n1,2,3\r\n\r\n4,5,6\r\n"))
    assert read_foreign(path, None).outputs.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_constants_stand_above_as_comments_or_as_pairs(tmp_path: Path) -> None:
    table = read(tmp_path, "# sensor: mine\n# a remark\nFs,100\n\nax,ay,az\n1,2,3\n4,5,6\n", gravity_m_s2=9.81)
    assert dict(table.constants) == {"sensor": "mine", "Fs": 100.0, "gravity_m_s2": 9.81}


@pytest.mark.parametrize(
    ("column", "given", "expected"),
    [
        ("vx_v=Vout:mV", 2500, 2.5),
        ("vx_v=Vout:uV", 2.5e6, 2.5),
        ("alpha_deg=Vout:rad", np.pi / 2, 90),
        ("beta_deg=Vout:mrad", 1000 * np.pi, 180),
        ("temperature_c=Vout:K", 300, 26.85),
        ("temperature_c=Vout:degF", 212, 100),
        ("t_s=Vout:min", 2, 120),
        ("t_s=Vout:h", 2, 7200),
    ],
)
def test_units_of_a_file_are_converted(tmp_path: Path, column: str, given: float, expected: float) -> None:
    names = [name for name in ("alpha_deg", "beta_deg", "vx_v") if not column.startswith(name)]
    head = ",".join([*names, "Vout"])
    table = read(tmp_path, f"{head}\n{'1,' * len(names)}{given}\n", column)
    assert table.column(column.partition("=")[0])[0] == pytest.approx(expected)


def test_the_unit_of_positions_is_kept(tmp_path: Path) -> None:
    table = read(tmp_path, "1,2,1003\n4,995,6\n", "ax=1:mg", "ay=2:mg", "az=3:mg")
    assert table.unit == "g"
    assert table.outputs[0] == pytest.approx([1e-3, 2e-3, 1.003])


def test_a_colon_in_their_name_is_no_unit(tmp_path: Path) -> None:
    table = read(
        tmp_path, "acc:x,acc:y,acc:z\n1,0,0\n0,1,0\n", "ax=acc:x:g", "ay=acc:y:g", "az=acc:z:g", kind="positions"
    )
    assert table.column("ay").tolist() == [0, 1]


def test_columns_that_are_not_mapped_stay(tmp_path: Path) -> None:
    text = "alpha_deg,beta_deg,Vout,humidity,who\n90,0,3500,40,Ann\n90,10,3480,41,Bob\n"
    table = read(tmp_path, text, "vx_v=Vout:mV")
    assert set(table.columns) == {"alpha_deg", "beta_deg", "vx_v", "humidity"}
    assert table.labels == {"who": ("Ann", "Bob")}


def test_what_the_program_writes_is_read_alike(tmp_path: Path) -> None:
    columns = turns(inclinations_deg=(90, 45), step_deg=90)
    ax, ay, _ = components(columns)
    table = poses(columns, 2.5 + ax, 2.5 + ay)
    write_csv(table, tmp_path / "ours.csv")
    assert read_foreign(tmp_path / "ours.csv", None).digest == read_csv(tmp_path / "ours.csv").digest == table.digest


GOOD = "ax,ay,az\n1,2,3\n4,5,6\n"


@pytest.mark.parametrize(
    ("text", "columns", "says"),
    [
        ("", (), "theirs.txt: the file is empty"),
        ("# unit: g\n", (), "theirs.txt: the file is empty"),
        ("ax,ay,az\n", (), "theirs.txt: there are no rows below the header"),
        ("ax,ay,ax\n1,2,3\n", (), 'line 1: the column "ax" occurs twice'),
        ("ax,ay,\n1,2,3\n", (), "line 1: a column has no name: ax, ay, "),
        ("ax,ay,az\n1,2,3\n\n4,5\n1,2,3\n", (), "theirs.txt, line 4: 2 values for 3 columns (ax, ay, az)"),
        ("ax,ay,az\n1,2,3\n4,5,6\n4,5\n", (), "theirs.txt, line 4: 2 values for 3 columns"),
        ("ax,ay,az\n1,2,3\n\n4,x,6\n", (), 'theirs.txt, line 4, column "ay": "x" where a number belongs'),
        ("ax,ay,az\n1,2,3\n4,nan,6\n", (), 'theirs.txt, line 3, column "ay": "nan" is not a finite number'),
        ("1 2 3\n4 5 6\n1 - 2\n", ("ax=1", "ay=2", "az=3"), 'theirs.txt, line 3, column "2": "-" where a number'),
        ('ax,ay,az\n1,2,"' + "x" * 200_000, (), "theirs.txt: cannot be split into columns"),
        ("axx,ay,az\n1,2,3\n", (), 'theirs.txt, line 1: the column name is unknown: "axx"; did you mean "ax"?'),
        (GOOD, ("ax=acx",), 'theirs.txt: there is no column "acx"; did you mean "ax"?'),
        ("x,y,z\n1,2,3\n", (), 'theirs.txt, line 1: the column name is unknown: "x"; did you mean "ax"?'),
        (GOOD, ("vx=ax",), '"vx=ax": there is no column "vx"; did you mean "vx_v"?'),
        (GOOD, ("ax=ax:mgg",), 'theirs.txt: unknown unit "mgg" of the column "ax"; did you mean "mg"?'),
        (GOOD, ("ax=ax:g", "ay=ay:mg", "az=az:V"), "the three axes must have the same unit: ax in g, ay in g, az in V"),
        (GOOD, ("ax=ax", "ax=ay"), 'theirs.txt: the column "ax" is mapped twice'),
        (GOOD, ("t_s=ax:V",), 'the column "t_s" is in s; "ax" in V cannot be converted to it'),
        (GOOD, ("vx_v=ax:rad",), 'the column "vx_v" is in V; "ax" in rad cannot be converted to it'),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path: Path, text: str, columns: tuple[str, ...], says: str) -> None:
    with pytest.raises(DataError, match=re.escape(says)):
        read(tmp_path, text, *columns)


@pytest.mark.parametrize("text", ["vx_v", "=Vout", "vx_v=", "vx_v=:mV", ""])
def test_a_column_is_given_as_name_and_theirs(golden, text: str) -> None:
    with golden.refused(DataError):
        ColumnMapping.parse(text)


def test_a_missing_column_is_named_with_the_way_out(golden, tmp_path: Path) -> None:
    for kind in (None, "poses"):
        with golden.refused(MissingColumn):
            read(tmp_path, "alpha_deg,beta_deg,output\n1,2,3\n", kind=kind)
    with golden.refused(MissingColumn):
        read(tmp_path, "when,where\n1,2\n")


@pytest.mark.parametrize("cut", [slice(0, 25), slice(10, None)])
def test_damaged_gzip_is_one_message(tmp_path: Path, cut: slice) -> None:
    path = tmp_path / "theirs.csv.gz"
    whole = gzip.compress("\n".join(f"{k},{k * k},{k % 7}" for k in range(500)).encode())
    path.write_bytes(whole[cut])
    with pytest.raises(DataError, match=r"theirs\.csv\.gz: cannot be read as text"):
        read_foreign(path, "positions", THREE)
    path.write_bytes(whole[:200] + bytes(50) + whole[250:])
    with pytest.raises(DataError, match=r"theirs\.csv\.gz: cannot be read as text"):
        read_foreign(path, "positions", THREE)


def test_time_to_read_grows_with_the_number_of_columns_not_with_its_square(tmp_path: Path) -> None:
    """60,000 columns: a search of the header for each of them takes half a minute, one pass 0.3 s."""
    many = 60_000
    header = ",".join(["alpha_deg", "beta_deg", "vx_v", *(f"c{k}" for k in range(many))])
    rows = "".join(f"90,{beta},2.5{',1' * many}\n" for beta in (0, 30))
    begun = time.process_time()
    table = read(tmp_path, f"{header}\n{rows}")
    assert len(table.columns) >= many
    assert time.process_time() - begun < 8


def test_gzip_that_unpacks_beyond_measurements_is_refused_early(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = tmp_path / "bomb.csv.gz"
    packed.write_bytes(gzip.compress(b"alpha_deg,beta_deg,vx_v\n" + b"90,0,2.5\n" * 200_000))
    assert read_csv(packed).n == 200_000  # small enough to be harmless
    monkeypatch.setattr(files, "SMALL_BYTES", 1 << 16)
    with pytest.raises(DataError, match=r"bomb\.csv\.gz: the unpacked file is more than 50 times larger"):
        read_csv(packed)
