"""Ang's equations (1)-(17) on data that the equations themselves have made: the answers are exact."""

from __future__ import annotations

import re

import numpy as np
import pytest

from calibrations.analyses.stepwise import AxisEstimate, estimate_stepwise
from calibrations.errors import DataError, MissingColumn
from calibrations.table import Array, Table
from tests.calibrations import synthetic

SF, B = {"x": 1.013, "y": 0.987}, {"x": 2.513, "y": 2.474}
Q, R = (0.031, -0.004, 0.0), (0.021, 0.0017)  # h(0) = 0, as it is a difference from 90 deg; r0 is SF


def table(vx: Array, vy: Array, columns: dict[str, Array] | None = None) -> Table:
    return synthetic.poses(columns or synthetic.turns(), vx, vy, seed=None)


def crossed(square: float, other_bias: float) -> tuple[float, float, float]:
    """p of a quadratic that vanishes at the other axis's zero-g output, as (2) at 90 deg requires."""
    linear = 0.006
    return square, linear - 2 * square * other_bias, square * other_bias**2 - linear * other_bias


def acceleration(axis: AxisEstimate, v: Array, other_output: Array, a_z: Array) -> Array:
    """Ang (14), (16)."""
    bias = axis.bias + np.polyval(axis.p, other_output) + np.polyval(axis.q, a_z)
    return (v - bias) / np.polyval(axis.r, a_z)


@pytest.mark.parametrize("own", ["x", "y"])
def test_all_coefficients_of_an_axis_beside_a_linear_one(own: str) -> None:
    columns = synthetic.turns()
    a_x, a_y, a_z = synthetic.components(columns)
    other = "y" if own == "x" else "x"
    a, across = (a_x, a_y) if own == "x" else (a_y, a_x)
    v_other = SF[other] * across + B[other]
    p, r = crossed(0.011, B[other]), (*R, SF[own])
    v = np.polyval(r, a_z) * a + B[own] + np.polyval(p, v_other) + np.polyval(Q, a_z)
    found = estimate_stepwise(table(v if own == "x" else v_other, v_other if own == "x" else v, columns))
    axis = getattr(found, own)
    assert axis.bias == pytest.approx(B[own], abs=1e-12)
    assert axis.scale == pytest.approx(SF[own], abs=1e-12)
    np.testing.assert_allclose(axis.p, p, atol=1e-10)
    np.testing.assert_allclose(axis.q, Q, atol=1e-10)
    np.testing.assert_allclose(axis.r, r, atol=1e-10)
    np.testing.assert_allclose(found.rmse_v, 0, atol=1e-10)
    np.testing.assert_allclose(acceleration(axis, v, v_other, a_z), a, atol=1e-11)


def test_stepwise_estimates_hold_where_both_axes_bend_with_each_other() -> None:
    """Each axis bends with the other's output; the roots of each quadratic lie where (2) looks, found by iteration."""
    columns = synthetic.turns()
    square = {"x": 0.013, "y": -0.009}
    x_at, y_at = [B["x"]] * 2, [B["y"]] * 2  # output of x where y is up and down, and of y where x is

    def bend(k: float, v: Array | float, roots: list[float]) -> Array | float:
        return k * (v - roots[0]) * (v - roots[1])

    for _ in range(50):
        y_at = [B["y"] + bend(square["y"], B["x"] + s * SF["x"], x_at) for s in (1, -1)]
        x_at = [B["x"] + bend(square["x"], B["y"] + s * SF["y"], y_at) for s in (1, -1)]
    a_x, a_y, _ = synthetic.components(columns)
    vx, vy = B["x"] + SF["x"] * a_x, B["y"] + SF["y"] * a_y
    for _ in range(50):
        vx = B["x"] + SF["x"] * a_x + bend(square["x"], vy, y_at)
        vy = B["y"] + SF["y"] * a_y + bend(square["y"], vx, x_at)
    found = estimate_stepwise(table(vx, vy, columns))
    for axis, roots in (("x", y_at), ("y", x_at)):
        k = square[axis]
        np.testing.assert_allclose(getattr(found, axis).p, [k, -k * sum(roots), k * roots[0] * roots[1]], atol=1e-10)
    upright = columns["alpha_deg"] == 90
    np.testing.assert_allclose(found.predicted[upright], np.column_stack([vx, vy])[upright], atol=1e-12)


