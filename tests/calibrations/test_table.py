"""Tables: what they refuse, what they give, and what makes two of them the same."""

from __future__ import annotations

import re

import numpy as np
import pytest

from calibrations.errors import DataError, MissingColumn
from calibrations.table import Table, guess_kind

POSES = {"alpha_deg": [90.0, 90.0, 30.0], "beta_deg": [0.0, 90.0, 0.0], "vx_v": [3.5, 2.5, 3.0]}


def poses(**more: list[float]) -> Table:
    return Table.from_columns("poses", {**POSES, **more}, source="made.csv")


@pytest.mark.parametrize(
    ("kind", "columns", "says"),
    [
        ("pose", POSES, 'unknown kind of table "pose"; did you mean "poses"?'),
        ("poses", {"alpha_deg": [1.0], "beta_deg": [1.0, 2.0], "vx_v": [1.0]}, "columns of different length"),
        ("poses", {"alpha_deg": [], "beta_deg": [], "vx_v": []}, "the table has no rows"),
        ("poses", {}, "the table has no rows"),
        ("poses", {**POSES, "vx_v": [1.0, np.nan, 2.0]}, 'row 2, column "vx_v" is nan, not a finite number'),
        ("poses", {**POSES, "vx_v": [np.inf, np.nan, 2.0]}, 'row 1, column "vx_v" is inf, not a finite number (and 1'),
        (
            "poses",
            {"alpha": [1.0], "beta_deg": [1.0], "vx_v": [1.0]},
            'the column "alpha_deg"; it has: alpha, beta_deg, vx_v; did you mean "alpha"?',
        ),
        ("poses", {"alpha_deg": [1.0], "beta_deg": [1.0]}, 'a table of poses needs the column "vx_v"; it has:'),
        (
            "positions",
            {"mx": [1.0], "my": [1.0], "m_z": [1.0]},
            'the column "mz"; it has: mx, my, m_z; did you mean "m_z"?',
        ),
    ],
)
def test_impossible_tables_are_refused(kind: str, columns: dict[str, list[float]], says: str) -> None:
    with pytest.raises(DataError, match=re.escape(says)):
        Table.from_columns(kind, columns, source="made.csv")


def test_missing_column_names_the_nearest(golden) -> None:
    with golden.refused(MissingColumn):
        poses().column("beta_dg")
    with golden.refused(MissingColumn):
        poses().column("temperature_c")


def test_a_constant_must_be_a_number() -> None:
    table = Table.from_columns("poses", POSES, {"approach_deg": "5", "serial": "A 7"}, "made.csv")
    assert table.number("approach_deg", 0.0) == 5.0
    with pytest.raises(DataError, match="the constant \"serial\" is 'A 7', not a number"):
        table.number("serial", 0.0)


@pytest.mark.parametrize("name", ["sample_rate_hz", "filter_corner_hz"])
@pytest.mark.parametrize(
    ("value", "says"), [("ten", "'ten', not a number"), (0.0, "0.0; it must be above 0"), (-1.0, "-1")]
)
def test_impossible_constants_are_refused(name: str, value: str | float, says: str) -> None:
    with pytest.raises(DataError, match=f'made.csv: the constant "{name}" is {says}'):
        Table.from_columns("poses", POSES, {name: value}, "made.csv")


