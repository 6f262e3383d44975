"""The error on unseen poses, against an explicit refit without them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from calibrations.discovery.structure import _likelihood_with_effects, likelihood, without_slow
from calibrations.effects.catalogue import catalogue
from calibrations.fitting import refitted
from calibrations.fitting.fit import fit, refit
from calibrations.fitting.solution import folds, held_out
from calibrations.free_forms.bases import spline
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.form import Form
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.means.noise import white_only
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic


def table(square: float = 0.0) -> Table:
    columns = synthetic.turns((90, 30, 150), step_deg=20)
    a_x, a_y, _ = synthetic.components(columns)
    return synthetic.poses(columns, a_x + 2.5 + square * a_x**2, 0.97 * a_y + 2.6)


@pytest.mark.parametrize("square", [0.0, 0.003])
def test_equals_a_refit_without_the_fold(square: float) -> None:
    found = fit(read_model("linear"), table(square))
    a = specific_force(nominal_pose(found.table))
    number = folds(found.table)
    error = np.empty_like(found.residual)
    for k in np.unique(number):
        out = number == k
        for c in range(2):  # one axis's bias and scale factor know nothing of the other's
            X = np.column_stack([np.ones(found.table.n), a[:, c]])
            kept = np.linalg.lstsq(X[~out], found.table.outputs[~out, c], rcond=None)[0]
            error[c, out] = found.table.outputs[out, c] - X[out] @ kept
    explicit = np.sqrt(np.mean(np.mean(error**2, axis=1) / found.noise.floor**2))
    white = white_only(found.problem.white, found.noise.gap_s, 2)
    layout = found.problem.layout
    assert held_out(
        found.residual, found.jacobian, white, number, found.theta, layout.prior, layout.typical, layout.bounds
    ) == pytest.approx(explicit, rel=1e-8)


def test_extra_columns_join_the_fit() -> None:
    found = fit(read_model("linear"), table(0.003))
    column = np.zeros((2, found.table.n, 1))
    column[0, :, 0] = specific_force(nominal_pose(found.table))[:, 0] ** 2
    assert found.held_out_excess > 5
    assert found.held_out_with(column) == pytest.approx(1.0, abs=0.1)


def test_useless_columns_raise_the_unseen_error() -> None:
    found = fit(read_model("linear"), table())
    useless = np.random.default_rng(3).standard_normal((2, found.table.n, 20))
    assert found.held_out_with(useless) > found.held_out_excess


def test_rows_of_one_pose_share_a_fold() -> None:
    data = table()
    number = folds(data)
    for alpha, beta in {*zip(data.column("alpha_deg"), data.column("beta_deg"), strict=True)}:
        here = (data.column("alpha_deg") == alpha) & (data.column("beta_deg") == beta)
        assert len(set(number[here])) == 1
    assert len(np.unique(number)) == 10
    np.testing.assert_array_equal(number, folds(data))


def test_positions_are_left_out_one_by_one() -> None:
    few = Table.from_columns("positions", dict.fromkeys(("ax", "ay", "az"), np.arange(12.0)))
    assert sorted(folds(few)) == list(range(12))


def test_equals_a_refit_without_the_fold_where_parameters_have_priors() -> None:
    """The fit without a fold is solved here with the priors as further rows."""
    data, size = table(0.003), 2e-4
    over = spline(np.linspace(-1.0, 1.0, 50), 8)
    form = Form("own-response", "curve", "own", (over, over), sizes=(size, size))
    start = fit(read_model("linear"), data)
    found = refit(start, start.model.with_effect(free_form((form,))))
    prior = found.problem.layout.prior
    own = np.isfinite(prior)
    rows = np.diag(1 / prior[own])
    J, r, floor = found.jacobian, found.residual, found.noise.floor
    number, error = folds(found.table), np.empty_like(found.residual)
    white = white_only(found.problem.white, found.noise.gap_s, 2)
    for k in np.unique(number):
        kept = number != k
        X = np.vstack([*(J[c, kept] / floor[c] for c in range(2)), np.zeros((own.sum(), len(own)))])
        X[-own.sum() :, own] = rows
        y = np.concatenate([*(r[c, kept] / floor[c] for c in range(2)), found.theta[own] / prior[own]])
        step = np.linalg.lstsq(X, -y, rcond=None)[0]
        error[:, ~kept] = r[:, ~kept] + J[:, ~kept] @ step
    explicit = np.sqrt(np.mean(np.mean(error**2, axis=1) / floor**2))
    layout = found.problem.layout
    assert held_out(r, J, white, number, found.theta, prior, layout.typical, layout.bounds) == pytest.approx(
        explicit, rel=1e-6
    )


def test_a_parameter_without_its_rows_keeps_within_its_bounds() -> None:
    """Without the rows of a fold, the second parameter follows their noise; its bound limits the error on the fold."""
    x = np.linspace(-1.0, 1.0, 40)
    fold = np.where(np.abs(x) > 0.9, 0, 1)
    rare = np.where(fold == 0, 30.0, 1e-3 * np.sign(x))
    J = np.column_stack([x, rare])[None]
    residual = np.random.default_rng(2).standard_normal((1, 40)) - J[:, :, 1]
    noise, theta, prior = white_only(np.ones((1, 40)), np.ones(40), 1), np.zeros(2), np.full(2, np.inf)
    free = (np.full(2, -np.inf), np.full(2, np.inf))
    limited = (np.array([-np.inf, -0.5]), np.array([np.inf, 1.0]))
    wide = np.full(2, 1e6)
    assert held_out(residual, J, noise, fold, theta, prior, wide, free) > 100.0
    assert held_out(residual, J, noise, fold, theta, prior, wide, limited) < 30.0


def test_a_parameter_without_its_rows_changes_by_its_typical_magnitude_at_most() -> None:
    """Two parameters with nearly the same column: only a row of the fold tells them apart."""
    x = np.linspace(-1.0, 1.0, 40)
    fold = np.where(x == x[-1], 0, 1)
    J = np.column_stack([x, x + 1e-5 * x**2 + 0.3 * (fold == 0)])[None]
    residual = np.random.default_rng(2).standard_normal((1, 40))
    noise, theta, prior = white_only(np.ones((1, 40)), np.ones(40), 1), np.zeros(2), np.full(2, np.inf)
    free = (np.full(2, -np.inf), np.full(2, np.inf))
    assert held_out(residual, J, noise, fold, theta, prior, np.full(2, 1e9), free) > 30.0
    assert held_out(residual, J, noise, fold, theta, prior, np.full(2, 1.0), free) < 2.0


def test_parameters_that_their_priors_hold_do_not_count_whole() -> None:
    """A pattern competes with the effects by their number: a free form must not count as all its coefficients."""
    data = table(0.003)
    start = fit(read_model("linear"), data)
    assert start.effective_parameters == pytest.approx(len(start.theta), rel=1e-6)
    over = spline(np.linspace(-1.0, 1.0, 50), 8)
    counts = []
    for size in (1e-9, 2e-4):
        form = Form("own-response", "curve", "own", (over, over), sizes=(size, size))
        found = refit(start, start.model.with_effect(free_form((form,))))
        counts.append(found.effective_parameters)
        assert found.effective_parameters < len(found.theta) - 1
    assert counts[0] == pytest.approx(len(start.theta), abs=0.01)
    assert counts[1] > counts[0] + 1
    white, rows = without_slow(start), start.residual.size
    squares = float(np.sum(white.noise.whiten(found.residual[:, :, None]) ** 2))
    by_all = likelihood(squares, len(found.theta) - len(start.theta), white)
    fewer = len(found.theta) - found.effective_parameters
    assert _likelihood_with_effects(found, white) == pytest.approx(by_all + fewer * np.log(rows))


def test_unseen_poses_that_alone_determine_a_parameter_are_predicted_by_fits_without_them() -> None:
    """A limit that few of the largest outputs reach: two of y. The linear step without these goes far beyond a fit."""
    columns = synthetic.turns((90, 30, 150, 60, 120), step_deg=30.0)
    x, y, _ = synthetic.components(columns)
    model = read_model("linear").with_effect(catalogue()["saturation"])
    found = fit(model, synthetic.poses(columns, 2.5 + np.minimum(x, 0.9), 2.5 + np.minimum(y, 0.97)))
    by_linear_steps = found.held_out_with(np.zeros((*found.residual.shape, 0)))
    assert by_linear_steps > 2.0
    assert found.held_out_excess < 1.1
    layout, number = found.problem.layout, folds(found.table)
    for k in np.unique(number):

        def others(theta: Array, kept: Array = number != k) -> Array:
            of_rows = found.problem.residual(theta) / found.noise.floor[:, None] * kept
            return np.append(of_rows, (theta - found.theta) / layout.typical)

        least = scipy.optimize.least_squares(others, found.theta, bounds=layout.bounds, x_scale=layout.typical).cost
        without = refitted.without_rows(found.problem, found.noise, found.theta, found.jacobian, number == k)
        assert float(np.sum(others(without) ** 2)) / 2 == pytest.approx(least, abs=0.05)


def test_a_model_that_only_adds_needs_no_fit_without_the_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    """One linear step is such a fit there."""
    columns = synthetic.turns((90,), step_deg=90.0)
    x, y, _ = synthetic.components(columns)
    found = fit(read_model("linear"), synthetic.poses(columns, 2.5 + x, 2.5 + y))
    monkeypatch.setattr(refitted, "unseen_error", None)
    assert found.held_out_excess > 1.05 * found.cross_validated_excess