def test_stepwise_estimates_of_a_linear_sensor_leave_nothing() -> None:
    columns = synthetic.turns()
    a_x, a_y, _ = synthetic.components(columns)
    found = estimate_stepwise(table(SF["x"] * a_x + B["x"], SF["y"] * a_y + B["y"], columns))
    np.testing.assert_allclose(found.linear_rmse_v, 0, atol=1e-12)


def test_repeats_are_averaged_and_the_linear_error_stands_beside() -> None:
    columns = synthetic.turns()
    a_x, a_y, _ = synthetic.components(columns)
    loop = 0.01 * columns["direction"]
    vx, vy = SF["x"] * a_x + B["x"] + loop, SF["y"] * a_y + B["y"]
    found = estimate_stepwise(table(vx, vy, columns))
    assert found.x.bias == pytest.approx(B["x"], abs=1e-12)  # both directions: the loop's middle
    assert found.linear_rmse_v[0] == pytest.approx(0.01, rel=1e-9)


def test_negative_inclinations_and_turned_mounts_find_their_places() -> None:
    columns = synthetic.turns((90, -90, 30, -30, 150))
    turned = {**columns, "beta_deg": columns["beta_deg"] - 40.0, "mount_deg": np.full(len(columns["t_s"]), 40.0)}
    a_x, a_y, a_z = synthetic.components(columns)
    vx, vy = SF["x"] * a_x + B["x"] + np.polyval(Q, a_z), SF["y"] * a_y + B["y"]
    for given in (columns, turned):
        np.testing.assert_allclose(estimate_stepwise(table(vx, vy, given)).x.q, Q, atol=1e-10)


def test_a_tilt_ends_up_in_p1_and_q1() -> None:
    """A sensing axis that leans by theta: (14) has already taken off what (20) subtracts."""
    columns = synthetic.turns()
    a_x, a_y, a_z = synthetic.components(columns)
    theta_xy, theta_xz = -0.0058, -0.0131
    vx = SF["x"] * (a_x + theta_xy * a_y + theta_xz * a_z) + B["x"]
    vy = SF["y"] * a_y + B["y"]
    found = estimate_stepwise(table(vx, vy, columns))
    tilt, none = found.tilts
    assert tilt.in_plane == pytest.approx(theta_xy, abs=1e-10)
    assert tilt.out_of_plane == pytest.approx(theta_xz, abs=1e-10)
    assert tilt.twice_mg == pytest.approx(1e3 * np.sqrt(np.mean((theta_xy * a_y + theta_xz * a_z) ** 2)))
    np.testing.assert_allclose(acceleration(found.x, vx, vy, a_z), a_x, atol=1e-11)
    assert none.twice_mg == pytest.approx(0, abs=1e-9)


def lacking(columns: dict[str, Array]) -> Table:
    a_x, a_y, _ = synthetic.components(columns)
    return table(a_x + 2.5, a_y + 2.5, columns)


@pytest.mark.parametrize(
    ("inclinations", "absent", "says"),
    [
        ((30, 60, 120), None, "alpha = 90, beta = 0 and 180 deg, where x is held up and down"),
        ((90, 30, 150), (90, 0), "alpha = 90, beta = 0 and 180 deg"),
        ((90, 30, 150), (90, 180), "alpha = 90, beta = 0 and 180 deg"),
        ((90, 30, 150), (90, 90), "alpha = 90, beta = 90 and 270 deg, where y is held up and down"),
        ((90, 30, 150), (90, 270), "alpha = 90, beta = 90 and 270 deg"),
        ((90, 30), None, "three inclinations with poses at beta = 0 and 180 deg; it has 30 and 90 deg"),
        ((90, 30, 150), (30, 90), "three inclinations with poses at beta = 90 and 270 deg; it has 90 and 150 deg"),
    ],
)
def test_says_which_poses_are_missing(
    inclinations: tuple[float, ...], absent: tuple[float, float] | None, says: str
) -> None:
    columns = synthetic.turns(inclinations)
    if absent:
        there = (columns["alpha_deg"] != absent[0]) | (columns["beta_deg"] % 360 != absent[1])
        columns = {name: values[there] for name, values in columns.items()}
    with pytest.raises(DataError, match=re.escape(says)):
        estimate_stepwise(lacking(columns))


def test_needs_poses_and_both_outputs(golden) -> None:
    columns = synthetic.turns()
    one = Table.from_columns("poses", {**columns, "vx_v": columns["beta_deg"]}, source="one.csv")
    with golden.refused(MissingColumn):
        estimate_stepwise(one)
    with golden.refused(DataError):
        estimate_stepwise(Table.from_columns("positions", {"ax": [1.0], "ay": [0.0], "az": [0.0]}))
