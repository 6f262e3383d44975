"""Where a model fails: in words and numbers, worst first, and nowhere on noise."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from calibrations.criteria import MATERIAL
from calibrations.discovery.places import _stretch_words
from calibrations.discovery.verdict import Judgement, Verdict
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit, scales
from calibrations.loop import compare, dataset, diagnose
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic

COLUMNS = synthetic.turns((90, 30, 150, 60, 120), step_deg=10)
A_X, A_Y, A_Z = synthetic.components(COLUMNS)


def table(more_x: Array | float = 0.0, seed: int = 0) -> Table:
    return synthetic.poses(COLUMNS, 2.0 * A_X + 2.5 + more_x, A_Y + 2.5, seed=seed)


@pytest.mark.parametrize("seed", range(10))
def test_a_comparison_fails_nowhere_on_noise(seed: int) -> None:
    found = compare(table(seed=seed), read_model("linear"))
    assert found.adequate
    assert found.fails == ()


def test_a_comparison_names_the_inclinations_at_which_it_fails() -> None:
    found = compare(table(0.004 * A_Z**2), read_model("linear"))
    (place,) = (p for p in found.fails if p.where == "alpha")
    assert (place.axis, place.low) == ("x", 90.0)
    assert place.text.startswith("alpha 90 deg: x is off by -1.5")  # mV: the bias takes the mean of cos^2 alpha, 0.4
    assert "mg) on average, rms" in place.text


def test_times_of_a_run_begin_at_its_first_pose() -> None:
    step = 0.02 * (np.arange(len(A_X)) > len(A_X) * 0.8)
    given = table(step)
    at = 40_000.0 + 10.0 * np.arange(given.n)
    timed = replace(given, columns={**given.columns, "t_s": at}, numbers=np.arange(given.n))
    (place,) = (p for p in compare(timed, read_model("linear")).fails if (p.where, p.axis) == ("time", "x"))
    assert place.low > 40_000.0
    first, last = (at[(at >= place.low) & (at <= place.high)][[0, -1]] - 40_000.0) / 60.0
    assert place.text.startswith(f"time {first:.1f} to {last:.1f} min since the first pose: x is off by")


def test_single_times_and_temperatures_have_few_digits() -> None:
    few = table().rows(np.arange(4))
    at = np.array([0.0, 43.282_711, 60.123_4, 91.5])
    timed = replace(few, columns={**few.columns, "t_s": at, "temperature_c": 36.283_45 + at / 1e3})
    words = [_stretch_words(timed, *place) for place in (("time", at[1], at[1]), ("temperature", 36.326_73, 36.326_73))]
    assert words == ["time 43.3 s since the first pose", "temperature 36.327 degC"]
    assert _stretch_words(timed, "alpha", 12.345, 12.345) == "alpha 12.345 deg"  # as it was set


def test_errors_in_mg_use_the_scale_factor_of_their_axis() -> None:
    model = fit(read_model("linear"), table()).model
    found = compare(table(0.002), model)
    np.testing.assert_allclose(scales(found.fit), [2.0, 1.0], rtol=1e-3)
    assert all(p.axis == "x" for p in found.fails)
    for place in found.fails:  # 2 mV at 2 V/g
        mv, mg = map(float, re.findall(r"([+-][\d.]+) m", place.text))
        assert (mv, mg) == pytest.approx((2.0, 1.0), rel=0.02)


@pytest.mark.parametrize(("side", "words"), [(1.0, "turning clockwise"), (-1.0, "turning anticlockwise")])
def test_a_comparison_names_the_direction_in_which_it_fails(side: float, words: str) -> None:
    model = fit(read_model("linear"), table()).model
    found = compare(table(0.002 * (COLUMNS["direction"] == side)), model)
    assert any(p.text.startswith(words) for p in found.fails)


def test_failures_are_listed_largest_first() -> None:
    found = compare(table(0.004 * A_Z**2 + 0.001 * COLUMNS["direction"]), read_model("linear"))
    excesses = [p.excess for p in found.fails]
    assert excesses == sorted(excesses, reverse=True)
    assert len({(p.where, p.axis) for p in found.fails}) == len(found.fails)


def test_a_model_with_values_is_taken_as_it_is() -> None:
    model = fit(read_model("linear"), table()).model
    found = compare(table(0.001), model)  # the bias has moved
    assert not found.adequate
    assert found.fit.rmse[0] == pytest.approx(0.001, rel=0.05)
    assert compare(table(0.001), read_model("linear")).adequate


def test_so_few_poses_that_any_misfit_could_be_slow_noise_are_no_excuse() -> None:
    """No noise of a sensor's own is a hundred times that of its means."""
    columns = synthetic.turns((90, 45), step_deg=60)
    x, y, z = synthetic.components(columns)
    few = synthetic.poses(columns, 2.5 + x + 0.02 * y + 0.01 * z**2, 2.5 + y - 0.03 * x)
    found = compare(few, read_model("linear"))
    assert np.all(found.fit.excess > 100)
    assert not found.adequate


