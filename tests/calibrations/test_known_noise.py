"""Slow noise of poses that a still record has told: no false alarms, and what is missing is still found."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError, ModelError
from calibrations.fitting.fit import fit
from calibrations.fitting.table_noise import slow_processes, with_noise
from calibrations.loop import compare, diagnose
from calibrations.means.noise import Noise, whiten_columns
from calibrations.model import Estimate, Model, Term
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations.hidden_noise import fractional
from tests.calibrations.synthetic import NOISE_V, components, poses, turns

TIMES = 5.0  # flicker over the white noise of a mean


def noise_model(unit: str = "V", **coefficients: float) -> Model:
    """A noise model with one coefficient of each effect, the same for both axes."""
    terms = [
        Term(effect, estimates=tuple(Estimate(effect.parameters[0].name, a, value, None, unit) for a in "xy"))
        for effect, value in ((catalogue()[name.replace("_", "-")], value) for name, value in coefficients.items())
    ]
    return Model("known", tuple(terms), unit)


KNOWN = noise_model(flicker_noise=TIMES * NOISE_V)


def sweep(seed: int, square: float = 0.0) -> Table:
    """Poses of a linear sensor under flicker, with a square of the force beside, V."""
    columns, random = turns(step_deg=20.0), np.random.default_rng(seed)
    x, y, _ = components(columns)
    slow = [TIMES * NOISE_V * fractional(random, len(x)) for _ in range(2)]
    return poses(columns, 2.5 + x + square * x**2 + slow[0], 2.5 + y + square * y**2 + slow[1], seed=seed)


@pytest.mark.release
def test_false_alarms_fall_where_the_noise_is_known() -> None:
    tables = [sweep(seed) for seed in range(4)]
    guessed = [diagnose(table, read_model("linear")).verdict for table in tables]
    known = [diagnose(with_noise(table, KNOWN), read_model("linear")).verdict for table in tables]
    assert guessed.count("adequate") <= 1
    assert known == ["adequate"] * 4
    assert all(compare(with_noise(table, KNOWN), read_model("linear")).adequate for table in tables)


def test_what_is_missing_is_found_beside_known_noise() -> None:
    found = diagnose(with_noise(sweep(1, square=1.5e-3), KNOWN), read_model("linear"))
    assert found.verdict in ("effect-missing", "ambiguous")
    best = found.candidates[0]
    assert "quadratic-nonlinearity" in (best.name, *best.indistinguishable_from)


def test_parameters_are_within_their_uncertainties() -> None:
    off = []
    for seed in range(6):
        model = fit(read_model("linear"), with_noise(sweep(seed), KNOWN)).model
        off += [
            (e.value - 2.5 if e.name == "bias" else e.value - 1.0) / float(e.std or 0)
            for t in model.terms
            for e in t.estimates
        ]
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.6


def test_processes_have_the_variance_and_the_spectrum_of_the_model() -> None:
    table = sweep(0)
    span_s = float(np.ptp(table.time_s))
    flicker = slow_processes(KNOWN, "x", table)
    f = np.geomspace(2 / span_s, 1 / 60, 20)
    density = sum(2 * s**2 * tau / (1 + (2 * np.pi * f * tau) ** 2) for s, tau in flicker)
    assert density == pytest.approx((TIMES * NOISE_V) ** 2 / (2 * np.pi * f), rel=0.15)
    ((std, tau_s),) = slow_processes(noise_model(rate_random_walk=1e-6), "x", table)
    assert 2 * std**2 / tau_s == pytest.approx(1e-12)
    assert tau_s > 5 * span_s


def test_known_processes_whiten_what_they_make() -> None:
    gaps, random = np.full(400, 5.0), np.random.default_rng(1)
    apart = 5.0 * np.abs(np.subtract.outer(np.arange(400), np.arange(400)))
    covariance = np.eye(400) + 4 * np.exp(-apart / 50.0) + 9 * np.exp(-apart / 700.0)
    x = np.linalg.cholesky(covariance) @ random.standard_normal(400)
    out, logdet = whiten_columns(x[:, None], gaps, np.ones(400), 0.0, (1.0,), ((2.0, 50.0), (3.0, 700.0)))
    assert logdet == pytest.approx(np.linalg.slogdet(covariance)[1])
    assert float(out[:, 0] @ out[:, 0]) == pytest.approx(x @ np.linalg.solve(covariance, x))
    noise = Noise(np.ones((1, 400)), gaps, np.zeros(1), np.zeros(1), ((1.0,),), (((2.0, 50.0), (3.0, 700.0)),))
    assert noise.slow[0] == 0
    assert 2 < noise.wander[0] < np.hypot(2, 3)


@pytest.mark.parametrize("times_s", [np.repeat(np.arange(4.0), 10), np.repeat(7.0, 40), np.zeros(1)])
def test_slow_noise_needs_a_time_of_each_row(golden, times_s: np.ndarray) -> None:
    columns = {"alpha_deg": np.full(len(times_s), 90.0), "beta_deg": np.zeros(len(times_s)), "t_s": times_s}
    table = Table.from_columns(
        "poses", columns | {"vx_v": columns["beta_deg"], "vy_v": columns["beta_deg"]}, {}, "rows"
    )
    with golden.refused(DataError):
        with_noise(table, KNOWN)


@pytest.mark.parametrize(
    ("model", "kind", "says"),
    [
        (noise_model(unit="count", flicker_noise=1.0), "poses", "its values are in count"),
        (read_model("still"), "poses", "its values are not fitted"),
        (KNOWN, "positions", "a noise model is for poses and rates"),
    ],
)
def test_noise_that_cannot_be_taken_is_refused(model: Model, kind: str, says: str) -> None:
    table = (
        sweep(0) if kind == "poses" else Table.from_columns("positions", {a: np.ones(3) for a in ("ax", "ay", "az")})
    )
    with pytest.raises((DataError, ModelError), match=says):
        with_noise(table, model)
