"""Patterns: each is found by its own words when the residual shows it."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.discovery.patterns import patterns
from calibrations.discovery.structure import structure_of
from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic

COLUMNS = synthetic.turns((90, 30, 150, 60, 120), step_deg=10) | {"humidity": np.zeros(370)}
COLUMNS["humidity"] = np.random.default_rng(3).uniform(30, 60, 370)
BETA, TIME = np.radians(COLUMNS["beta_deg"]), COLUMNS["t_s"]
SIZE = 10 * synthetic.NOISE_V


def table(misfit: Array) -> Table:
    a_x, a_y, _ = synthetic.components(COLUMNS)
    return synthetic.poses(COLUMNS, a_x + 2.5 + SIZE * misfit, a_y + 2.5)


@pytest.mark.parametrize(
    ("misfit", "says"),
    [
        (np.cos(7 * BETA), "7th harmonic of beta"),
        ((TIME > 1500) * 1.0, "step at t = 1"),
        (np.maximum(0, 1 - np.abs(np.degrees(BETA) - 135) / 30), "sector of beta around 135 deg"),
        (COLUMNS["humidity"] / 10 - 4.5, "follows humidity"),
    ],
)
def test_the_pattern_of_a_residual_is_named(misfit: Array, says: str) -> None:
    found = structure_of(fit(read_model("linear"), table(misfit)))
    assert found is not None
    assert says in found.text


@pytest.mark.parametrize("floors", [3.0, 8.0])
def test_a_step_of_one_axis_is_found_although_the_fitted_noise_contains_it(floors: float) -> None:
    coarse = synthetic.turns((90, 30, 150, 60, 120), step_deg=15)
    a_x, a_y, _ = synthetic.components(coarse)
    step = floors * synthetic.NOISE_V * (coarse["t_s"] > coarse["t_s"][137])
    stepped = fit(read_model("linear"), synthetic.poses(coarse, a_x + 2.5 + step, a_y + 2.5))
    assert stepped.noise.ratio[0] > 1  # slow noise over white noise
    found = structure_of(stepped)
    assert found is not None
    assert found.text.startswith("step at t = 10")


def test_a_random_walk_is_no_step() -> None:
    walk = np.cumsum(np.random.default_rng(8).standard_normal(len(BETA)))
    walked = fit(read_model("linear"), table(0.8 * (walk - walk.mean()) / np.ptp(walk)))
    assert walked.pooled_excess > 1.5
    assert structure_of(walked) is None


def test_noise_has_no_pattern() -> None:
    assert structure_of(fit(read_model("linear"), table(0 * BETA))) is None


def test_every_pattern_has_words_of_its_own_and_columns_for_each_channel() -> None:
    found = patterns(table(0 * BETA), ("x", "y"))
    texts = [p.text for p in found]
    assert len(set(texts)) == len(texts)
    assert all(p.columns.shape[:2] == (2, 370) and np.isfinite(p.columns).all() for p in found)


def test_positions_have_patterns_in_time_only() -> None:
    rng = np.random.default_rng(0)
    data = Table.from_columns("positions", dict(zip(("ax", "ay", "az"), rng.standard_normal((3, 30)), strict=True)))
    assert all(p.text.startswith(("trend from row", "step at row")) for p in patterns(data, ("norm",)))
