"""A search that stops at an error that is small enough."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import calibrations as cal
from calibrations.discovery.enough import parse_enough
from calibrations.discovery.results import Discovery
from calibrations.errors import ModelError
from calibrations.fitting.fit import Fit
from calibrations.table import Table
from tests.calibrations.synthetic import components, poses, turns


@cache
def table() -> Table:
    """A square of 5 mg rms over the axis out of the plane, and one of 0.5 mg along each axis."""
    columns = turns((90, 30, 150), step_deg=30)
    x, y, z = components(columns)
    rng = np.random.default_rng(3)
    outputs = [2.5 + a + k * a**2 + 0.02 * z**2 for a, k in ((x, 5e-4), (y, -8e-4))]
    return poses(columns, *(v + 5e-5 * rng.standard_normal(len(v)) for v in outputs))


@cache
def found(enough: str) -> Discovery[Fit]:
    return cal.discover(table(), "linear", enough=enough)


def names(result: Discovery[Fit]) -> list[str]:
    return [step.name for step in result.steps]


def test_a_search_without_a_limit_finds_both_effects() -> None:
    assert names(found("")) == ["z-axis-bias", "quadratic-nonlinearity"]


def test_a_search_stops_at_the_first_error_that_is_small_enough() -> None:
    result = found("1mg")
    assert names(result) == ["z-axis-bias"]
    assert result.causes == ("z-axis-bias",)
    assert result.verdict == "adequate"
    assert "within the limit" in result.judgement.text
    assert "Left out: quadratic-nonlinearity." in result.judgement.text
    assert "no effect is missing" not in result.judgement.text


def test_a_model_whose_error_is_small_enough_gets_no_effect() -> None:
    result = found("100mg")
    assert (names(result), result.verdict) == ([], "adequate")
    assert result.judgement.text.startswith('The model "linear" needs no further effect.')


def test_the_text_says_that_no_model_reaches_the_requested_error() -> None:
    result = found("0.5 floors")
    assert names(result) == ["z-axis-bias", "quadratic-nonlinearity"]
    assert "above the limit (0.5 noise floors)" in result.judgement.text


def test_equal_errors_in_other_units_are_one_limit() -> None:
    """The sensor gives 1 V for 1 g."""
    limits = [parse_enough(text).limit(found("").start) for text in ("1mg", "1000 ug", "1 mV", "0.001V")]
    assert limits == pytest.approx(limits[:1] * 4, rel=0.01)


@pytest.mark.parametrize("text", ["abc", "0mg", "-1mg", "1e999mg", "5", "1.2.3mg", "2 parsec", "nanmg"])
def test_a_text_that_is_not_an_error_is_refused_with_an_example(golden, text: str) -> None:
    with golden.refused(ModelError):
        parse_enough(text)


def test_an_error_in_the_unit_of_another_sensor_is_refused(golden) -> None:
    with golden.refused(ModelError):
        parse_enough("3deg/s").limit(found("").start)
