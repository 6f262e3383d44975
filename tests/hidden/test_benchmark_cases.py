"""The benchmark's own rigs are what they say: sizes, noise, names, what cannot be told apart. Its scores count."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from tests.benchmark.discovery import noises, score
from tests.benchmark.discovery.cases import case
from tests.benchmark.discovery.equals import equals
from tests.benchmark.discovery.inseparable import INSEPARABLE
from tests.benchmark.discovery.layouts import LAYOUTS
from tests.benchmark.discovery.library import library
from tests.benchmark.discovery.mechanisms import MECHANISMS
from tests.benchmark.discovery.outside import OUTSIDE
from tests.benchmark.discovery.rig import Run, unabsorbed
from tests.benchmark.discovery.sets import ROWS, sets


@pytest.mark.parametrize("name", [*MECHANISMS, *OUTSIDE])
def test_a_cause_has_the_size_that_was_asked_for(name: str) -> None:
    seed = 7 if "Preisach" in name else 5  # few poses, since its relays are many
    _, truth = case(f"own/{name}", 10.0, seed)
    assert np.sqrt(np.mean(truth.parts[0] ** 2)) == pytest.approx(10 * truth.floor_v, rel=0.15)
    assert truth.outside == (name in OUTSIDE)


def test_causes_have_names_of_the_catalogue() -> None:
    assert {name for m in MECHANISMS.values() for name in m.names} <= set(catalogue())
    assert not any(m.names for m in OUTSIDE.values())


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_set_is_the_same_again_and_fresh_poses_are_not_in_it(layout: str) -> None:
    run, again = Run(layout, 11), Run(layout, 11)
    np.testing.assert_array_equal(run.t_s, again.t_s)
    np.testing.assert_array_equal(run.temperature_c, again.temperature_c)
    v = run.visits
    shown = {*zip(v.alpha_deg[v.given], v.beta_deg[v.given], v.direction[v.given], strict=True)}
    fresh = {*zip(v.alpha_deg[~v.given], v.beta_deg[~v.given], v.direction[~v.given], strict=True)}
    assert fresh
    assert not shown & fresh
    assert np.all(np.diff(run.t_s) > run.dwell_s)


@pytest.mark.parametrize("make", noises.KINDS)
def test_slow_noise_has_the_covariance_that_it_says(make: Any) -> None:
    t = 7.0 * np.arange(60)
    drawn = np.stack([make(t, np.random.default_rng([3, k])).values for k in range(600)])
    # telegraph draws its rates anew each time: only the others have one covariance
    assert np.mean(drawn**2) == pytest.approx(1.0, abs=0.12)
    if make is not noises.telegraph:
        found = np.einsum("ktc,ksc->ts", drawn, drawn) / (2 * len(drawn))
        np.testing.assert_allclose(found, make(t, np.random.default_rng(1)).covariance, atol=0.2)


@pytest.mark.parametrize("name", INSEPARABLE)
def test_an_inseparable_cause_can_be_taken_for_another(name: str) -> None:
    table, truth = case(f"inseparable/{name}", 10.0, 15)
    (found,) = equals(table, truth, library(table))
    assert truth.causes[0] < found


def test_causes_that_the_data_tells_apart_are_not_taken_for_each_other() -> None:
    table, truth = case("own/hard springs", 10.0, 11)
    assert equals(table, truth, library(table)) == [{"cubic-nonlinearity"}]


def test_the_base_model_absorbs_bias_and_scale_factor() -> None:
    run = Run("scattered", 3)
    a = np.column_stack(
        [np.sin(run.stand.alpha) * np.cos(run.stand.beta), np.sin(run.stand.alpha) * np.sin(run.stand.beta)]
    )
    assert np.max(np.abs(unabsorbed(run, 0.3 + 0.2 * a))) < 1e-12


def test_rows_have_sets_whose_keys_differ() -> None:
    keys = [each.key for row in ROWS for each in sets(row, 40)]
    assert len(set(keys)) == len(keys)


RECORD = {"equals": [["a", "b"], ["b", "c"]], "causes": [["a"], ["c"]], "name": "pair", "slow": 0.0, "answers": {}}


@pytest.mark.parametrize(
    ("named", "matched", "exact"),
    [
        (["a", "c"], 2, True),
        (["b", "c"], 2, True),
        (["a", "b"], 2, True),
        (["a"], 1, False),
        (["b"], 1, False),
        (["c", "c"], 1, False),
        (["a", "c", "d"], 2, False),
        (["d", "e"], 0, False),
        ([], 0, False),
    ],
)
def test_names_are_matched_to_causes_one_to_one(named: list[str], matched: int, exact: bool) -> None:
    assert (score.matched(RECORD, named), score.exact(RECORD, named)) == (matched, exact)


def test_figures_compare_shares_with_the_demand() -> None:
    said = {"causes": [], "verdict": "adequate", "ranking": []}
    alarm = {**said, "causes": ["a"]}
    records = [{"row": "clean", "strength": 0.0, "answers": {"ours": each}} for each in (said, said, alarm)]
    (figure,) = score.figures(records, ["ours"])
    assert (figure["sets"], figure["met"]) == (3, False)
    assert figure["ours"] == pytest.approx(1 / 3, abs=1e-4)
