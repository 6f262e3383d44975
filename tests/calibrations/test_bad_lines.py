"""Damaged lines of a text log: counted, shown and skipped while they are few, else refused with the first of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibrations.errors import DataError
from calibrations.files import open_text_file
from calibrations.importing.cells import SHARES, Policy
from calibrations.importing.foreign import ImportedTable, import_sheet
from calibrations.importing.sheet import read_sheet

HEADER = "t_s,ax,ay,az"
N = 4000


def lines() -> list[str]:
    """A log of a still sensor."""
    noise = np.random.default_rng(1).standard_normal((N, 3)) * 1e-3
    return [HEADER, *(f"{k / 100:.2f},{x:.5f},{y:.5f},{1 + z:.5f}" for k, (x, y, z) in enumerate(noise))]


def imported(tmp_path: Path, given: list[str | bytes], policy: Policy = "few", end: bytes = b"\n") -> ImportedTable:
    path = tmp_path / "log.csv"
    path.write_bytes(b"\n".join(line.encode() if isinstance(line, str) else line for line in given) + end)
    return import_sheet(replace(read_sheet(open_text_file(path, garbled=True)), skipped=SHARES[policy]), "still")


@pytest.mark.parametrize(
    ("damaged", "shown"),
    [
        ("30.01,0.1,0.2", "line 3001 (3 values for 4 columns)"),
        ("30.01,0.1,0.2,0.9,7", "line 3001 (5 values for 4 columns)"),
        ("30.01,0.1,0.2x3,0.9", "line 3001 (ay is '0.2x3')"),
        ("30.01,0.1,nan,0.9", "line 3001 (ay is 'nan')"),
        (HEADER, "line 3001 (the header again)"),
        (b"30.01,0.1,\xff\xfe2,0.9", "line 3001 (ay is '\ufffd\ufffd2')"),
    ],
)
def test_a_damaged_line_is_skipped_and_shown(tmp_path: Path, damaged: str | bytes, shown: str) -> None:
    given: list[str | bytes] = [*lines()]
    given[3000] = damaged
    found = imported(tmp_path, given)
    assert found.table.n == N - 1
    assert 29.99 not in found.table.column("t_s")
    assert {29.98, 30.0} <= set(found.table.column("t_s"))
    (note,) = found.notes
    assert note.endswith(f"1 of {N} lines is damaged and was skipped: {shown}.")
    assert "damaged_lines" in found.settings


@pytest.mark.parametrize("garbled", [b"\x00\x13arb,led", b"\xff\x00\x00\x81,0.1,\x9d2,0.9", b"\x811.00,0.1,0.2,0.9"])
@pytest.mark.parametrize("line", [12, 300, 3900])
def test_a_line_garbled_on_the_wire_is_skipped_wherever_it_is(tmp_path: Path, garbled: bytes, line: int) -> None:
    given: list[str | bytes] = [*lines()]
    given[line] = garbled
    found = imported(tmp_path, given)
    assert found.table.n == N - 1
    assert f"1 of {N} lines is damaged and was skipped: line {line + 1} (" in found.notes[0]
    with pytest.raises(DataError, match=r"log\.csv"):
        imported(tmp_path, given, "refuse")


def test_a_log_without_damage_has_no_remark(tmp_path: Path) -> None:
    found = imported(tmp_path, [*lines()])
    assert (found.notes, found.table.n) == ((), N)


@pytest.mark.parametrize("row", [1, 50])
def test_a_damaged_line_among_the_first_does_not_hide_its_column(tmp_path: Path, row: int) -> None:
    given: list[str | bytes] = [*lines()]
    given[row] = "0.0,?,0.2,0.9"
    assert imported(tmp_path, given).table.column("ax").shape == (N - 1,)


def test_the_strict_policy_refuses_the_first_damaged_line(golden, tmp_path: Path) -> None:
    given: list[str | bytes] = [*lines()]
    given[1000] = given[1500] = "10,0.1"
    with golden.refused(DataError):
        imported(tmp_path, given, "refuse")


def test_many_damaged_lines_are_refused_unless_a_person_skips_them(tmp_path: Path) -> None:
    given: list[str | bytes] = [*lines()]
    for k in range(100, N, 20):
        given[k] = "cut"
    with pytest.raises(DataError, match=r"line 101: .*195 of 4000 lines are damaged, and at most 1 % .*; --bad-lines"):
        imported(tmp_path, given)
    found = imported(tmp_path, given, "skip")
    assert found.table.n == N - 195
    assert found.notes[0].endswith("line 101 (1 values for 4 columns), line 121 (1 values for 4 columns), "
                                   "line 141 (1 values for 4 columns) and 192 more.")  # fmt: skip


def test_more_than_half_is_refused_in_any_case(golden, tmp_path: Path) -> None:
    given: list[str | bytes] = [*lines()]
    given[300:2600] = ["?,?,?,?"] * 2300
    with golden.refused(DataError):
        imported(tmp_path, given, "skip")


def test_an_open_quote_does_not_hide_the_lines_that_it_swallows(tmp_path: Path) -> None:
    given: list[str | bytes] = [*lines()]
    given[1000] = '10.0,"0.1,0.2,0.9'
    with pytest.raises(DataError, match=r"300\d of 400\d lines are damaged"):
        imported(tmp_path, given)


@pytest.mark.parametrize(("form", "lost"), [("{:.5f}", 3), ("{:.3e}", 4), ("{:.0f}", 2)])
def test_a_last_line_that_was_cut_in_its_last_number_is_skipped_and_shown(tmp_path: Path, form: str, lost: int) -> None:
    rows = [row.rpartition(",")[0] + "," + form.format(1e3 + k) for k, row in enumerate(lines()[1:])]
    given: list[str | bytes] = [HEADER, *rows]
    assert imported(tmp_path, given).table.n == N
    cut: list[str | bytes] = [HEADER, *rows[:-1], rows[-1][:-lost]]
    found = imported(tmp_path, cut, end=b"")
    assert found.table.n == N - 1
    last = rows[-1][:-lost].rpartition(",")[2]
    assert found.notes[0].endswith(f"was skipped: line {N + 1} (no line end, and {last} may be cut).")
    with pytest.raises(DataError, match=rf"line {N + 1}, the last: no line end, and .* may be cut; complete it and"):
        imported(tmp_path, cut, "refuse", end=b"")


def test_a_last_line_whose_number_is_complete_needs_no_line_end(tmp_path: Path) -> None:
    found = imported(tmp_path, [*lines()], end=b"")
    assert (found.notes, found.table.n) == ((), N)
    assert imported(tmp_path, [*lines()[:30]], end=b"").table.n == 29


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_numbers_of_different_lengths_are_taken_without_a_line_end_where_lines_are_refused(
    tmp_path: Path, scale: float
) -> None:
    values = scale * np.random.default_rng(2).standard_normal(N)
    given: list[str | bytes] = [
        HEADER,
        *(f"{k / 100:.2f},0.1,0.2,{value!r}" for k, value in enumerate(values.tolist())),
    ]
    assert imported(tmp_path, given, "refuse", end=b"").table.n == N
    with_steps: list[str | bytes] = [HEADER, *(f"{k / 100:.2f},1,2,{k % 900 + 5}" for k in range(N))]
    assert imported(tmp_path, with_steps, "refuse", end=b"").table.n == N
    lost_its_exponent = [*given[:-1], f"{N / 100:.2f},0.1,0.2,{20 * abs(values).max():.3f}"]
    if scale < 1:
        with pytest.raises(DataError, match="no line end"):
            imported(tmp_path, lost_its_exponent, "refuse", end=b"")


def test_a_cut_last_line_of_named_values_is_shown(tmp_path: Path) -> None:
    given: list[str | bytes] = [f"t_s:{k / 100:.2f},ax:0.10{k % 7},ay:0.200,az:0.98{k % 3}" for k in range(N)]
    assert imported(tmp_path, given, end=b"").table.n == N
    given[-1] = str(given[-1])[:-2]
    found = imported(tmp_path, given, end=b"")
    assert found.table.n == N - 1
    assert "no line end, and 0.9 may be cut" in found.notes[0]
