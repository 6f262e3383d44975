"""What must not change an answer: the order of rows and columns, the names of the axes."""

from __future__ import annotations

import numpy as np
import pytest

import calibrations as cal
from calibrations.table import Array, Table
from tests.benchmark.hidden import FOLDER
from tests.slow import before_release, first_fast

# none leans: one axis of the plane is the reference
SETS = [*first_fast(["single-010", "pair-270", "triple-305"]), *before_release(["many5-340"])]


def measured(name: str) -> Table:
    table: Table = cal.read(FOLDER / "sets" / f"{name}.csv.gz")
    return table


def answer(table: Table) -> tuple[set[str], set[str], float]:
    """Causes, places, and the error on unseen poses in noise floors."""
    found = cal.discover(table, "linear")
    return set(found.causes), {place.name for place in found.findings.places}, found.end.held_out_excess


def made(columns: dict[str, Array], table: Table) -> Table:
    return Table.from_columns("poses", columns, table.constants, table.source)


def with_axes_named_otherwise(table: Table) -> Table:
    """The mirror image: x is called y and y is called x, and beta turns the other way from 90 deg."""
    other = {name: name.replace("vx_", "v?_").replace("vy_", "vx_").replace("v?_", "vy_") for name in table.columns}
    columns = {other[name]: np.array(values) for name, values in table.columns.items()}
    columns["beta_deg"] = 90.0 - columns["beta_deg"]
    if "direction" in columns:
        columns["direction"] = -columns["direction"]
    return made(columns, table)


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_the_order_of_rows_and_columns_changes_no_answer(name: str) -> None:
    table = measured(name)
    rows = np.random.default_rng(5).permutation(table.n)
    shuffled = {column: table.columns[column][rows] for column in reversed(list(table.columns))}
    causes, places, error = answer(table)
    assert answer(made(shuffled, table)) == (causes, places, pytest.approx(error, rel=1e-6))


@pytest.mark.parametrize("name", SETS)
def test_the_names_of_the_axes_change_no_answer(name: str) -> None:
    table = measured(name)
    causes, places, error = answer(table)
    mirrored = answer(with_axes_named_otherwise(table))
    assert mirrored[:2] == (causes, places)
    assert mirrored[2] == pytest.approx(error, rel=0.02)
