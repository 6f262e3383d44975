"""An expression as an effect: fitted like any other, kept in the model file, and nothing that runs."""

from __future__ import annotations

import re

import numpy as np
import pytest

from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.effects.expression_effect import effect_for, own_effect
from calibrations.errors import ExpressionError, ModelError
from calibrations.fitting.fit import Fit, fit
from calibrations.loop import compare, dataset, diagnose
from calibrations.model.file import dump_model, parse_model, read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic

COLUMNS = synthetic.turns((90, 30, 150, 60, 120), step_deg=15.0)
COLUMNS["humidity"] = np.random.default_rng(3).uniform(30, 60, len(COLUMNS["t_s"]))
BETA, TIME = np.radians(COLUMNS["beta_deg"]), COLUMNS["t_s"]
X, Y, Z = synthetic.components(COLUMNS)
SIZE = 20 * synthetic.NOISE_V


def table(on_x: Array, on_y: Array | float = 0.0) -> Table:
    return synthetic.poses(COLUMNS, 2.5 + X + on_x, 2.5 + Y + on_y)


def added(text: str, data: Table) -> Fit:
    return fit(read_model("linear").with_effect(effect_for("own", text, data)), data)


def values(found: Fit) -> dict[tuple[str, str], float]:
    return {(e.name, e.axis): e.value for e in found.model.terms[-1].estimates}


def test_each_axis_has_parameters_of_its_own() -> None:
    found = added("a*sin(5*beta) + b*cos(5*beta)", table(SIZE * np.sin(5 * BETA), -SIZE / 2 * np.cos(5 * BETA)))
    assert found.pooled_excess == pytest.approx(1.0, abs=0.06)
    expected = {("a", "x"): SIZE, ("a", "y"): 0.0, ("b", "x"): 0.0, ("b", "y"): -SIZE / 2}
    assert values(found) == pytest.approx(expected, abs=0.03 * SIZE)


def test_an_expression_may_act_on_one_axis() -> None:
    found = added("vy += a*(humidity - 45)", table(0.0 * X, SIZE / 10 * (COLUMNS["humidity"] - 45)))
    assert values(found) == pytest.approx({("a", ""): SIZE / 10}, rel=0.02)


def test_an_expression_may_change_a_stage_angle() -> None:
    turn = np.radians(0.1) * np.sin(3 * BETA)
    found = added("beta_deg += a*sin(3*beta)", table(-Y * turn, X * turn))
    assert values(found) == pytest.approx({("a", ""): 0.1}, rel=0.02)


BENT = [
    ("a*exp(-t/tau)", "tau", 300.0, SIZE * np.exp(-TIME / 300)),
    ("a*sin(w*t + phi)", "w", 2 * np.pi / 170, SIZE * np.sin(2 * np.pi / 170 * TIME + 1)),
    ("a*step(t - t0)", "t0", 700.0, SIZE * (TIME > 700)),
    ("a*abs(ax)**p", "p", 3.0, SIZE * np.abs(X) ** 3),
    ("a*max(0, ax - c)", "c", 0.4, SIZE * np.maximum(0, X - 0.4)),
    ("vx += a*exp(-((t - t0)/w)**2)", "t0", 900.0, SIZE * np.exp(-(((TIME - 900) / 150) ** 2))),
]


@pytest.mark.parametrize(("text", "name", "truth", "on_x"), BENT, ids=[text for text, *_ in BENT])
def test_parameters_that_bend_it_are_found_without_a_start(text: str, name: str, truth: float, on_x: Array) -> None:
    found = added(text, table(on_x, 0.0 if text.startswith("vx") else on_x))
    assert found.pooled_excess == pytest.approx(1.0, abs=0.06)
    for (parameter, _), value in values(found).items():
        assert parameter != name or value == pytest.approx(truth, rel=0.15)


def test_the_model_file_alone_brings_it_back() -> None:
    data = table(SIZE * (COLUMNS["humidity"] - 45) / 10)
    found = added("a*(humidity - 45)*direction**2 + b*sin(3*beta)", data)
    text = dump_model(found.model)
    again = parse_model(text, "m2.yaml")
    assert dump_model(again) == text
    assert again.terms[-1].effect.needs == ("humidity", "direction", "beta_deg")
    assert [p.name for p in again.terms[-1].effect.parameters] == ["a", "b"]
    assert compare(data, again).adequate
    assert diagnose(data, again).verdict == "adequate"
    assert fit(again, data).theta == pytest.approx(found.theta, rel=1e-3, abs=1e-6)


