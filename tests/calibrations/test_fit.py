"""The joint fit: standard uncertainties are true, misfit widens them, and every start is tried."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.errors import ModelError, TooFewRows
from calibrations.fitting.fit import evaluate, fit, refit
from calibrations.model.file import read_model
from calibrations.model.parameters import Layout
from calibrations.table import Table
from tests.calibrations import synthetic
from tests.calibrations.test_effects_recovered import hysteretic

COLUMNS = synthetic.turns((90, 30, 150), step_deg=15)
A_X, A_Y, A_Z = synthetic.components(COLUMNS)
TRUTH = {"bias": (2.5, 2.6), "scale": (1.01, 0.97), "square": (0.004, -0.002)}


def table(seed: int, missing: float = 0.0, slow_v: float = 0.0) -> Table:
    """Linear, with a square of the out-of-plane axis, and of the own axis if `missing`; slow noise of 40 s."""
    rng, gaps = np.random.default_rng(1000 + seed), np.full(len(A_X), 7.0)
    slow = [synthetic.gauss_markov(rng, slow_v, 40.0, gaps) for _ in "xy"]
    vx = 2.5 + 1.01 * A_X + 0.004 * A_Z**2 + missing * A_X**2 + slow[0]
    vy = 2.6 + 0.97 * A_Y - 0.002 * A_Z**2 + missing * A_Y**2 + slow[1]
    return synthetic.poses(COLUMNS, vx, vy, seed=seed)


MODEL = read_model("linear").with_effect(catalogue()["z-axis-bias"])


def z_scores(tables: Iterable[Table]) -> list[float]:
    """Error over standard uncertainty, of every parameter of every table."""
    found = [e for data in tables for term in fit(MODEL, data).model.terms for e in term.estimates]
    return [(e.value - TRUTH[e.name]["xy".index(e.axis)]) / e.std for e in found if e.std]


def test_standard_uncertainties_are_true() -> None:
    """So few poses that there is white noise alone to estimate."""
    few = np.arange(0, len(A_X), 8)
    z = z_scores(table(seed).rows(few) for seed in range(100))
    assert len(z) == 600
    assert abs(np.mean(z)) < 0.15
    assert 0.9 < np.std(z) < 1.1


@pytest.mark.parametrize(("slow", "low", "high"), [(0.0, 0.8, 1.0), (0.5, 0.9, 1.35)])
def test_standard_uncertainties_with_slow_noise_estimated(slow: float, low: float, high: float) -> None:
    """On the safe side without slow noise, which cannot be estimated below none; about true with it."""
    z = z_scores(table(seed, slow_v=slow * synthetic.NOISE_V) for seed in range(100))
    assert low < np.std(z) < high


def test_misfit_widens_the_uncertainties() -> None:
    right, wrong = fit(MODEL, table(1)), fit(MODEL, table(1, missing=0.003))
    assert right.birge < 1.2
    assert wrong.birge > 5
    J = wrong.whitened[:, 1:]
    plain = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    given = np.array([e.std for term in wrong.model.terms for e in term.estimates])
    assert np.all(given >= plain * wrong.birge)  # at least: the misfit is slow as well, and rows then tell less
    assert np.all(given < 3 * plain * wrong.birge)


def test_rmse_excess_and_provenance_of_values() -> None:
    found = fit(MODEL, table(2))
    np.testing.assert_allclose(found.rmse, np.sqrt(np.mean(found.residual**2, axis=1)))
    np.testing.assert_allclose(found.noise.floor, synthetic.NOISE_V)
    np.testing.assert_allclose(found.excess, found.rmse / found.noise.floor)
    assert found.model.unit == "V"
    assert [e.unit for e in found.model.terms[2].estimates] == ["V/g^2", "V/g^2"]


def test_a_fit_does_not_depend_on_the_fits_before_it() -> None:
    """The noise of a model without the effect is larger, and would be where the next fit begins."""
    data = table(3, missing=0.003, slow_v=0.7 * synthetic.NOISE_V)
    together = fit(MODEL.with_effect(catalogue()["quadratic-nonlinearity"]), data)
    present = fit(read_model("linear"), data)
    for name in ("quadratic-nonlinearity", "z-axis-bias"):
        present = refit(present, present.model.with_effect(catalogue()[name]))
    assert present.noise.taus_s == together.noise.taus_s
    np.testing.assert_array_equal(present.noise.ratio, together.noise.ratio)
    for key, estimate in together.params.items():
        assert present.params[key].value == pytest.approx(estimate.value, abs=1e-3 * estimate.std)
        assert present.params[key].std == pytest.approx(estimate.std, rel=1e-3)


def test_the_noise_of_the_fit_before_has_no_influence_on_a_refit() -> None:
    before = fit(read_model("linear"), table(3, slow_v=synthetic.NOISE_V))
    noise = replace(before.noise, scatter=100 * before.noise.floor, ratio=np.full(2, 2.0))
    np.testing.assert_array_equal(refit(replace(before, noise=noise), MODEL).theta, refit(before, MODEL).theta)


def test_a_refit_begins_within_the_bounds_where_the_given_start_is_outside() -> None:
    """A start may be a linear step away, to a negative width or a time constant below zero."""
    before, model = fit(MODEL, table(3)), MODEL.with_effect(catalogue()["dead-zone"])
    low = Layout.of(model, before.table).bounds[0]
    start = np.array([*before.theta, *[-1.0] * (len(low) - len(before.theta))])
    assert np.any(start < low)
    assert np.all(refit(before, model, start).theta >= low)


def test_order_of_rows_does_not_matter() -> None:
    data = table(3)
    shuffled = data.rows(np.random.default_rng(0).permutation(data.n))
    np.testing.assert_allclose(fit(MODEL, shuffled).theta, fit(MODEL, data).theta, rtol=1e-12)


def test_evaluate_takes_the_values_as_they_are() -> None:
    assert evaluate(MODEL, table(4)) is None
    found = fit(MODEL, table(4))
    elsewhere = evaluate(found.model, table(5))
    assert elsewhere is not None
    np.testing.assert_array_equal(elsewhere.theta, found.theta)
    assert elsewhere.pooled_excess == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("reach", [0.03, 0.4])
def test_hysteresis_finds_its_reach_from_either_start(reach: float) -> None:
    columns = synthetic.turns((90, 45), step_deg=10)
    loop = hysteretic(columns, reach=reach, spread=0.5) * 0.02
    a_x, a_y, _ = synthetic.components(columns)
    data = synthetic.poses(columns, a_x + 2.5 + loop[0], a_y + 2.5 + loop[1])
    model = read_model("linear").with_effect(catalogue()["hysteresis"])
    starts = Layout.of(model, data).starts()
    assert len(starts) == 2
    found = fit(model, data)
    assert [found.model.value(f"hysteresis.reach.{axis}") for axis in "xy"] == pytest.approx([reach, reach], rel=0.1)
    assert found.pooled_excess < 1.5


def test_a_time_constant_is_fitted_although_its_amplitude_begins_at_zero() -> None:
    """In white noise alone there is no second fit that would begin with an amplitude."""
    warming = 0.003 * np.exp(-7.0 * np.arange(len(A_X)) / 250.0)
    columns = {**COLUMNS, "t_s": 7.0 * np.arange(len(A_X))}
    data = synthetic.poses(columns, 2.5 + A_X + warming, 2.6 + A_Y - warming, seed=1)
    found = fit(read_model("linear").with_effect(catalogue()["warm-up-bias"]), data)
    estimate = found.params["warm-up-bias.time_constant"]
    assert estimate.value == pytest.approx(250.0, abs=4 * estimate.std)
    assert found.pooled_excess < 1.2


def test_fewer_rows_than_parameters(golden) -> None:
    few = Table.from_columns(
        "poses", {"alpha_deg": [90.0] * 2, "beta_deg": [0.0, 180.0], "vx_v": [3.5, 1.5]}, source="few"
    )
    with golden.refused(TooFewRows):
        fit(read_model("linear"), few)


def test_only_poses_and_positions_are_fitted(golden) -> None:
    still = Table.from_columns("still", {"t_s": [0.0, 1.0]}, source="still.csv")
    with golden.refused(ModelError):
        fit(read_model("linear"), still)
