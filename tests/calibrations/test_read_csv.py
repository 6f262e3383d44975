"""CSV files: every table comes back to the last bit, and every fault is told with file, line and column."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibrations.errors import CalibrationError, DataError
from calibrations.importing.foreign import parse_csv, read_csv, require_kind, write_csv
from calibrations.table import Table

HEADER = "alpha_deg,beta_deg,vx_v"
GOOD = f"{HEADER}\n90,0,3.5\n90,90,2.5\n"

numbers = st.floats(-1e30, 1e30)
words = st.text(st.characters(codec="ascii", categories=("L", "N"), include_characters=" ,-+'\""), max_size=8)
names = st.from_regex(r"[a-z]{3,8}_[a-z]{2}", fullmatch=True)


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Any table of poses: some optional and unknown columns, a path or none, constants."""
    n = draw(st.integers(1, 6))
    optional = draw(st.sets(st.sampled_from(["vy_v", "t_s", "direction", "temperature_c", "n"])))
    unknown = draw(st.sets(names, max_size=2))
    wanted = ["alpha_deg", "beta_deg", "vx_v", *sorted(optional), *sorted(unknown)]
    angles, volts = st.integers(-360, 360).map(float), st.floats(-50, 50)
    own = {"alpha_deg": angles, "beta_deg": angles, "vx_v": volts, "vy_v": volts}
    own |= {
        "temperature_c": st.floats(-100, 200),
        "direction": st.sampled_from([-1.0, 0.0, 1.0]),
        "n": st.floats(1, 1e9),
    }
    columns = {name: draw(st.lists(own.get(name, numbers), min_size=n, max_size=n)) for name in wanted}
    labels = (
        {"path": tuple(draw(st.lists(words.map(str.strip), min_size=n, max_size=n)))} if draw(st.booleans()) else {}
    )
    constants = draw(st.dictionaries(names, numbers, max_size=3))
    return Table.from_columns("poses", columns, constants, "drawn", labels)


@given(tables())
def test_a_table_survives_writing_and_reading(tmp_path_factory: pytest.TempPathFactory, table: Table) -> None:
    path = tmp_path_factory.getbasetemp() / "table.csv"
    write_csv(table, path)
    again = read_csv(path)
    assert again.digest == table.digest
    assert dict(again.labels) == dict(table.labels)
    assert dict(again.constants) == dict(table.constants)
    assert again.source == str(path)


FRAGMENTS = (
    *(
        "vx_v",
        "ax",
        "ay",
        "az",
        "path",
        "Vx [mV]",
        "(deg)",
        "mV",
        "deg",
        "1",
        "2,5",
        "nan",
        "1e200",
        "",
        '"',
        "#",
        "\x1a",
    ),
    *(";", ",", "\t", "\n", "\n", "\n", " "),
)


@given(st.lists(st.sampled_from(FRAGMENTS), max_size=40).map("".join))
def test_any_fragments_are_a_table_or_one_clear_error(text: str) -> None:
    with contextlib.suppress(CalibrationError):
        parse_csv(text, "any.csv")


@given(st.text(max_size=100) | st.text(',.0123456789-e\n" #x', max_size=100).map(f"{HEADER}\n".__add__))
def test_any_text_is_a_table_or_one_clear_error(text: str) -> None:
    with contextlib.suppress(CalibrationError):
        parse_csv(text, "any.csv")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "bad.csv: the file is empty"),
        ("# sensor: A\n\n", "bad.csv: the file is empty: a header line with column names is missing"),
        (f"{HEADER}\n", "bad.csv: there are no rows below the header"),
        ("90,0,3.5\n90,90,2.5\n", "bad.csv, line 1: a header line with column names is missing"),
        (f"{HEADER},vx_v\n1,2,3,4\n", 'bad.csv, line 1: the column "vx_v" occurs twice'),
        ("alpha_deg,,vx_v\n1,2,3\n", "bad.csv, line 1: a column has no name"),
        ("alpha_deg,vx_v\n1,2\n", "poses need alpha_deg, beta_deg, vx_v"),
        (
            "alpha_deg,bta_deg,vx_v\n1,2,3\n",
            'line 1: the column name is unknown: "bta_deg"; did you mean "beta_',
        ),
        (f"{HEADER}\n90,0,3.5\n90,10\n", "bad.csv, line 3: 2 values for 3 columns (alpha_deg, beta_deg, vx_v)"),
        (f"{HEADER},humidity\n90,0,3.5\n", "bad.csv, line 2: 3 values for 4 columns"),
        ("north,east\n1,2,3\n", "bad.csv, line 2: 3 values for 2 columns (north, east)"),
        (f"{HEADER}\n90,0,3.5\n90,10,1,2\n", "bad.csv, line 3: 4 values for 3 columns"),
        (f"{HEADER}\n90,0,3.5,1\n90,10,1,2\n", "bad.csv, line 2: 4 values for 3 columns"),
        (f"# sensor: A\n\n{HEADER}\n90,0,3.5\n90,10,high\n", 'bad.csv, line 5, column "vx_v": "high" where a number'),
        (f"{HEADER}\n90,,3.5\n", 'bad.csv, line 2, column "beta_deg": empty where a number belongs'),
        (f"{HEADER},path\n90,0,3.5,up\n\n90,0,nan,up\n", 'bad.csv, line 4, column "vx_v": "nan" is not a finite'),
        (f"{HEADER}\n90,0,nan\n", 'bad.csv, line 2, column "vx_v": "nan" is not a finite number'),
        (f"{HEADER}\n90,0,1e999\n", 'column "vx_v": "1e999" is not a finite number'),
    ],
)
def test_an_error_of_a_file_names_the_place(text: str, says: str) -> None:
    with pytest.raises(DataError, match=re.escape(says)):
        parse_csv(text, "bad.csv")


def test_given_kind_names_its_missing_column(golden) -> None:
    with golden.refused(DataError):
        parse_csv("alpha_deg,beta,vx_v\n1,2,3\n", "bad.csv", kind="poses")


def test_byte_order_mark_spaces_and_windows_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "excel.csv"
    path.write_bytes(b"\xef\xbb\xbf# sensor: A 12\r\n alpha_deg , beta_deg,vx_v\r\n 90, 0 ,3.5\r\n")
    table = read_csv(path)
    assert table.kind == "poses"
    assert table.constants == {"sensor": "A 12"}
    assert table.column("vx_v").tolist() == [3.5]


def test_unknown_columns_are_kept() -> None:
    table = parse_csv(f"{HEADER},humidity,operator\n90,0,3.5,41,Ann\n90,90,2.5,42,Bo\n", "some.csv")
    np.testing.assert_array_equal(table.column("humidity"), [41.0, 42.0])
    assert table.labels["operator"] == ("Ann", "Bo")


def test_unreadable_files_are_refused_with_the_reason(golden, tmp_path: Path) -> None:
    with golden.refused(DataError):
        read_csv(tmp_path / "nowhere.csv")
    with golden.refused(DataError):
        read_csv(tmp_path)
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\x00\xff\xfe")
    with golden.refused(DataError):
        read_csv(binary)


def test_a_table_of_another_kind_is_refused() -> None:
    table = parse_csv(GOOD, "good.csv")
    assert require_kind(table, "poses", "positions") is table
    with pytest.raises(DataError, match=r"good\.csv: a table of poses; this needs positions"):
        require_kind(table, "positions")
