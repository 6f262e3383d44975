"""Sensors without any cause, on every layout of poses and in slow noise of any size up to that of the white noise.

In flicker of 1.7 times the white noise, causes are named, and no drift beside them.
"""

import pytest

from calibrations.loop import discover
from calibrations.model.file import read_model
from tests.benchmark.coverage_kinds import bent_in_flicker, ramp_in_flicker
from tests.benchmark.discovery.cases import measured
from tests.benchmark.discovery.layouts import LAYOUTS
from tests.benchmark.discovery.rig import Run
from tests.slow import first_fast


def check_nothing_is_missing(layout: str, seed: int, slow: float) -> None:
    table, _ = measured(Run(layout, seed), {}, 1.0, slow)
    found = discover(table, read_model("linear"))
    assert found.verdict == "adequate", (seed, layout, found.judgement.text)
    assert not found.causes


@pytest.mark.slow
def test_slow_noise_that_looks_like_an_oscillation_is_no_cause() -> None:
    check_nothing_is_missing("upright", 10_034, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("slow", [0.0, 0.5, 1.0])
def test_of_a_sensor_without_a_cause_nothing_is_missing(slow: float) -> None:
    for seed, layout in enumerate(LAYOUTS, 10_012):
        check_nothing_is_missing(layout, seed, slow)


@pytest.mark.slow
@pytest.mark.parametrize("seed", first_fast((19, 13, 25, 31), 1))
def test_strong_flicker_is_no_drift(seed: int) -> None:
    found = discover(bent_in_flicker(seed), read_model("linear"))
    assert set(found.causes) == {"quadratic-nonlinearity", "cross-axis-bias"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", first_fast((7, 16, 19, 25), 1))
def test_beside_strong_flicker_no_free_form_stays_in_the_model(seed: int) -> None:
    found = discover(bent_in_flicker(seed), read_model("linear"))
    assert {step.name for step in found.findings.steps} == {"quadratic-nonlinearity", "cross-axis-bias"}


@pytest.mark.parametrize("seed", first_fast((11, 23, 20, 26), 1))
def test_a_straight_drift_in_flicker_has_no_free_form_beside_it(seed: int) -> None:
    """Of 23, the level of standard deviations that only scatter was a straight line too."""
    found = discover(ramp_in_flicker(seed), read_model("linear"))
    assert [step.name for step in found.findings.steps] == ["bias-drift"]
    assert found.causes == ("bias-drift",)
