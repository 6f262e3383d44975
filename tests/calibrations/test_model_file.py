"""Model files: what is written comes back, and a wrong key or value is named."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibrations.effects.catalogue import catalogue
from calibrations.errors import CalibrationError, ModelError, UnknownName
from calibrations.model import Estimate, Model, Term
from calibrations.model.correlations import Correlations
from calibrations.model.file import MOST, SHIPPED, dump_model, parse_model, read_model, shipped_names

numbers = st.floats(-MOST, MOST)
words = st.text(st.characters(exclude_categories=("C", "Zl", "Zp")), max_size=20)
TWICE = "{name: bias, value: 1}"
HEAD = "schema: rig.model/1\nname: mine\n"
ONE = "parameters: [{{name: {}, axis: x, value: 1}}]"
TOGETHER = (
    f"{HEAD}effects: [{{effect: bias, {ONE.format('bias')}}}, {{effect: scale-factor, {ONE.format('scale')}}}, "
    f"{{effect: bias-drift, {ONE.format('slope')}}}]\ncorrelations: "
)


@st.composite
def terms(draw: st.DrawFn, name: str, unit: str) -> Term:
    effect = catalogue()[name]
    tied = draw(st.booleans())
    estimates = []
    for parameter in effect.parameters if draw(st.booleans()) else ():
        for axis in ("x", "y") if parameter.per_axis and not tied else ("",):
            identified = draw(st.booleans())
            std = draw(st.none() | numbers.map(abs))
            why = None if identified else draw(words)
            own = parameter.unit.replace("{out}", unit)
            value = draw(numbers.filter(lambda v: abs(v) >= 1 / MOST))
            estimates.append(Estimate(parameter.name, axis, value, std, own, identified, why))
    constants = {key: draw(numbers) for key in effect.constants if draw(st.booleans())}
    return Term(effect, tied, tuple(estimates), constants)


@st.composite
def models(draw: st.DrawFn) -> Model:
    names = draw(st.lists(st.sampled_from(sorted(catalogue())), min_size=1, max_size=4, unique=True))
    provenance = draw(st.dictionaries(st.from_regex(r"[a-z]{3,8}", fullmatch=True), words | numbers, max_size=2))
    covered = draw(st.dictionaries(st.just("temperature_c"), st.tuples(numbers, numbers)))
    unit = draw(words.filter(bool))
    made = Model(draw(words), tuple(draw(terms(name, unit)) for name in names), unit, provenance, covered)
    keys = list(made.params)
    if len(keys) < 2 or not draw(st.booleans()):
        return made
    size = 1 / len(keys)  # a matrix of such elements is one of correlations
    r = draw(st.lists(st.floats(-size, size), min_size=len(keys) ** 2, max_size=len(keys) ** 2))
    return replace(made, correlations=Correlations.of(keys, np.reshape(r, (len(keys), -1))))


@given(models())
def test_a_model_survives_writing_and_reading(model: Model) -> None:
    assert parse_model(dump_model(model), "again.yaml") == model


@given(st.text(max_size=100))
def test_any_text_is_a_model_or_one_clear_error(text: str) -> None:
    with pytest.raises(CalibrationError, match=r"any\.yaml"):
        parse_model(text, "any.yaml")


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_models_have_no_values_yet(name: str) -> None:
    model = read_model(name)
    assert model.name == name
    assert not any(term.estimates for term in model.terms)
    assert read_model(SHIPPED / f"{name}.yaml") == model


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: [", "bad.yaml: is not YAML: while parsing"),
        ("", "bad.yaml: is not a model: a model file is a mapping"),
        (
            "schema: rig.model/2\nname: mine\neffects: [{effect: bias}]",
            "bad.yaml, key schema: Input should be 'rig.model/1', is 'rig.model/2'",
        ),
        (f"{HEAD}effects: []", "bad.yaml, key effects: List should have at least 1 item"),
        (f"{HEAD}efects: [{{effect: bias}}]", 'did you mean "effects"?'),
        (
            f"{HEAD}effects: [{{effect: bias, tide: true}}]",
            'effects.0.tide: no such key; did you mean "tied"',
        ),
        (f"{HEAD}effects: [{{effect: bias, parameters: [{{name: bias, value: 1, sdt: 2}}]}}]", 'did you mean "std"?'),
        (
            f"{HEAD}effects: [{{effect: bias, parameters: [{{name: bias, value: big}}]}}]",
            "effects.0.parameters.0.value",
        ),
        (f"{HEAD}effects: [{{effect: bias, parameters: [{{name: bias, value: .nan}}]}}]", "should be a finite number"),
        (f"{HEAD}effects: [{{effect: bias, parameters: [{{name: bias, value: 1e13}}]}}]", "less than or equal to 1"),
        (f"{HEAD}effects: [{{effect: bias, parameters: [{TWICE[:-1]}, std: -1}}]}}]", "greater than or equal to 0"),
        (f"{HEAD}effects: [{{effect: hysteresis, constants: {{height: .inf}}}}]", "should be a finite number"),
        (
            f"{HEAD}effects: [{{effect: scale-factor, parameters: [{{name: scale, axis: x, value: 1e-13}}]}}]",
            "the scale is 1e-13, so the sensor would have no response",
        ),
        (
            f"{HEAD}effects: [{{effect: bias, parameters: [{{name: bais, value: 1}}]}}]",
            'no parameter "bais"; did you mean',
        ),
        (
            f"{HEAD}effects: [{{effect: bias, parameters: [{{name: bias, axis: w, value: 1}}]}}]",
            "effects.0.parameters.0.axis: Input should be 'x', 'y' or 'z'",
        ),
        (f"{HEAD}effects: [{{effect: bias, parameters: [{{name: bias, value: 1}}]}}]", "needs `axis: x`, y or z"),
        (
            f"{HEAD}effects: [{{effect: bias, tied: true, parameters: [{{name: bias, axis: x, value: 1}}]}}]",
            "is one value for all axes",
        ),
        (
            f"{HEAD}effects: [{{effect: bias, tied: true, parameters: [{TWICE}, {TWICE}]}}]",
            "bias: bias is given twice",
        ),
        (f"{HEAD}effects: [{{effect: hysteresis, constants: {{x: 1}}}}]", 'hysteresis has no constant "x"'),
        (f"{TOGETHER}{{parameters: [bias.x, bias.y], lower: ['', '0.5']}}", 'no parameter "bias.y" with a value'),
        (
            f"{TOGETHER}{{parameters: [bias.x, scale-factor.x], lower: ['', '0.5 1']}}",
            "has 2 coefficients, and needs 1",
        ),
        (f"{TOGETHER}{{parameters: [bias.x, scale-factor.x], lower: ['', '1.5']}}", "is from -1 to 1, not 1.5"),
        (f"{TOGETHER}{{parameters: [bias.x, scale-factor.x], lower: ['', nan]}}", "is from -1 to 1, not nan"),
        (f"{TOGETHER}{{parameters: [bias.x, bias.x], lower: ['', '0.5']}}", '"bias.x" is given twice'),
        (f"{TOGETHER}{{parameters: [bias.x, scale-factor.x], lower: ['']}}", "need 2 rows, not 1"),
        (f"{TOGETHER}{{parameters: [bias.x], lower: [0,5]}}", "correlations.lower.0"),
        (f"{TOGETHER}{{parameters: [bias.x], lowr: ['']}}", 'no such key; did you mean "lower"'),
        (f"{TOGETHER}{{parameters: [bias.x, scale-factor.x], lower: ['', '0,5']}}", "with blanks between them"),
        (
            f"{TOGETHER}{{parameters: [bias.x, scale-factor.x, bias-drift.slope.x], lower: ['', '0.9', '0.9 -0.9']}}",
            "these coefficients contradict each other",
        ),
        ("schema: [2001-99-99]", "bad.yaml: is not YAML: month must be in"),
        ("[" * 5000, "bad.yaml: is not YAML"),
        (f"{HEAD}effects: [{{effect: bias}}, {{effect: bias}}]", 'the effect "bias" occurs twice in the model'),
    ],
)
def test_an_error_of_a_model_file_names_the_key(text: str, says: str) -> None:
    with pytest.raises(ModelError, match=re.escape(says)):
        parse_model(text, "bad.yaml")


def test_unknown_effects_and_models_are_refused_with_a_suggestion(golden, tmp_path: Path) -> None:
    with golden.refused(UnknownName):
        parse_model(f"{HEAD}effects: [{{effect: hysterisis}}]", "bad.yaml")
    with golden.refused(UnknownName):
        read_model("phisical")
    with golden.refused(ModelError):
        read_model(tmp_path / "nowhere.yaml")


def test_adding_an_effect_leaves_the_old_model_alone() -> None:
    linear = read_model("linear")
    more = linear.with_effect(catalogue()["hysteresis"])
    assert linear.effects == ("bias", "scale-factor")
    assert more.effects == ("bias", "scale-factor", "hysteresis")
    assert more.without("hysteresis") == linear
    drifting = linear.with_effect(catalogue()["bias-drift"]).with_effect(catalogue()["warm-up-bias"])
    assert drifting.without("bias").name == "linear+bias-drift+warm-up-bias"
    assert drifting.without("bias-drift").name == "linear+warm-up-bias"


def test_a_tied_effect_is_untied_instead_of_added() -> None:
    common = read_model("common-scale")
    assert not common.holds("scale-factor")
    untied = common.with_effect(catalogue()["scale-factor"])
    assert untied.effects == common.effects
    assert untied.holds("scale-factor")


VALUES = """unit: {unit}
effects:
- effect: bias
  parameters: [{{name: bias, axis: x, value: 2.5{bias}}}]