@pytest.mark.parametrize(
    ("apart_v", "words"),
    [(0.9e-4, "slow noise or scatter between rows"), (1.2e-4, "The noise floor is the scatter of the poses.")],
    ids=["1.35 times", "1.6 times"],
)
def test_scatter_from_row_to_row_is_judged_by_the_search(apart_v: float, words: str) -> None:
    """A comparison and a diagnosis give one verdict on rows that scatter more than their samples."""
    columns = synthetic.turns((90, 30, 150), step_deg=15.0)
    x, y, _ = synthetic.components(columns)
    alternating = apart_v * (np.arange(len(x)) % 2)
    scattered = synthetic.poses(columns, x + 2.5 + alternating, y + 2.5 - alternating)
    effects = {"cubic-nonlinearity": catalogue()["cubic-nonlinearity"]}
    compared = dataset(scattered).compare(read_model("linear"), effects)
    diagnosed = diagnose(scattered, read_model("linear"), effects)
    assert compared.fit.pooled_excess > MATERIAL
    assert dataset(scattered).judge(compared.fit) is None  # the search decides
    assert compared.adequate is (diagnosed.verdict == "adequate")
    assert words in compared.report()


@pytest.mark.parametrize("seed", range(10))
def test_noise_alone_is_not_judged_before_a_search(seed: int) -> None:
    assert judged_before_search(table(seed=seed)) is None


def test_a_clear_misfit_is_judged_before_a_search_and_the_search_confirms_it() -> None:
    bent = table(0.004 * A_Z**2)
    judgement = judged_before_search(bent)
    assert judgement is not None
    assert judgement.verdict is Verdict.INCOMPLETE
    compared = compare(bent, read_model("linear"))
    assert judgement.error == compared.fit.pooled_excess
    assert judgement.left == compared.fails[0].text
    assert diagnose(bent, read_model("linear")).missing


def test_data_that_cannot_be_used_are_not_judged_before_a_search() -> None:
    dead = table().with_outputs(table().outputs * [1.0, 0.0] + [0.0, 2.5])
    assert judged_before_search(dead) is None
    assert diagnose(dead, read_model("linear")).verdict is Verdict.NO_RESPONSE


def judged_before_search(measured: Table) -> Judgement | None:
    data = dataset(measured)
    return data.judge(data.fit(read_model("linear")))


def positions(scale_y: float) -> Table:
    """Directions at random, without the scatter of the samples."""
    random = np.random.default_rng(0)
    u = random.standard_normal((40, 3))
    a = u / np.linalg.norm(u, axis=1, keepdims=True) * [1.0, scale_y, 1.0] + 1e-3 * random.standard_normal((40, 3))
    return Table.from_columns("positions", dict(zip(("ax", "ay", "az"), a.T, strict=True)), {"unit": "g"}, "made")


def test_a_residual_that_measures_its_own_noise_is_judged_by_the_search() -> None:
    data, model = positions(1.003), read_model("common-scale")
    found, asked = compare(data, model), diagnose(data, model)
    assert found.fails == ()
    assert dataset(data).judge(found.fit) is None
    assert asked.missing
    assert found.given == asked.judgement
    assert not found.adequate
    assert "fails nowhere" not in found.report()
    assert asked.judgement.text in found.report()
    assert found.to_dict()["missing"] == list(asked.missing)
    clean = compare(positions(1.0), model)
    assert clean.adequate
    assert "fails nowhere" not in clean.report()
    assert compare(table(), read_model("linear")).given is None
