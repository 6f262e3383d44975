"""An effect that another form of a larger one may replace is no cause, and one of its own is."""

from __future__ import annotations

import pytest

from calibrations.discovery.results import Discovery
from calibrations.discovery.verdict import Verdict
from calibrations.fitting.fit import Fit
from calibrations.loop import discover
from calibrations.model.file import read_model
from tests.benchmark.shaking import MECHANISMS, OUTSIDE, measured, size_for
from tests.slow import before_release, slow


def discovered(**floors: float) -> Discovery[Fit]:
    """The answer where each mechanism alone would leave so many noise floors."""
    every = {MECHANISMS[name.replace("_", "-")]: times for name, times in floors.items()}
    acting = tuple((m, size_for(m, times, "two lines", 0)) for m, times in every.items())
    return discover(measured(acting, "two lines", 0), read_model("linear"))


@pytest.mark.parametrize("name", [*slow(["z-axis-bias"]), *before_release(["cross-axis-bias", "temperature-scale"])])
def test_what_the_formula_of_a_mechanism_leaves_in_motion_has_no_name(name: str) -> None:
    found = discovered(**{name: 10.0})
    assert found.causes == (name,)
    assert len(found.steps) > 1  # the error still falls
    assert found.end.held_out_excess < 1.5
    assert set(found.alternatives) <= {name}


@pytest.mark.release
def test_what_a_temperature_leaves_over_the_time_has_no_name() -> None:
    assert discovered(temperature_bias=30.0).causes == ("temperature-bias",)


@pytest.mark.slow
def test_an_offset_at_one_attitude_is_no_effect_of_the_catalogue() -> None:
    mechanism = OUTSIDE["one attitude"]
    data = measured(((mechanism, size_for(mechanism, 10.0, "two lines", 0)),), "two lines", 0)
    found = discover(data, read_model("linear"))
    assert found.causes == ()
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.residual_structure == "an offset at alpha = 90 deg, beta = 90 deg only"


@pytest.mark.slow
def test_a_warm_up_beside_a_temperature_that_goes_the_same_way_keeps_its_name() -> None:
    assert discovered(warm_up_bias=10.0).causes == ("warm-up-bias",)


def test_a_clean_record_gets_no_name() -> None:
    assert discover(measured((), "two lines", 1), read_model("linear")).causes == ()


@pytest.mark.parametrize(
    "second", [*slow(["sampling-delay"]), *before_release(["axis-misalignment", "temperature-bias"])]
)
def test_a_second_cause_keeps_its_name(second: str) -> None:
    found = discovered(**{"quadratic-nonlinearity": 10.0, second: 8.0})
    named = {"quadratic-nonlinearity", second}
    replaced = {other for name in found.causes for other in found.alternatives.get(name, ())}
    assert named <= {*found.causes, *replaced}
    assert len(found.causes) == 2


@pytest.mark.parametrize("name", before_release(["clocks part", "slew"]))
def test_effects_that_predict_unseen_stretches_badly_explain_nothing(name: str) -> None:
    mechanism = OUTSIDE[name]
    data = measured(((mechanism, size_for(mechanism, 3.0, "three lines", 1)),), "three lines", 1)
    found = discover(data, read_model("linear"))
    assert (found.verdict, found.causes) == (Verdict.UNEXPLAINED, ())
    assert found.residual_structure is not None
    assert "error on unseen stretches" in found.residual_structure
