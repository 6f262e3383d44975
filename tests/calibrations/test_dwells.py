"""Raw samples of poses: found as such, grouped into dwells, averaged with the noise that they show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.signal import lfilter

from calibrations.errors import DataError
from calibrations.importing.raw_logs import average_dwells, find_dwells, is_pose_log
from calibrations.table import Array, Table

RATE_HZ = 100.0
ROWS = 400  # of a dwell
NOISE_V = 1e-3
TURN = [(90.0, 0.0), (90.0, 60.0), (90.0, 120.0), (90.0, 60.0), (90.0, 0.0), (30.0, 0.0), (30.0, 60.0)]


def log(
    poses: Sequence[tuple[float, float]] = TURN,
    *,
    speed_deg_s: float = 0.0,
    jitter_deg: float = 0.0,
    rho: float = 0.0,
    times: bool = True,
    **more: Array,
) -> Table:
    """Samples of a sensor held at `poses`; with a speed, also those on the way from one to the next."""
    rng = np.random.default_rng(3)
    pieces = []
    for k, pose in enumerate(poses):
        if k and speed_deg_s:
            way = np.subtract(pose, poses[k - 1])
            steps = int(np.abs(way).max() / speed_deg_s * RATE_HZ)
            pieces.append(poses[k - 1] + np.linspace(0, 1, steps + 2)[1:-1, None] * way)
        pieces.append(np.tile(pose, (ROWS, 1)))
    alpha, beta = (np.concatenate(pieces) + jitter_deg * rng.uniform(-0.5, 0.5, (sum(map(len, pieces)), 2))).T
    noise = lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.standard_normal(len(alpha)))
    columns = {"alpha_deg": alpha, "beta_deg": beta, "vx_v": 2.5 + np.cos(np.radians(beta)) + NOISE_V * noise, **more}
    columns |= {"t_s": np.arange(len(alpha)) / RATE_HZ} if times else {}
    return Table.from_columns("poses", columns, source="log.csv")


@pytest.mark.parametrize("jitter_deg", [0.0, 0.02])
@pytest.mark.parametrize("speed_deg_s", [0.0, 0.5, 5.0, 20.0])
def test_each_dwell_of_a_log_becomes_a_row(speed_deg_s: float, jitter_deg: float) -> None:
    samples = log(speed_deg_s=speed_deg_s, jitter_deg=jitter_deg)
    assert is_pose_log(samples)
    table = average_dwells(samples)
    assert np.column_stack([table.column("alpha_deg"), table.column("beta_deg")]) == pytest.approx(
        np.array(TURN), abs=0.01
    )
    expected = 2.5 + np.cos(np.radians([beta for _, beta in TURN]))
    assert table.column("vx_v") == pytest.approx(expected, abs=5 * NOISE_V / np.sqrt(ROWS * 0.7))
    assert table.column("vx_std_v") == pytest.approx(np.full(7, NOISE_V), rel=0.2)
    assert table.number("samples", 0.0) == samples.n
    assert table.number("sample_rate_hz", 0.0) == pytest.approx(RATE_HZ)


def test_rows_while_the_stages_move_are_left_out() -> None:
    samples = log(speed_deg_s=20.0)
    alpha, beta = samples.column("alpha_deg"), samples.column("beta_deg")
    for a, b in find_dwells(samples):
        assert np.ptp(alpha[a:b]) == np.ptp(beta[a:b]) == 0
    assert set(average_dwells(samples).column("n")[1:-1]) == {ROWS - 2 * 20.0}  # 0.2 s off either end
    assert set(average_dwells(log()).column("n")) == {float(ROWS)}  # where nothing moves, nothing is taken off


def test_a_creeping_stage_is_not_taken_for_a_resting_one() -> None:
    creeping = log([(90.0, 0.0), (90.0, 2.0), (90.0, 4.0)], speed_deg_s=0.08)  # 0.04 deg in as many rows as a dwell has
    assert average_dwells(creeping).column("beta_deg") == pytest.approx(np.array([0.0, 2.0, 4.0]), abs=0.02)


def test_time_is_the_middle_and_other_columns_are_averaged() -> None:
    samples = log(temperature_c=np.linspace(20, 27, ROWS * len(TURN)))
    table = average_dwells(samples)
    assert table.column("t_s") == pytest.approx((np.arange(7) + 0.5) * ROWS / RATE_HZ - 0.5 / RATE_HZ)
    assert table.column("temperature_c") == pytest.approx(20.5 + np.arange(7), abs=2e-3)


def test_the_direction_follows_from_beta() -> None:
    assert average_dwells(log()).column("direction").tolist() == [0, 1, 1, -1, -1, 0, 1]
    assert "direction" not in average_dwells(log(TURN[:3]))


def test_a_given_direction_parts_dwells_at_one_pose() -> None:
    turning = np.repeat([1.0, 1.0, -1.0], ROWS)
    table = average_dwells(log([(90.0, 0.0), (90.0, 60.0), (90.0, 60.0)], direction=turning))
    assert table.column("direction").tolist() == [1, 1, -1]
    assert table.column("n").tolist() == [ROWS] * 3


def test_a_gap_in_time_parts_dwells_at_one_pose() -> None:
    samples = log([(90.0, 0.0), (90.0, 60.0), (90.0, 60.0)], times=False)
    t_s = np.arange(samples.n) / RATE_HZ + np.repeat([0.0, 2.0, 4.0], ROWS)
    assert average_dwells(Table.from_columns("poses", {**samples.columns, "t_s": t_s})).n == 3
    assert average_dwells(samples).n == 2


@pytest.mark.parametrize("rho", [0.0, 0.8])
def test_the_noise_of_a_mean_is_measured(rho: float) -> None:
    many = [(90.0, float(beta)) for beta in range(0, 360, 4)]
    assert average_dwells(log(many, rho=rho)).number("noise_inflation_x", 0.0) == pytest.approx(
        (1 + rho) / (1 - rho), rel=0.15
    )


def rows(repeats: int, gap_s: float | None, **more: Array) -> Table:
    """Means at seven poses, each measured so many times on end."""
    alpha, beta = np.repeat(np.array(TURN), repeats, axis=0).T
    columns = {"alpha_deg": alpha, "beta_deg": beta, "vx_v": np.cos(np.radians(beta)), **more}
    columns |= {} if gap_s is None else {"t_s": gap_s * np.arange(len(alpha))}
    return Table.from_columns("poses", columns)


@pytest.mark.parametrize(
    "table",
    [
        rows(1, None),
        rows(3, None),
        rows(20, None),
        rows(400, 10.0),
        rows(400, None, n=np.full(2800, 50.0)),
        rows(400, None, vx_std_v=np.full(2800, 1e-3)),
    ],
    ids=["single", "thrice", "twenty times", "a soak with a mean every 10 s", "counted", "with a scatter"],
)
def test_a_table_of_means_is_no_log(table: Table) -> None:
    assert not is_pose_log(table)


def test_a_log_that_only_moves_is_none() -> None:
    beta = np.linspace(0, 360, 5000)
    sweeping = Table.from_columns("poses", {"alpha_deg": np.full(5000, 90.0), "beta_deg": beta, "vx_v": beta})
    assert not is_pose_log(sweeping)
    with pytest.raises(DataError, match="no dwell: alpha and beta never rest for 50 successive rows"):
        average_dwells(sweeping)
