"""Check poses: how often a right model fails them, and that a wrong one does."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.discovery.check_poses import judge_check_poses
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations.synthetic import NOISE_V, components, poses, turns

LINEAR = read_model("linear")


def measured(seed: int, missing: float = 0.0, jump_v: float = 0.0, checks: int = 6) -> Table:
    """A short sweep, each pose of it twice, with check poses; `jump_v` from visit to visit."""
    columns: dict[str, Array] = {name: np.tile(v, 2) for name, v in turns((90, 45), step_deg=45.0).items()}
    columns["t_s"] = np.linspace(0.0, 500.0, len(columns["t_s"]))
    columns["beta_deg"][:checks] += 20.0
    x, y, _ = components(columns)
    jumps: Array = jump_v * np.random.default_rng([seed, 1]).standard_normal((2, len(x)))
    table = poses(columns, 2.5 + x + missing * x**2 + jumps[0], 2.5 + y + jumps[1], seed=seed)
    paths = ["check 1"] * checks + ["design"] * (table.n - checks)
    return Table.from_columns("poses", table.columns, table.constants, "made", {"path": tuple(paths)})


def test_chances_are_even_where_nothing_is_missing() -> None:
    found = [judge_check_poses(LINEAR, measured(seed)) for seed in range(40)]
    chances = np.sort([check.chance for check in found if check is not None])
    assert np.max(np.abs(chances - (np.arange(40) + 0.5) / 40)) < 1.36 / np.sqrt(40)  # Kolmogorov and Smirnov, 5 %
    errors = [check.error for check in found if check is not None]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1, abs=0.1)


def test_a_missing_effect_fails_the_check() -> None:
    check = judge_check_poses(LINEAR, measured(1, missing=10 * NOISE_V))
    assert check is not None
    assert (check.poses, check.passed, check.steady) == (6, False, True)
    assert check.error > 2.5


def test_what_changes_between_visits_is_no_misfit() -> None:
    check = judge_check_poses(LINEAR, measured(2, jump_v=5 * NOISE_V))
    assert check is not None
    assert check.pure_error == pytest.approx(5, rel=0.3)
    assert (check.passed, check.steady) == (True, False)


def test_repeated_check_poses_are_counted() -> None:
    check = judge_check_poses(LINEAR, measured(3))
    assert check is not None
    assert check.repeats == 72 - 36 - 6  # 36 poses, each twice, but for the six check poses


@pytest.mark.parametrize("checks", [0, 2, 72])
def test_too_few_or_all_poses_are_no_check(checks: int) -> None:
    assert judge_check_poses(LINEAR, measured(4, checks=checks)) is None


def test_without_the_noise_of_means_there_is_none_either() -> None:
    table = measured(5)
    columns = {name: values for name, values in table.columns.items() if "std" not in name}
    assert judge_check_poses(LINEAR, Table.from_columns("poses", columns, {}, "made", table.labels)) is None
