"""Which name the curve of a place gets: from the effect that takes up most of it, or none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from calibrations.free_forms.acting_places import _least_size
from calibrations.free_forms.naming import _orthonormal, _residual_squares, is_over_soon, is_unsettled
from calibrations.loop import discover
from calibrations.model.file import read_model
from calibrations.table import Array
from tests.calibrations.synthetic import components, poses, turns

COLUMNS = turns((90, 30, 150), step_deg=15.0)
ROWS = len(COLUMNS["t_s"])
SHARE = np.arange(ROWS) / ROWS
RECORD = np.linspace(0.0, 1.0, 300)


@pytest.mark.parametrize(("fast", "slow"), [(0.05, 0.2), (0.08, 0.3)])
def test_a_warm_up_of_two_masses_of_opposite_sign_is_a_warm_up(fast: float, slow: float) -> None:
    """One exponential explains it no better than a drift does."""
    x, y, _ = components(COLUMNS)
    heating = 3e-3 * (np.exp(-SHARE / fast) - np.exp(-SHARE / slow))
    result = discover(poses(COLUMNS, 2.5 + x + heating, 2.5 + y - 0.7 * heating), read_model("linear"))
    assert result.causes == ("warm-up-bias",)
    assert result.end.pooled_excess < 1.2


@pytest.mark.parametrize(("second", "causes"), [(0.015, ("stage-eccentricity",)), (0.05, ())])
def test_an_error_of_the_stage_that_is_mostly_its_first_wave_is_an_eccentricity(
    second: float, causes: tuple[str, ...]
) -> None:
    beta = np.radians(COLUMNS["beta_deg"])
    turned = {**COLUMNS, "beta_deg": COLUMNS["beta_deg"] + 0.03 * np.sin(beta) + second * np.sin(2 * beta + 1)}
    x, y, _ = components(turned)
    result = discover(poses(COLUMNS, 2.5 + x, 2.5 + y), read_model("linear"))
    assert result.causes == causes
    assert [place.name for place in result.findings.places] == ["stage-angle-beta"]


@pytest.mark.parametrize(("form", "place", "least"), [("slip", "own-response", 2.0), (None, "own-response", 0.3),
                                                      ("slip", "history", 0.3)])  # fmt: skip
def test_beside_a_hysteresis_in_another_form_a_place_needs_a_tenth_of_its_size(
    form: str | None, place: str, least: float
) -> None:
    component = SimpleNamespace(place="history", form=form)
    result = SimpleNamespace(active=["history/slip"], component=lambda _: component)
    assert _least_size(result, place, {"history": 20.0, "own-response": 1.0}) == pytest.approx(least)


def test_a_curve_is_left_by_a_cause_beside_those_that_were_chosen_as_by_all_together() -> None:
    random = np.random.default_rng(1)
    chosen, tried, curve = (random.standard_normal((30, m)) * 10.0 ** np.arange(m) for m in (3, 2, 1))
    chosen[:, 2] = chosen[:, 0] + chosen[:, 1]  # no direction of its own
    every = np.hstack([chosen[:, :2], tried])
    expected = np.linalg.lstsq(every, curve[:, 0], rcond=None)[1].item()
    companions = _orthonormal([chosen])
    assert companions.shape == (30, 2)
    assert _residual_squares([tried], curve[:, 0], companions) == pytest.approx(expected, rel=1e-9)
    spanned = _residual_squares([chosen[:, :1]], curve[:, 0], companions)
    assert spanned == pytest.approx(float(np.sum((curve - companions @ (companions.T @ curve)) ** 2)), rel=1e-9)


def both(curve: Array) -> Array:
    """The curve of two axes, the second one smaller and of the other sign."""
    return np.stack([curve, -0.4 * curve])


@pytest.mark.parametrize(("part", "unsettled"), [(0.05, False), (0.3, False), (0.5, True), (2.0, True)])
def test_a_long_time_constant_is_not_settled(part: float, unsettled: bool) -> None:
    assert is_unsettled(both(np.exp(-RECORD / part)), RECORD) is unsettled


def test_ageing_with_the_logarithm_of_the_time_is_not_settled() -> None:
    assert is_unsettled(both(np.log1p(RECORD / 0.8)), RECORD)


@pytest.mark.parametrize(("part", "soon"), [(0.01, True), (0.2, False)])
def test_a_short_time_constant_is_over_within_the_first_poses(part: float, soon: bool) -> None:
    assert is_over_soon(both(np.exp(-RECORD / part)), RECORD) is soon
