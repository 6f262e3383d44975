"""Tables that cannot be: one message with file, line, column and what to do; status 2; nothing written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest


def line(text: str, number: int, old: str, new: str) -> str:
    """`text` with a change in one line, counted from 1."""
    lines = text.splitlines()
    assert old in lines[number - 1]
    lines[number - 1] = lines[number - 1].replace(old, new, 1)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("number", "old", "new", "says"),
    [
        (
            1,
            "beta_deg",
            "beta_dge",
            'bad.csv, line 1: the column name is unknown: "beta_dge"; did you mean "beta_deg"?',
        ),
        (1, "beta_deg", "b", 'bad.csv, line 1: the column "beta_deg" is missing: poses need alpha_deg, beta_deg, vx_v'),
        (1, "vx_v", "vx", 'the column name is unknown: "vx"; did you mean "vx_v"?'),
        (1, "vy_v", "vx_v", 'bad.csv, line 1: the column "vx_v" occurs twice'),
        (1, "vy_v", "", "bad.csv, line 1: a column has no name"),
        (4, "60.0", "sixty", 'bad.csv, line 4, column "beta_deg": "sixty" where a number belongs'),
        (4, "60.0", "", 'bad.csv, line 4, column "beta_deg": empty where a number belongs; correct the cell or remove'),
        (4, "60.0", "nan", 'bad.csv, line 4, column "beta_deg": "nan" is not a finite number'),
        (4, "60.0", "-inf", 'bad.csv, line 4, column "beta_deg": "-inf" is not a finite number'),
        (4, "60.0", "60.0,1", "bad.csv, line 4: 10 values for 9 columns (alpha_deg, beta_deg"),
        (4, ",60.0", "", "bad.csv, line 4: 8 values for 9 columns"),
        (4, "60.0", '"' + "x" * 200_000 + '"', "bad.csv: cannot be split into columns: field larger than field limit"),
    ],
)
def test_faults_of_a_table_are_named(
    refused: Callable[..., str], work: Path, text: str, number: int, old: str, new: str, says: str
) -> None:
    (work / "bad.csv").write_text(line(text, number, old, new))
    assert says in refused("compare", "bad.csv", "--model", "linear", "--json")
    refused("fit", "bad.csv", "--out", "out.yaml")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "bad.csv: the file is empty: a header line with column names is missing"),
        (b"# sensor: mine\n\n", "bad.csv: the file is empty"),
        (b"alpha_deg,beta_deg,vx_v\n", "bad.csv: there are no rows below the header"),
        (b"90,0,2.5\n90,10,2.5\n", "bad.csv, line 1: a header line with column names is missing"),
        (b"90,90,2.5\n90,10,2.5\n", "bad.csv, line 1: a header line with column names is missing"),
        (
            b"alpha_deg,beta_deg,vx_v\n90,0,2.5\n",
            "bad.csv: 1 rows cannot determine the 2 parameters of linear; measure",
        ),
        (b"north,east\n1,2\n", "bad.csv, line 1: columns north, east do not fit any kind of table; poses need"),
        (bytes(range(256)), "bad.csv: is not text (byte 0 is 0x00); is it really a CSV file?"),
        (
            b"rate_deg_s,gx,gy,gz\n1,2,3,4\n",
            'column "rate_deg_s" never changes; turn the gyroscope at several rates',
        ),
        (b"# filter_corner_hz: low\n# sample_rate_hz: 1000\nGOOD", "the constant \"filter_corner_hz\" is 'low', not a"),
    ],
)
def test_files_that_are_no_table_are_refused(
    refused: Callable[..., str], work: Path, text: str, content: bytes, says: str
) -> None:
    (work / "bad.csv").write_bytes(content.replace(b"GOOD", text.encode()))
    assert says in refused("fit", "bad.csv", "--model", "linear", "--out", "out.yaml", "--json")


@pytest.mark.parametrize(
    ("head", "row", "says"),
    [
        ("mx,my,mz", (1, 2, 3), "magnetometers needs the effect field-strength, and linear has bias, scale-factor"),
        (
            "ax,ay,az",
            (1, 0, 3),
            'bad.csv: the column "ay" never changes; each axis must point up and down in the positions',
        ),
        ("ax,ay,az,n", (1, 2, 3, 0), 'bad.csv: row 1, column "n" is 0; it must be at least 1'),
    ],
)
def test_impossible_positions_are_refused(
    refused: Callable[..., str], work: Path, head: str, row: tuple[int, ...], says: str
) -> None:
    rows = "\n".join(",".join(str(k * factor) for factor in row) for k in range(20))
    (work / "bad.csv").write_text(f"{head}\n{rows}\n")
    for command in ("fit", "diagnose"):
        assert says in refused(command, "bad.csv", "--model", "linear")
