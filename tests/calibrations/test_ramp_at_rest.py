"""A temperature ramp at rest: what the temperature does is calibrated before any noise is named."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError, ModelError
from calibrations.loop import compare, dataset, diagnose, discover
from calibrations.model.file import dump_model, parse_model, read_model
from calibrations.noise.fit import NoiseFit
from calibrations.noise.record import Samples, Still, reduce_record
from tests.calibrations.ramps import RATE_HZ, SAMPLES, record

BIAS, HYSTERESIS, CURVE = "temperature-bias", "temperature-hysteresis", "free:temperature-bias"
WHITE_V = 1e-3  # per root Hz: that of the record
CASES = {  # what the sensor does, and its causes
    "line": ({"line": 5e-4}, (BIAS,)),
    "line and bow": ({"line": 5e-4, "bow": 4e-3}, (BIAS,)),
    "line and glue": ({"line": 5e-4, "glue": 4e-3}, (HYSTERESIS,)),
    "line behind": ({"line": 5e-4, "delay_s": 300.0}, (BIAS,)),
}


def ramp(seed: int = 0, walk: float = 0.0, **form: float) -> Still:
    """A record of one channel with its temperature; `walk`: V by which a sample of its noise differs from the next."""
    random = np.random.default_rng(seed)
    volts, warm = record(random, **form)
    volts = volts + walk * np.cumsum(random.standard_normal(SAMPLES))
    return reduce_record([Samples("x", [volts], RATE_HZ, "V", logged={"temperature_c": [warm]})], "made")


def found(still: Still) -> Discovery[NoiseFit]:
    return discover(still, read_model("still"))


@cache
def found_of(seed: int = 0, walk: float = 0.0, **form: float) -> Discovery[NoiseFit]:
    """The search on such a ramp."""
    return found(ramp(seed, walk, **form))


@pytest.mark.parametrize("name", CASES)
def test_the_cause_is_named_and_nothing_but_white_noise_is_left(name: str) -> None:
    form, causes = CASES[name]
    result = found_of(**form)
    assert (result.verdict, result.causes) == ("adequate", causes)
    assert result.residual_structure is None
    assert result.start.pooled_excess > 10
    assert result.end.pooled_excess < 1.15
    assert result.model.params["white-noise.x"].value == pytest.approx(WHITE_V, rel=0.03)


def test_a_line_has_its_slope_and_a_bow_its_curve() -> None:
    slope = found_of(line=5e-4).model.params[f"{BIAS}.x"]
    assert slope.value == pytest.approx(5e-4, abs=3 * slope.std)
    assert slope.std < 3e-6
    assert CURVE in found_of(line=5e-4, bow=4e-3).refinements


def test_a_lag_is_that_of_the_sensor() -> None:
    result = found_of(line=5e-4, delay_s=300.0)
    (term,) = (term for term in result.model.terms if term.name == BIAS)
    assert term.constants["lead_s"] == pytest.approx(-300, abs=15)
    assert "behind the thermometer" in result.judgement.text


@pytest.mark.parametrize("seed", [0, 5])
def test_the_width_of_the_branches_is_estimated(seed: int) -> None:
    result = found_of(seed, line=5e-4, glue=4e-3)
    assert result.refinements == (BIAS,)
    assert result.model.params[f"{HYSTERESIS}.play"].value == pytest.approx(2.0, abs=0.2)
    errors = [result.start.pooled_excess, *(step.after.pooled_excess for step in result.steps)]
    assert errors == sorted(errors, reverse=True)


def test_a_constant_temperature_is_no_cause() -> None:
    random = np.random.default_rng(0)
    volts, _ = record(random)
    constant = [20 + 0.01 * random.standard_normal(SAMPLES)]
    still = reduce_record([Samples("x", [volts], RATE_HZ, "V", logged={"temperature_c": constant})], "made")
    assert found(still).causes == ()
    assert found(still).residual_structure is None


def test_a_ramp_that_does_nothing_is_no_cause() -> None:
    for seed in range(3):
        assert found_of(seed).causes == ()


@pytest.mark.slow
def test_noise_is_named_beside_what_the_temperature_does() -> None:
    result = found_of(line=5e-4, walk=1e-5)
    assert result.causes == (BIAS, "rate-random-walk")


def test_diagnosis_and_discovery_name_the_same() -> None:
    still = ramp(line=5e-4, bow=4e-3)
    asked = diagnose(still, read_model("still"))
    assert (asked.verdict, asked.missing) == ("effect-missing", (BIAS, CURVE))
    assert asked.candidates[0].name == BIAS


def test_the_rest_of_a_search_proposes_its_next_effect() -> None:
    data = dataset(ramp(line=5e-4, bow=4e-3))
    plan = data.search(read_model("still"), catalogue())
    rest = data.follow_plan(plan, 1, catalogue())
    assert rest.candidates[0].name == rest.names[0] == CURVE


def test_a_calibrated_model_fits_its_record_and_another_one_of_the_sensor(tmp_path: Path) -> None:
    result = found_of(line=5e-4, bow=4e-3)
    model = parse_model(dump_model(result.model), "made.yaml", catalogue())
    for seed in (0, 1):
        other = ramp(seed, line=5e-4, bow=4e-3)
        assert compare(other, model).adequate
        assert diagnose(other, model).missing == ()
    again = dataset(ramp(1, line=6e-4, bow=4e-3)).fit(model).model.params[f"{BIAS}.x"]
    assert again.value == pytest.approx(6e-4, abs=3 * again.std)


def test_a_model_with_a_line_misses_the_curve() -> None:
    still = ramp(line=5e-4, bow=4e-3)
    straight = dataset(still).add(catalogue()[BIAS], read_model("still"), catalogue()).model
    result = discover(still, straight)
    assert (result.verdict, [step.name for step in result.steps]) == ("adequate", [CURVE])
    assert result.end.pooled_excess < 1.15


def test_an_effect_of_temperature_is_added_to_a_noise_model() -> None:
    added = dataset(ramp(line=5e-4)).add(catalogue()[BIAS], read_model("still"), catalogue())
    assert added.model.params[f"{BIAS}.x"].value == pytest.approx(5e-4, rel=0.02)
    assert added.end.pooled_excess < 1.15


def test_a_record_without_temperature_has_no_effect_of_it() -> None:
    model = found_of(line=5e-4).model
    volts, _ = record(np.random.default_rng(0))
    bare = reduce_record([Samples("x", [volts], RATE_HZ, "V")], "made")
    with pytest.raises(DataError, match="temperature_c"):
        compare(bare, model)
    with pytest.raises(ModelError, match="temperature"):
        dataset(bare).add(catalogue()[BIAS], read_model("still"), catalogue())


def test_each_channel_has_its_own_slope() -> None:
    random = np.random.default_rng(0)
    slopes = {"x": 5e-4, "y": -2e-4}
    each = {axis: record(random, line=slope) for axis, slope in slopes.items()}
    samples = [Samples(axis, [v], RATE_HZ, "V", logged={"temperature_c": [warm]}) for axis, (v, warm) in each.items()]
    result = found(reduce_record(samples, "made"))
    assert result.causes == (BIAS,)
    for axis, slope in slopes.items():
        assert result.model.params[f"{BIAS}.{axis}"].value == pytest.approx(slope, rel=0.02)
