"""An output that follows what was logged beside it is told as that, and chance likeness is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.fft import idct

from calibrations.discovery.results import Diagnosis, Discovery
from calibrations.estimators.scatter import without_scatter
from calibrations.loop import diagnose, discover
from calibrations.model import Estimate
from calibrations.model.file import read_model
from calibrations.noise.dataset import NoiseFindings
from calibrations.noise.patterns import STEP, Pattern
from calibrations.noise.record import Samples, Still, reduce_record
from calibrations.table import Array
from tests.calibrations.hidden_noise import FOLLOWING, RATE_HZ, SAMPLES, room, white
from tests.slow import first_fast


def beside(x: Array, **logged: Array) -> Still:
    blocks = {name: list(np.array_split(values, 7)) for name, values in logged.items()}
    return reduce_record([Samples("x", np.array_split(x, 5), RATE_HZ, "V", logged=blocks)], "made")


def found(x: Array, **logged: Array) -> Discovery:
    return discover(beside(x, **logged), read_model("still"))


def patterns_of(answer: Diagnosis[Any] | Discovery[Any]) -> Sequence[Pattern]:
    assert isinstance(answer.findings, NoiseFindings)
    return answer.findings.search.patterns


@pytest.mark.parametrize("name", FOLLOWING)
def test_what_follows_a_logged_temperature_is_told_and_nothing_else(name: str) -> None:
    make, told = FOLLOWING[name]
    x, warm = make(np.random.default_rng(3))
    result = found(x, temperature_c=warm)
    if told is None:
        assert result.verdict in ("adequate", "ambiguous")
        return
    assert result.verdict == "adequate"
    assert result.causes[0] == "temperature-bias"
    assert set(result.causes[1:]) <= {"flicker-noise"}
    slope = result.model.params["temperature-bias.x"]
    assert slope.value == pytest.approx(told, abs=4 * slope.std)
    assert ("flicker" in name) == ("flicker-noise" in result.causes)


def test_slope_and_lag_are_those_of_the_sensor() -> None:
    x, warm = FOLLOWING["follows behind"][0](np.random.default_rng(2))
    result = found(x, temperature_c=warm)
    slope = result.model.params["temperature-bias.x"]
    assert slope.value == pytest.approx(-0.8, abs=3 * slope.std)
    assert slope.std < 0.05
    (term,) = (term for term in result.model.terms if term.name == "temperature-bias")
    assert term.constants["lead_s"] == pytest.approx(-60, rel=0.4)


def test_a_drift_that_the_temperature_shares_is_told_with_its_rival() -> None:
    random = np.random.default_rng(1)
    along = np.linspace(20, 22, SAMPLES)
    said = str(found(white(random) + 0.5 * along, temperature_c=np.round(along, 2)).residual_structure)
    assert "a drift of x by" in said
    assert "x follows temperature_c by" in said
    assert "cannot separate it from" in said


def test_a_temperature_and_a_step_are_two_things() -> None:
    random = np.random.default_rng(1)
    warm = room(random)
    result = found(white(random) + 0.5 * warm + 0.5 * (np.arange(SAMPLES) > 9000), temperature_c=warm)
    (step,) = patterns_of(result)
    assert step.kind == STEP
    assert step.size == pytest.approx(0.5, abs=3 * step.std)
    slope = result.model.params["temperature-bias.x"]
    assert slope.value == pytest.approx(0.5, abs=3 * slope.std)
    assert "a step of" in str(result.residual_structure)
    assert (result.verdict, result.causes) == ("unexplained", ("temperature-bias",))


def test_a_column_that_is_constant_or_too_short_is_left_out() -> None:
    random = np.random.default_rng(1)
    (channel,) = beside(white(random), temperature_c=np.full(SAMPLES, 22.0), supply_v=np.ones(5)).channels
    assert channel.logged == {}


def followed(x: Array, **logged: Array) -> Estimate:
    """The slope over the temperature, which is 0.8."""
    slope = found(x, **logged).model.params["temperature-bias.x"]
    assert slope.value == pytest.approx(0.8, abs=3 * slope.std)
    return slope


@pytest.mark.parametrize("scatter", first_fast([1.0, 0.3, 0.0]))
def test_scatter_of_the_thermometer_does_not_hide_how_much_the_sensor_follows(scatter: float) -> None:
    random = np.random.default_rng(4)
    warm = room(random)
    read = warm + scatter * random.standard_normal(SAMPLES)
    assert followed(white(random) + 0.8 * warm, temperature_c=read).std < 0.05


def test_a_jitter_that_the_sensor_feels_is_no_scatter() -> None:
    random = np.random.default_rng(5)
    supply = room(random) + 0.3 * random.standard_normal(SAMPLES)
    still = beside(white(random) + 0.8 * supply, supply_v=supply)
    (pattern,) = patterns_of(diagnose(still, read_model("still")))
    assert pattern.size == pytest.approx(0.8, abs=3 * pattern.std)
    assert pattern.std < 0.02


def test_scatter_of_readings_that_are_held_is_taken_off_as_well() -> None:
    random = np.random.default_rng(7)
    warm = room(random)
    read = np.repeat(warm[10::20] + 0.3 * random.standard_normal(SAMPLES // 20), 20)
    assert followed(white(random) + 0.8 * warm, temperature_c=read).std < 0.05


def test_a_diagnosis_counts_the_doubt() -> None:
    random = np.random.default_rng(4)
    warm = room(random)
    still = beside(white(random) + 0.8 * warm, temperature_c=warm + random.standard_normal(SAMPLES))
    (channel,) = still.channels
    doubted = {name: replace(column, doubt=0.5) for name, column in channel.logged.items()}
    doubtful = replace(still, channels=(replace(channel, logged=doubted),))
    slope = discover(doubtful, read_model("still")).model.params["temperature-bias.x"]
    assert slope.std == pytest.approx(0.5 * slope.value, rel=0.02)


@pytest.mark.parametrize("scatter", [0.3, 1.0, 3.0])
def test_a_slope_is_no_more_certain_than_what_is_scatter(scatter: float) -> None:
    """A level that flickers, of 3,000 means, under more or less scatter: 40 of each."""
    off, sure = np.array([_off(seed, scatter) for seed in range(40)]).T
    assert 0.6 < np.sqrt(np.mean(off**2)) < 2.0
    assert np.sqrt(np.mean(sure**2)) > 2.5


def _off(seed: int, scatter: float, n: int = 3000) -> tuple[float, float]:
    """A slope of 1 on what is left without scatter: its error by its uncertainty, with and without the doubt."""
    random = np.random.default_rng(seed)
    tones = random.standard_normal(n - 1) / np.sqrt(np.sin(np.pi * np.arange(1, n) / (2 * n)))
    true = idct(np.concatenate([[0.0], tones]), norm="ortho")
    read = true + scatter * true.std() * random.standard_normal(n)
    level, doubt, *_ = without_scatter(read - read.mean(), n)
    slope = true @ level / (level @ level)
    std = np.std(true - slope * level) / np.linalg.norm(level)
    return (slope - 1) / np.hypot(std, doubt * slope), (slope - 1) / std