def test_a_model_written_by_hand_needs_no_values() -> None:
    text = entry(effect="own", expression="a*exp(-t/tau)").replace(
        "{effect: bias}", "{effect: bias}, {effect: scale-factor}"
    )
    found = fit(parse_model(text, "m.yaml"), table(SIZE * np.exp(-TIME / 300), SIZE * np.exp(-TIME / 300)))
    assert values(found)["tau", "x"] == pytest.approx(300, rel=0.1)


def entry(**content: object) -> str:
    return f"schema: rig.model/1\nname: m\neffects: [{{effect: bias}}, {content}]"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ({"effect": "own", "expression": "a*open('x')"}, 'm.yaml: own: column 3: there is no function "open"'),
        ({"effect": "own", "expression": "a.__class__"}, "is not allowed here"),
        ({"effect": "hysteresis", "expression": "a*t"}, "hysteresis is already the name of an effect"),
        ({"effect": "Own One", "expression": "a*t"}, "cannot name an effect"),
        ({"effect": "bias", "columns": ["humidity"]}, "bias has columns but no expression"),
        ({"effect": "own", "expression": "sin(beta)"}, "it has no parameter to fit"),
    ],
)
def test_a_model_file_with_a_bad_expression_is_refused(content: dict[str, object], says: str) -> None:
    with pytest.raises(ModelError, match=re.escape(says)):
        parse_model(entry(**content), "m.yaml")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a*vx_v", "column 3: vx_v is the measured output"),
        ("beta_deg += a*ax", "column 15: ax follows from the stage angles"),
        ("a*temperature", "column 3: needs the column temperature_c; made has: alpha_deg"),
        ("a*humidty", 'column 3: "humidty" is not a column; did you mean "humidity"?'),
        ("vz += a*t", "needs the output of axis z; made has: vx_v, vy_v"),
        ("+".join(f"p{k}*t**{k}" for k in range(13)), "more than 12 parameters"),
    ],
)
def test_what_the_data_cannot_mean_is_refused(text: str, says: str) -> None:
    with pytest.raises(ExpressionError, match=re.escape(says)):
        effect_for("own", text, table(0.0 * X))


def test_what_is_no_number_is_told_with_its_row() -> None:
    with pytest.raises(ExpressionError, match=r"column 3: own is not a number on row 8, with a = .*keep divisors away"):
        added("a*log(ax)", table(0.0 * X))


@pytest.mark.parametrize(
    "text",
    ["a*exp(exp(exp(beta)))", "a*exp(exp(exp(exp(b*sin(beta)))))", "a*sin(beta*1e300*b)", "a*1e150*sin(beta)"],
)
def test_values_that_no_fit_resolves_are_refused(text: str) -> None:
    data = table(0.004 * X**2)
    with pytest.raises(ModelError, match=r"own: the parameter [ab] changes the output by more than a fit can resolve"):
        dataset(data).add(effect_for("own", text, data), read_model("linear"), catalogue())


def test_the_same_text_is_the_same_effect() -> None:
    assert own_effect("own", "a*t") is own_effect("own", "a*t")
    assert isinstance(own_effect("own", "a*t"), Effect)
    assert "own" not in catalogue()


@pytest.mark.slow
def test_unequal_sizes_and_positions() -> None:
    """A column in thousands is fitted as well as one in thousandths; positions need no angles."""
    found = added("a*t**2 + b*1e-6*humidity", table(1e-9 * TIME**2 + 1e-4 * COLUMNS["humidity"]))
    assert values(found)["a", "x"] == pytest.approx(1e-9, rel=0.05)
    assert values(found)["b", "x"] == pytest.approx(100, rel=0.05)
    turned = np.random.default_rng(0).standard_normal((60, 3))
    turned /= np.linalg.norm(turned, axis=1)[:, None]
    data = Table.from_columns("positions", dict(zip(("ax", "ay", "az"), (turned + 0.02 * turned**2).T, strict=True)))
    without, start = fit(read_model("linear"), data), read_model("linear")
    assert (
        fit(start.with_effect(effect_for("own", "a*ax**2 + b*ay**2 + c*az**2", data)), data).rmse < 0.2 * without.rmse
    )