EARTH = "which is not gravity at any place on Earth"


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (1.0, f"1, {EARTH}; it looks like g; give it in m/s^2, 9.76 to 9.84"),
        (980.131, f"980.131, {EARTH}; it looks like cm/s^2; give it in m/s^2, 9.76 to 9.84"),
        ("9801.31", f"9801.31, {EARTH}; it looks like mm/s^2; give it in m/s^2, 9.76 to 9.84"),
        (9.75, f"9.75, {EARTH}; give it in m/s^2, 9.76 to 9.84"),
        (-9.81, f"-9.81, {EARTH}; give it in m/s^2, 9.76 to 9.84"),
        ("nan", f"nan, {EARTH}; give it in m/s^2, 9.76 to 9.84"),
        ("9,80131", "'9,80131', not a number; write 9.80131, with a decimal point"),
        ("ten", "'ten', not a number; give it in m/s^2, 9.76 to 9.84"),
    ],
)
def test_a_gravity_that_is_not_of_this_earth_is_refused(value: str | float, says: str) -> None:
    with pytest.raises(DataError) as error:
        Table.from_columns("poses", POSES, {"gravity_m_s2": value}, "made.csv")
    assert str(error.value) == f'made.csv: the constant "gravity_m_s2" is {says}'


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("n", 0.0, "is 0; it must be at least 1: it counts averaged samples"),
        ("vx_std_v", -1e-3, "is -0.001; it must be 0 or more"),
        ("direction", 2.0, r"is 2; it must be 1 \(beta growing\), -1 \(falling\) or 0 \(unknown\)"),
        ("flip", -1.0, r"is -1; it must be 1 \(face down, turned by 180 deg about x\) or 0 \(face up\)"),
    ],
)
def test_impossible_numbers_are_refused_with_their_row(name: str, value: float, says: str) -> None:
    rows = len(next(iter(POSES.values())))
    column = np.ones(rows)
    column[1] = value
    with pytest.raises(DataError, match=f'made.csv: row 2, column "{name}" {says}'):
        Table.from_columns("poses", {**POSES, name: column}, source="made.csv")


def test_columns_of_a_table_are_read_only() -> None:
    table = poses()
    with pytest.raises(ValueError, match="read-only"):
        table.column("vx_v")[0] = 1.0
    with pytest.raises(TypeError):
        table.columns["vx_v"] = np.zeros(3)


def test_a_table_knows_its_axes_unit_and_outputs() -> None:
    table = poses(vy_v=[1.0, 2.0, 3.0])
    assert (table.axes, table.unit, table.outputs.shape) == (("x", "y"), "V", (3, 2))
    raw = Table.from_columns("positions", {"ax": [1.0], "ay": [2.0], "az": [3.0]}, {"unit": "m/s^2"})
    assert (raw.axes, raw.unit) == (("x", "y", "z"), "m/s^2")
    assert poses().optional("flip", 0.0).tolist() == [0.0, 0.0, 0.0]


def test_order_is_that_of_time_and_rows_keep_their_labels() -> None:
    table = Table.from_columns(
        "poses", {**POSES, "t_s": [20.0, 0.0, 10.0]}, source="made.csv", labels={"path": ("a", "b", "c")}
    )
    sorted_rows = table.rows(table.order)
    assert sorted_rows.time_s.tolist() == [0.0, 10.0, 20.0]
    assert sorted_rows.labels["path"] == ("b", "c", "a")
    assert table.rows(np.array([True, False, True])).labels["path"] == ("a", "c")
    assert poses().order.tolist() == [0, 1, 2]
    assert poses().time_s.tolist() == [0.0, 1.0, 2.0]


def test_digest_is_that_of_names_and_values() -> None:
    turned = Table.from_columns("poses", dict(reversed(POSES.items())), source="elsewhere.csv")
    assert poses().digest == turned.digest
    assert poses().digest != poses(vy_v=[0.0, 0.0, 0.0]).digest
    assert poses().digest != Table.from_columns("poses", {**POSES, "vx_v": [3.5, 2.5, 3.1]}).digest


def test_the_kind_of_a_table_is_guessed_from_its_columns() -> None:
    assert guess_kind(POSES) == "poses"
    assert guess_kind(["t_s", "vx_v", "displacement_m", "vy_v"]) == "motion"
    assert guess_kind(["ax", "ay", "az", "gx", "gy", "gz"]) == "positions"
    assert guess_kind(["rate_deg_s", "gx", "gy", "gz"]) == "rates"
    with pytest.raises(MissingColumn, match='the column name is unknown: "bta_deg"; did you mean "beta_deg"'):
        guess_kind(["alpha_deg", "bta_deg", "vx_v"])
    with pytest.raises(MissingColumn, match="do not fit any kind of table; poses need"):
        guess_kind(["when", "humidity"])


def test_a_motion_at_a_known_attitude_is_no_table_of_poses() -> None:
    assert guess_kind(["t_s", "vx_v", "displacement_m", "alpha_deg", "beta_deg"]) == "motion"
