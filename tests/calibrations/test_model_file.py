"""Model files: what is written comes back, and a wrong key or value is named."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibrations.effect import catalogue
from calibrations.errors import CalibrationError, ModelError, UnknownName
from calibrations.model import Estimate, Model, Term
from calibrations.model_file import SHIPPED, dump_model, parse_model, read_model, shipped_names

numbers = st.floats(allow_nan=False, allow_infinity=False)
words = st.text(st.characters(exclude_categories=("C", "Zl", "Zp")), max_size=20)
TWICE = "{name: bias, value: 1}"
HEAD = "schema: rig.model/1\nname: mine\n"


@st.composite
def terms(draw: st.DrawFn, name: str) -> Term:
    effect = catalogue()[name]
    tied = draw(st.booleans())
    estimates = []
    for parameter in effect.parameters if draw(st.booleans()) else ():
        for axis in ("x", "y") if parameter.per_axis and not tied else ("",):
            identified = draw(st.booleans())
            std = draw(st.none() | numbers.map(abs))
            why = None if identified else draw(words)
            estimates.append(Estimate(parameter.name, axis, draw(numbers), std, draw(words), identified, why))
    constants = {key: draw(numbers) for key in effect.constants if draw(st.booleans())}
    return Term(effect, tied, tuple(estimates), constants)


@st.composite
def models(draw: st.DrawFn) -> Model:
    names = draw(st.lists(st.sampled_from(sorted(catalogue())), min_size=1, max_size=4, unique=True))
    provenance = draw(st.dictionaries(st.from_regex(r"[a-z]{3,8}", fullmatch=True), words | numbers, max_size=2))
    covered = draw(st.dictionaries(st.just("temperature_c"), st.tuples(numbers, numbers)))
    return Model(draw(words), tuple(draw(terms(name)) for name in names), draw(words), provenance, covered)


@given(models())
def test_round_trip(model: Model) -> None:
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
            "has one value and no axis",
        ),
        (
            f"{HEAD}effects: [{{effect: bias, tied: true, parameters: [{TWICE}, {TWICE}]}}]",
            "bias: bias is given twice",
        ),
        (f"{HEAD}effects: [{{effect: hysteresis, constants: {{x: 1}}}}]", 'hysteresis has no constant "x"'),
        ("schema: [2001-99-99]", "bad.yaml: is not YAML: month must be in"),
        ("[" * 5000, "bad.yaml: is not YAML"),
        (f"{HEAD}effects: [{{effect: bias}}, {{effect: bias}}]", 'the effect "bias" stands in the model twice'),
    ],
)
def test_names_the_key(text: str, says: str) -> None:
    with pytest.raises(ModelError, match=re.escape(says)):
        parse_model(text, "bad.yaml")


def test_unknown_names(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match=r'bad\.yaml: unknown effect "hysterisis"; did you mean "hysteresis"\?'):
        parse_model(f"{HEAD}effects: [{{effect: hysterisis}}]", "bad.yaml")
    with pytest.raises(UnknownName, match='no file is called "phisical"; did you mean "physical"'):
        read_model("phisical")
    with pytest.raises(ModelError, match=r"nowhere\.yaml: the model file cannot be read"):
        read_model(tmp_path / "nowhere.yaml")


def test_adding_an_effect_leaves_the_old_model_alone() -> None:
    linear = read_model("linear")
    more = linear.with_effect(catalogue()["hysteresis"])
    assert linear.effects == ("bias", "scale-factor")
    assert more.effects == ("bias", "scale-factor", "hysteresis")
    assert more.without("hysteresis") == linear


def test_a_tied_effect_is_untied_instead_of_added() -> None:
    common = read_model("common-scale")
    assert not common.holds("scale-factor")
    untied = common.with_effect(catalogue()["scale-factor"])
    assert untied.effects == common.effects
    assert untied.holds("scale-factor")
