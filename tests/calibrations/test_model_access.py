"""A model's parameters by key, and what a person sees of a model and a fit."""

from __future__ import annotations

import pytest

from calibrations.errors import UnknownName
from calibrations.fitting.fit import fit
from calibrations.model import Estimate, Model
from calibrations.model.file import read_model
from tests.calibrations import synthetic
from tests.calibrations.fitted import LINEAR, PHYSICAL, model

FITTED = model({**PHYSICAL, "hysteresis": {"height": (0.003, 0.002), "spread": 0.1}})


def test_a_key_is_effect_parameter_axis() -> None:
    assert FITTED["bias.x"].value == PHYSICAL["bias"]["bias"][0]
    assert FITTED["z-axis-scale.slope.y"].value == PHYSICAL["z-axis-scale"]["slope"][1]
    assert FITTED["hysteresis.spread"].value == 0.1
    assert FITTED["hysteresis.height.y"].axis == "y"


def test_the_whole_key_and_the_beginning_of_one_key_are_understood() -> None:
    assert FITTED["bias.bias.x"] is FITTED["bias.x"]
    common = model({"scale-factor": {"scale": 1.02}})
    assert common["scale-factor"].value == 1.02


def test_every_estimate_has_one_key() -> None:
    estimates = [e for term in FITTED.terms for e in term.estimates]
    assert list(FITTED.params.values()) == estimates
    assert list(FITTED.params)[:2] == ["bias.x", "bias.y"]
    assert "bias.x" in FITTED.params
    assert "bias.q" not in FITTED.params
    assert FITTED.params.get("bias.q") is None


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("bais.x", 'the model has no parameter "bais.x"; did you mean "bias.x"?'),
        ("bias", 'the model has no parameter "bias"; it has bias.x, bias.y'),
        ("hysteresis.spraed", 'did you mean "hysteresis.spread"?'),
    ],
)
def test_an_unknown_key_names_what_is_there(key: str, says: str) -> None:
    with pytest.raises(UnknownName) as error:
        FITTED[key]
    assert says in str(error.value)


def test_a_model_without_values_says_so() -> None:
    with pytest.raises(UnknownName, match=r'the model has no value for "bias\.x"'):
        read_model("linear")["bias.x"]
    assert repr(read_model("linear")) == "linear: bias, scale-factor; not fitted yet"


def test_a_person_sees_values_with_uncertainties() -> None:
    shown = repr(Model("mine", model(LINEAR).terms))
    assert shown.splitlines()[0] == "mine: bias, scale-factor"
    assert "bias.x" in shown
    assert repr(Estimate("reach", "", 0.1234, 0.0012, "g")) == "<reach: 0.1234(12) g>"
    assert repr(Estimate("slope", "x", 1.0, None, "V", False, "no change")) == "<slope x: not identified: no change>"


def test_parameters_of_a_fit_have_value_uncertainty_and_unit() -> None:
    columns = synthetic.turns(step_deg=30)
    x, y, _ = synthetic.components(columns)
    found = fit(read_model("linear"), synthetic.poses(columns, 2.5 + x, 2.5 + 1.1 * y))
    scale = found.params["scale-factor.y"]
    assert (scale.unit, scale.identified) == ("V/g", True)
    assert scale.value == pytest.approx(1.1, abs=1e-4)
    assert scale.std is not None
    report = found.report()
    for part in ("scale-factor.y", "V/g", "noise floor", "linear", f"{found.table.n} rows"):
        assert part in report
    assert repr(found) == report
    assert found._repr_html_().startswith("<pre")
    assert found.to_dict()["schema"] == "rig.fit/1"