- effect: scale-factor
  parameters: [{{name: scale, axis: x, value: 1.0, unit: {scale}}}]
- effect: stage-zero-offset
  parameters: [{{name: {angle}, value: 0.1, unit: {deg}}}]
"""
ANGLE = catalogue()["stage-zero-offset"].parameters[0].name


def with_units(unit: str = "V", bias: str = ", unit: V", scale: str = "V/g", deg: str = "deg") -> Model:
    text = VALUES.format(unit=unit, bias=bias, scale=scale, angle=ANGLE, deg=deg)
    return parse_model(HEAD + text, "mine.yaml")


@pytest.mark.parametrize(
    ("units", "says"),
    [
        ({"unit": "mV"}, 'bias: the unit of "bias" x is V, and must be mV in a model with `unit: mV`; values are not'),
        ({"scale": "mV/g"}, 'scale-factor: the unit of "scale" x is mV/g, and must be V/g in a model with `unit: V`'),
        ({"deg": "rad"}, f'stage-zero-offset: the unit of "{ANGLE}" is rad, and must be deg; values are not converted'),
        ({"unit": '""'}, 'bias: the unit of "bias" x is V; also give the unit of the outputs, such as `unit: V`'),
    ],
)
def test_units_that_do_not_fit_are_refused(units: dict[str, str], says: str) -> None:
    with pytest.raises(ModelError, match=re.escape(f"mine.yaml: {says}")):
        with_units(**units)


def test_a_parameter_without_a_unit_has_the_declared_one() -> None:
    model = with_units(bias="")
    assert [e.unit for term in model.terms for e in term.estimates] == ["V", "V/g", "deg"]
