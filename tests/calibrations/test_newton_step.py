"""A step of least squares: damped, within bounds, and the shortest where columns are alike."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from calibrations.fitting.minimise import newton_step
from calibrations.model.parameters import Layout
from calibrations.table import Array

P = 4
RANDOM = np.random.default_rng(3)
SLOPE = RANDOM.standard_normal((40, P)) * 10.0 ** np.arange(P)
RESIDUAL = RANDOM.standard_normal(40)


def first_steps(slope: Array, residual: Array, low: Array | None = None, high: Array | None = None) -> list[Array]:
    """The steps that are tried, each of which is refused, in the order of their damping."""
    low, high = (np.full(P, edge) if given is None else given for given, edge in ((low, -np.inf), (high, np.inf)))
    layout, tried = SimpleNamespace(bounds=(low, high), typical=np.ones(P)), list[Array]()

    def refused(theta: Array) -> Array:
        tried.append(theta)
        return 2 * residual

    theta, least = newton_step(cast(Layout, layout), refused, np.zeros(P), residual, slope)
    assert not theta.any()
    assert least is residual
    return tried


def damped(damping: float, slope: Array = SLOPE) -> tuple[Array, Array]:
    """The rows of a damped problem: those of the data, and one for each column by its length."""
    size = np.linalg.norm(slope, axis=0)
    return np.vstack([slope, np.diag(np.sqrt(damping) * size)]), np.append(-RESIDUAL, np.zeros(P))


def test_each_step_solves_its_damped_problem() -> None:
    steps = first_steps(SLOPE, RESIDUAL)
    for step, damping in zip(steps, (0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0), strict=True):
        expected = np.linalg.lstsq(*damped(damping), rcond=None)[0]
        np.testing.assert_allclose(step, expected, rtol=1e-9)


@pytest.mark.parametrize("number", [0, 3])
def test_a_step_ends_at_a_bound_and_the_others_make_up_for_it(number: int) -> None:
    damping = (0.0, 1e-3, 1e-2, 0.1)[number]
    free = first_steps(SLOPE, RESIDUAL)[number]
    high = np.full(P, np.inf)
    high[0] = free[0] / 2 if free[0] > 0 else np.inf
    low = np.full(P, -np.inf)
    low[0] = free[0] / 2 if free[0] < 0 else -np.inf
    expected = lsq_linear(*damped(damping), bounds=(low, high), tol=1e-14).x
    np.testing.assert_allclose(first_steps(SLOPE, RESIDUAL, low, high)[number], expected, rtol=1e-6)


def test_what_changes_nothing_stays() -> None:
    slope = SLOPE.copy()
    slope[:, 1] = 0.0
    for step in first_steps(slope, RESIDUAL):
        assert step[1] == 0.0
        assert np.isfinite(step).all()
