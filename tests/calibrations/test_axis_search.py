"""The estimate of the axes: exact where all that acts is in it, and as certain as it says where there is noise."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.analyses.misalignment import (
    along_reference,
    correction_matrix,
    estimate_directions,
    non_orthogonality_deg,
    search_angles_x,
    search_angles_y,
)
from calibrations.errors import DataError
from calibrations.table import Array, Table
from procedures.misalignment import Centre, round_poses


def direction_x(alpha_deg: float, beta_deg: float) -> Array:
    """Ry(alpha) Rz(beta) [1 0 0]: Ang (18), with his x_ref set right."""
    (sin_a, sin_b), (cos_a, cos_b) = np.sin(r := np.radians([alpha_deg, beta_deg])), np.cos(r)
    return np.array([cos_a * cos_b, sin_b, -sin_a * cos_b])


def direction_y(alpha_deg: float, beta_deg: float) -> Array:
    """Rx(alpha) Rz(beta) [0 1 0]: Ang (19)."""
    (sin_a, sin_b), (cos_a, cos_b) = np.sin(r := np.radians([alpha_deg, beta_deg])), np.cos(r)
    return np.array([-sin_b, cos_a * cos_b, sin_a * cos_b])


X, Y = direction_x(0.75, -0.33), direction_y(0.75, 0.5)
WHITE_V = 50e-6
N = 5000


def search(centre: Centre = Centre(), rounds: int = 2, *, acts: float = 0.0, random: object = None) -> Table:  # noqa: B008
    """A search without a rig: the loads along X and Y at about 1 V/g, and `acts` times all else that may act."""
    poses = [pose for k in range(1, rounds + 1) for pose in round_poses(centre, k)]
    a, b = (np.radians([getattr(p, name) for p in poses]) for name in ("alpha_deg", "beta_deg"))
    load = np.column_stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
    t_s = 10.0 * np.arange(len(poses))
    supply_v = 5 + acts * 1e-4 * np.sin(t_s / 50)
    columns = {"alpha_deg": np.degrees(a), "beta_deg": np.degrees(b), "t_s": t_s, "supply_v": supply_v}
    for axis, theta, gain, own_deg in (("x", X, 0.97, 0.0), ("y", Y, 1.02, 90.0)):
        own = b - np.radians(centre.beta_deg + own_deg)
        even = load @ np.diag([2e-3, -5e-3, 4e-3]) * load
        level = 1e-3 * np.sin(own) + 2e-3 * np.cos(a) * np.cos(own)  # tilt of the base, zero of alpha
        hysteresis = 4e-3 * np.cos(a) ** 2 * np.cos(own)
        slow = 2e-4 * t_s / t_s[-1] + (0.5 + 0.2 * np.sin(a) * np.cos(own)) * (supply_v - 5)
        volts = 2.5 + gain * load @ theta + acts * (even.sum(axis=1) + level + hysteresis + slow)
        if isinstance(random, np.random.Generator):
            volts = volts + WHITE_V * random.standard_normal(len(poses))
        columns |= {f"v{axis}_v": volts, f"v{axis}_std_v": np.full(len(poses), WHITE_V * np.sqrt(N))}
    columns |= {"n": np.full(len(poses), float(N))}
    return Table.from_columns("poses", columns, {}, "search", {"path": tuple(p.path for p in poses)})


@pytest.mark.slow
@pytest.mark.parametrize("centre", [Centre(), Centre(3, (-2, 4)), Centre(-170)])
def test_directions_are_exact_without_noise(centre: Centre) -> None:
    found = estimate_directions(search(centre))
    np.testing.assert_allclose(found["x"].theta, X, atol=1e-9)
    np.testing.assert_allclose(found["y"].theta, Y, atol=1e-9)


def test_what_else_acts_is_not_taken_for_misalignment() -> None:
    found = estimate_directions(search(acts=1.0))
    np.testing.assert_allclose(found["x"].theta, X, atol=1e-8)
    np.testing.assert_allclose(found["y"].theta, Y, atol=1e-8)


def test_the_angles_are_those_of_ang() -> None:
    found = estimate_directions(search())
    for axis, theta, angles in (("x", X, search_angles_x), ("y", Y, search_angles_y)):
        alpha_deg, beta_deg = np.degrees([np.arccos(theta[2]), np.arctan2(theta[1], theta[0])])
        np.testing.assert_allclose(found[axis].angles_deg, angles(alpha_deg, beta_deg), atol=1e-6)


@pytest.mark.slow
def test_errors_of_directions_are_as_large_as_their_standard_errors() -> None:
    """300 searches with white noise: errors over standard errors, of all 10 numbers."""
    random = np.random.default_rng(3)
    ratios = []
    for _ in range(300):
        found = estimate_directions(search(acts=1.0, random=random))
        for axis, theta, angles in (("x", X, [0.75, -0.33]), ("y", Y, [0.75, 0.5])):
            direction = found[axis]
            off = [*(direction.theta - theta)[[2, 1 if axis == "x" else 0]], *(direction.angles_deg - angles)]
            variance = [*np.diag(direction.covariance)[[2, 1 if axis == "x" else 0]]]
            ratios.append(np.array(off) / np.sqrt([*variance, *np.diag(direction.angles_covariance_deg2)]))
    assert np.sqrt(np.mean(np.square(ratios), axis=0)) == pytest.approx(1.0, abs=0.1)


def test_a_search_is_judged_by_the_rounds_about_its_last_centre() -> None:
    first, last = search(Centre(9), 1), search(rounds=2)
    joined = {name: np.append(first.column(name), last.column(name)) for name in last.columns}
    joined["t_s"] = np.arange(48.0)
    joined["vx_v"][:16] += 1.0
    later = [f"{path.split()[0]} {int(path.split()[1]) + 1}" for path in last.labels["path"]]
    table = Table.from_columns("poses", joined, {}, "", {"path": (*first.labels["path"], *later)})
    found = estimate_directions(table)
    assert found["x"].rounds == 2
    np.testing.assert_allclose(found["x"].theta, X, atol=1e-9)


def test_the_angle_between_the_axes_does_not_depend_on_the_zero_of_beta() -> None:
    found = estimate_directions(search(random=np.random.default_rng(1)))
    value, std = non_orthogonality_deg(found["x"], found["y"])
    assert value == pytest.approx(np.degrees(np.arcsin(X @ Y)), abs=4 * std)
    assert 0 < std < 0.003


def test_the_correction_is_that_of_ang() -> None:
    a = np.random.default_rng(1).uniform(-1, 1, (5, 3))
    np.testing.assert_allclose(a @ correction_matrix(X, Y).T, along_reference(a, X, Y), atol=1e-15)


def test_a_search_without_a_complete_round_is_refused(golden) -> None:
    table = search(rounds=1)
    half = {name: column[:15] for name, column in table.columns.items()}
    with golden.refused(DataError):
        estimate_directions(Table.from_columns("poses", half, {}, "half", {"path": table.labels["path"][:15]}))
    with golden.refused(DataError):
        estimate_directions(Table.from_columns("poses", half, {}, "half"))


def test_correction_to_the_reference_axes() -> None:
    """Exact to first order in the tilts; 1 deg of tilt leaves less than 0.1 mg per g of each other axis."""
    a = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    felt = np.column_stack([a @ X, a @ Y, a[:, 2]])
    np.testing.assert_allclose(along_reference(felt, X, Y), a[:, :2], atol=3e-4)
    leaning = along_reference(np.array([[0.1, 0.2, 0.3]]), np.array([1.0, 0.01, 0.02]), np.array([0.03, 1.0, 0.04]))
    across = 0.1 - 0.01 * 0.2 - 0.02 * 0.3
    np.testing.assert_allclose(leaning, [[across, 0.2 - 0.03 * across - 0.04 * 0.3]], atol=1e-15)
