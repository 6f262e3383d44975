"""What planned poses would tell, against what the same poses told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.design.expected import predict_data
from calibrations.design.optimal_design import covariance_of, information
from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError, MissingColumn
from calibrations.fitting.fit import Fit, fit
from calibrations.means.noise import white_only
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations.synthetic import NOISE_V, components, gauss_markov, poses, turns

PLAN = {"alpha_deg": np.array([90.0, 90, 90, 90]), "beta_deg": np.array([0.0, 90, 180, 270])}


def fitted(model: str = "linear", slow_v: float = 0.0, **more: np.ndarray) -> Fit:
    columns = {**turns(step_deg=30.0), **more}
    x, y, _ = components(columns)
    rng = np.random.default_rng(3)
    gaps = np.diff(columns["t_s"], prepend=columns["t_s"][0])
    wander = [gauss_markov(rng, slow_v, 200.0, gaps) for _ in range(2)] if slow_v else [0.0, 0.0]
    table = poses(columns, 2.5 + 1.01 * x + wander[0], 2.4 + 0.98 * y + wander[1])
    return fit(read_model(model), Table.from_columns("poses", table.columns, {"sample_rate_hz": 1000.0}, "made"))


def white(found: Fit) -> Fit:
    """Without the scatter that the fit found by chance."""
    return replace(found, noise=white_only(found.problem.white, found.problem.gap_s, 2))


def test_a_plan_like_the_data_tells_what_the_data_told() -> None:
    found = fitted("physical")
    again = predict_data(
        found, {name: found.table.column(name) for name in ("alpha_deg", "beta_deg", "t_s", "direction")}
    )
    rows = information(found, again)
    assert rows.shape == (2 * found.table.n, len(found.theta))
    assert np.allclose(rows, found.whitened[:, 1:], rtol=1e-6, atol=1e-6 * np.abs(rows).max())
    stds = np.array([e.std for term in found.model.terms for e in term.estimates], dtype=float)
    foretold = np.sqrt(np.diag(covariance_of(rows)))
    assert np.all((0.5 * stds < foretold) & (foretold < 1.05 * stds))  # a fit allows for noise that it did not find


def test_outputs_are_those_of_the_fitted_sensor() -> None:
    table = predict_data(fitted(), PLAN)
    assert table.column("vx_v") == pytest.approx([3.51, 2.5, 1.49, 2.5], abs=1e-4)
    assert table.column("vy_v") == pytest.approx([2.4, 3.38, 2.4, 1.42], abs=1e-4)


def test_four_poses_tell_bias_and_scale_factor_as_textbooks_say() -> None:
    found = white(fitted())
    cov = covariance_of(information(found, predict_data(found, PLAN)))
    assert np.sqrt(np.diag(cov)) == pytest.approx(NOISE_V * np.sqrt([1 / 4, 1 / 4, 1 / 2, 1 / 2]), rel=0.02)


def test_a_dwell_four_times_as_long_halves_the_errors() -> None:
    found = white(fitted())
    short, long = (
        covariance_of(information(found, predict_data(found, {**PLAN, "dwell_s": np.full(4, dwell_s)})))
        for dwell_s in (5.0, 20.0)
    )
    assert np.diag(short) == pytest.approx(4 * np.diag(long))


def test_slow_noise_is_no_smaller_in_a_longer_dwell() -> None:
    found = fitted(slow_v=2 * NOISE_V)
    apart = 1e5 * np.arange(4.0)
    for more in ({}, {"t_s": apart}):  # long after each other, rows are as independent as without times
        cov = covariance_of(information(found, predict_data(found, {**PLAN, **more, "dwell_s": np.full(4, 1e5)})))
        assert np.sqrt(cov[0, 0]) == pytest.approx(float(found.noise.slow[0]) / 2, rel=0.1)


def test_what_a_plan_cannot_tell_is_infinitely_uncertain() -> None:
    found = fitted("physical")
    std = np.sqrt(np.diag(covariance_of(information(found, predict_data(found, PLAN)))))
    assert np.isinf(std[[s.parameter.name == "bias" for s in found.problem.layout.slots].index(True)])
    assert np.all(np.isinf(np.diag(covariance_of(np.zeros((0, 3))))))


def test_what_the_model_needs_and_nobody_plans_is_held_as_in_the_data() -> None:
    columns = turns(step_deg=30.0)
    temperature_c = 25 + np.sin(np.arange(len(columns["t_s"])))
    found = fitted("linear", temperature_c=temperature_c)
    assert "temperature_c" not in predict_data(found, PLAN)
    warm = found.model.with_effect(catalogue()["temperature-bias"])
    with_it = fit(warm, found.table)
    assert predict_data(with_it, PLAN).column("temperature_c") == pytest.approx(temperature_c.mean())
    settling = fit(found.model.with_effect(catalogue()["warm-up-bias"]), found.table)
    with pytest.raises(MissingColumn, match="t_s"):
        predict_data(settling, PLAN)


def test_a_dwell_means_nothing_without_a_sample_rate(golden) -> None:
    columns = turns(step_deg=30.0)
    x, y, _ = components(columns)
    with golden.refused(DataError):
        predict_data(fit(read_model("linear"), poses(columns, x, y)), {**PLAN, "dwell_s": np.full(4, 5.0)})
