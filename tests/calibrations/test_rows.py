"""Rows that a file repeats, and rows whose clock starts again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import calibrations as cal
from calibrations.importing.foreign import sort_out_rows, write_csv
from calibrations.table import Table

DAY_S = np.arange(40) * 10.0


def table(t_s: np.ndarray) -> Table:
    n = len(t_s)
    columns = {"alpha_deg": np.full(n, 90.0), "beta_deg": np.arange(n) * 1.0, "vx_v": np.arange(n) / n, "t_s": t_s}
    return Table.from_columns("poses", columns, {}, "two days")


def test_times_continue_where_the_clock_starts_again() -> None:
    one, remarks = sort_out_rows(table(np.concatenate([DAY_S, DAY_S + 5.0])))
    assert one.column("t_s").tolist() == [*DAY_S, *(DAY_S + 400.0)]
    assert one.order.tolist() == list(range(80))
    (remark,) = remarks
    assert remark == (
        "two days: t_s starts again at row 41. The rows from there on are taken as measured directly after the rows "
        "before; if they are of another sensor, separate the file."
    )


@pytest.mark.parametrize(
    "t_s",
    [
        DAY_S,
        np.concatenate([DAY_S + 400.0, DAY_S]),  # the second half of a file stands first
        np.random.default_rng(1).permutation(80) * 10.0,  # rows without an order
    ],
    ids=["in order", "parts in another order", "rows in no order"],
)
def test_times_of_one_clock_stay(t_s: np.ndarray) -> None:
    one, remarks = sort_out_rows(table(t_s))
    assert one.column("t_s").tolist() == t_s.tolist()
    assert not remarks


def test_a_file_that_stands_twice_in_itself_is_used_once() -> None:
    day = table(DAY_S)
    twice = day.rows(np.concatenate([np.arange(40), np.arange(40)]))
    one, remarks = sort_out_rows(twice)
    assert one.n == 40
    assert remarks[0].startswith("two days: rows 41 (as 1), 42 (as 2), 43 (as 3) and 37 more copy earlier rows")


def test_a_library_user_is_warned(tmp_path: Path) -> None:
    write_csv(table(np.concatenate([DAY_S, DAY_S])), tmp_path / "days.csv")
    with pytest.warns(UserWarning, match="t_s starts again at row 41"):
        assert cal.read(tmp_path / "days.csv").column("t_s")[-1] == 790.0
