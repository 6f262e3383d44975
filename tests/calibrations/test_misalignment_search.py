"""Ang (18)-(21) with the printed numbers."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.analyses.misalignment import along_reference, search_angles_x, search_angles_y, theta_x, theta_y


def test_printed_theta_x() -> None:
    np.testing.assert_allclose(theta_x(0.75, -0.33), [0.9999, -0.0058, -0.0131], atol=5e-5)


def test_the_printed_x_ref_does_not_give_it() -> None:
    """(18) prints x_ref = [0 0 1]: the same rotations of that vector are nowhere near the printed Theta_x."""
    a = np.radians(0.75)
    assert np.array([np.sin(a), 0.0, np.cos(a)]) @ theta_x(0.75, -0.33) < 0.01


def test_two_facts_about_theta_y_that_do_not_agree() -> None:
    """(19) printed with alpha_y = 0.75, beta_y = 0.5 deg and Theta_y = [-0.0029 0.9999 0.0131]."""
    from_printed_angles = theta_y(0.75, 0.5)
    np.testing.assert_allclose(from_printed_angles, [-0.0087, 0.9999, 0.0131], atol=6e-5)
    np.testing.assert_allclose(theta_y(0.75, 0.166), [-0.0029, 0.9999, 0.0131], atol=5e-5)


@pytest.mark.parametrize("make", [theta_x, theta_y])
def test_unit_vectors(make: object) -> None:
    assert np.linalg.norm(make(7.0, -11.0)) == pytest.approx(1, abs=1e-15)


def greatest(direction: np.ndarray) -> tuple[float, float]:
    """Stage angles (alpha, beta) in deg at which specific force along `direction` is greatest."""
    return float(np.degrees(np.arccos(direction[2]))), float(np.degrees(np.arctan2(direction[1], direction[0])))


def test_from_the_stage_angles_of_the_extreme() -> None:
    x, y = theta_x(0.75, -0.33), theta_y(0.75, 0.5)
    np.testing.assert_allclose(search_angles_x(*greatest(x)), [0.75, -0.33], atol=1e-4)
    np.testing.assert_allclose(search_angles_y(*greatest(y)), [0.75, 0.5], atol=1e-4)


def test_correction_to_the_reference_axes() -> None:
    """Exact to first order in the tilts; 1 deg of tilt leaves less than 0.1 mg per g of each other axis."""
    x, y = theta_x(0.75, -0.33), theta_y(0.75, 0.5)
    a = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    felt = np.column_stack([a @ x, a @ y, a[:, 2]])
    np.testing.assert_allclose(along_reference(felt, x, y), a[:, :2], atol=3e-4)
    leaning = along_reference(np.array([[0.1, 0.2, 0.3]]), np.array([1.0, 0.01, 0.02]), np.array([0.03, 1.0, 0.04]))
    across = 0.1 - 0.01 * 0.2 - 0.02 * 0.3
    np.testing.assert_allclose(leaning, [[across, 0.2 - 0.03 * across - 0.04 * 0.3]], atol=1e-15)
