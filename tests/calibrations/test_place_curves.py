"""Curves of places, their symmetry and expressions, and the summary of a discovery."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.discovery.curves import PlaceCurve, _shapes, _variable, place_curve, place_curves
from calibrations.discovery.rows import Rows
from calibrations.discovery.summary import certainty_text, step_shares, summary_lines
from calibrations.effects.catalogue import catalogue
from calibrations.effects.expression import parse
from calibrations.fitting.fit import scales
from calibrations.free_forms.requested import resolve_effect
from calibrations.loop import discover
from calibrations.model.file import read_model
from calibrations.presentation.answers import discovery_text
from calibrations.presentation.charts.places import curve_panel
from tests.calibrations.test_requested_forms import CURVES, FORCES, WARMING, table, with_form


def test_a_curve_is_the_function_that_acts_within_its_band() -> None:
    found = with_form("own-response", table(CURVES["own-response"]))
    curve = place_curve(found, "own-response")
    assert curve is not None
    for axis, k in (("x", 0), ("y", 1)):
        x = FORCES[:, k]
        line = np.polyfit(x, 1e-3 * np.sin(4 * x), 1)  # linear parts belong to bias and scale factor
        true = 1e-3 * np.sin(4 * curve.at[axis]) - np.polyval(line, curve.at[axis])
        assert np.max(np.abs(curve.value[axis] - true)) < 1.2e-4
        assert np.mean(np.abs(curve.value[axis] - true) < 3 * curve.std[axis] + 2e-5) > 0.9
    assert curve.symmetry == "odd about 0"


@pytest.mark.parametrize(
    ("place", "columns", "expression"),
    [
        ("cross-response", {}, "vx += a*sin(c*ay) + b*cos(c*ay)"),
        ("column:humidity", {"humidity": WARMING}, "v += a*(humidity - b)**2"),
    ],
)
def test_an_expression_is_proposed_that_has_the_form_of_the_curve(
    place: str, columns: dict[str, np.ndarray], expression: str
) -> None:
    curve = place_curve(with_form(place, table(CURVES[place], **columns)), place)
    assert curve is not None
    assert curve.expression is not None
    assert curve.expression.replace("vy", "vx").replace("ax", "ay") == expression


@pytest.mark.parametrize(
    ("place", "driver", "unit"),
    [
        ("own-response", "own force", "V"),
        ("temperature-scale", "temperature_c", "V/g"),
        ("time-bias", "t_s", "V"),
        ("stage-angle-beta", "beta_deg", "deg"),
    ],
)
def test_every_expression_that_can_be_proposed_can_be_read(place: str, driver: str, unit: str) -> None:
    x = np.linspace(0.0, 10.0, 24)
    none = {"x": np.zeros(24)}
    curve = PlaceCurve(place, driver, "", unit, {"x": x}, none, none, none)
    shapes = [text for _, text in _shapes(curve, x, _variable(driver, "x") or "")]
    assert len(shapes) > 5
    for text in shapes:
        assert parse(f"v += {text}").names


def test_harmonics_of_the_stage_are_counted() -> None:
    wave = 5e-3 * np.cos(5 * np.radians(table().column("beta_deg")))
    data = table(wave[:, None] * np.column_stack([-FORCES[:, 1], FORCES[:, 0]]))
    curve = place_curve(with_form("stage-angle-beta", data), "stage-angle-beta")
    assert curve is not None
    assert curve.symmetry == "5 waves in a turn of beta"
    assert curve.expression == "beta_deg += a*sin(5*beta) + b*cos(5*beta)"
    assert np.ptp(curve.value["beta"]) == pytest.approx(np.degrees(1e-2), rel=0.05)


def test_a_slow_turn_of_the_base_has_a_curve_in_degrees_for_each_axis() -> None:
    data = table(CURVES["tilt-over-time"])
    curve = place_curve(with_form("tilt-over-time", data), "tilt-over-time")
    assert curve is not None
    assert (curve.unit, curve.driver, curve.largest, curve.expression) == ("deg", "t_s", "about-x", None)
    t = curve.at["about-x"]
    tilt = np.degrees(1e-3 * np.interp(t, data.time_s, np.linspace(-1, 1, data.n)) ** 3)
    assert np.std(curve.value["about-x"] - tilt) < 0.03 * np.ptp(tilt)
    assert np.mean(curve.std["about-x"]) < 0.03 * np.ptp(tilt)
    assert curve_panel(curve, "about-x").x.label == "time, s"


def test_sensing_axes_that_turn_have_a_curve_in_degrees_from_each_axis_to_the_others() -> None:
    warming = {"temperature_c": WARMING}
    found = with_form("temperature-axes", table(CURVES["temperature-axes"], **warming))
    curve = place_curve(found, "temperature-axes")
    assert curve is not None
    assert (curve.unit, curve.driver, curve.expression) == ("deg", "temperature_c", None)
    line = np.degrees(1e-3 * (curve.at["x to y"] - np.mean(curve.at["x to y"])) / 8)
    for name, part in {"x to y": 1.0, "x to z": 0.5, "y to x": 1.0, "y to z": -0.8}.items():
        true = part * line / scales(found)["xy".index(name[0])]
        assert np.all(np.abs(curve.value[name] - true) < 3 * curve.std[name])
        assert curve.std[name][-1] < 0.12 * abs(true[-1])  # on the first, cold poses no force is out of the plane
    assert curve_panel(curve, "x to z").x.label == "temperature, degC"


def test_a_place_without_an_effect_or_without_one_driver_has_no_curve() -> None:
    found = with_form("history", table())
    assert place_curve(found, "own-response") is None
    assert place_curve(found, "history") is None


@pytest.mark.slow
def test_the_summary_has_a_line_for_each_cause_and_the_shares_of_the_steps_add_up() -> None:
    found = discover(table(1e-3 * np.cos(4 * FORCES[:, [1, 0]]) + 1e-3 * FORCES[:, :2] ** 3), read_model("linear"))
    lines = summary_lines(found)
    assert sum(line.share for line in lines) == pytest.approx(1.0)
    assert {line.place for line in lines} == {"cross-response", "own-response"}
    own = next(line for line in lines if line.place == "own-response")
    cubic = 1e-3 * FORCES[:, 0] ** 3
    rest = cubic - np.polyval(np.polyfit(FORCES[:, 0], cubic, 1), FORCES[:, 0])
    assert own.size == pytest.approx(1e3 * np.std(rest), rel=0.1)
    whole = found.start.held_out_excess**2 - 1
    assert sum(share or 0.0 for share in step_shares(found)) == pytest.approx(
        1 - (found.end.held_out_excess**2 - 1) / whole
    )
    document = found.to_dict()
    assert [line["place"] for line in document["summary"]] == [line.place for line in lines]
    assert [step["share"] for step in document["steps"]] == step_shares(found)
    curves = place_curves(found.findings)
    for place in document["places"]:
        assert len(place["curve"]["at"]) == len(place["curve"]["value"]["x"])
        assert place["symmetry"] == curves[place["place"]].symmetry
    text = discovery_text(found)
    assert all(line.effect in text for line in lines)
    assert "certainty" in text


def test_the_effects_that_a_discovery_adds_are_the_first_candidates() -> None:
    swing = np.sin(np.linspace(0, 19, len(FORCES)))
    added = 1e-3 * FORCES[:, :2] ** 3 + 2e-3 * swing[:, None] * [1.0, -0.7]
    found = discover(table(added, temperature_c=25 + 8 * swing), read_model("linear"))
    assert set(found.causes) == {"cubic-nonlinearity", "temperature-bias"}
    assert [c.name for c in found.findings.candidates][:2] == [step.name for step in found.steps]


def test_an_effect_of_the_model_that_is_no_named_cause_is_called_possible() -> None:
    found = discover(table(1e-3 * np.cos(4 * FORCES[:, [1, 0]]) + 1e-3 * FORCES[:, :2] ** 3), read_model("linear"))
    unnamed = replace(found, findings=replace(found.findings, causes=()))
    own, own_unnamed = (
        next(line for line in summary_lines(result) if line.place == "own-response") for result in (found, unnamed)
    )
    assert (own.effects, own.possible) == (("cubic-nonlinearity",), ())
    assert (own_unnamed.effects, own_unnamed.possible) == ((), ("cubic-nonlinearity",))
    assert own_unnamed.effect == "unknown form, perhaps cubic-nonlinearity"


def test_an_effect_with_one_parameter_is_certain_where_the_data_show_it() -> None:
    leaning = np.radians(0.33) * FORCES[:, 0]
    found = discover(table(np.column_stack([np.zeros_like(leaning), leaning])), read_model("linear"))
    (line,) = summary_lines(found)
    assert line.effects == ("axis-nonorthogonality",)
    assert line.certainty > 0.9999


def test_without_variance_beyond_the_noise_a_step_has_no_share() -> None:
    found = Rows(table()).add(resolve_effect("free:own-response", {}), read_model("linear"), catalogue())
    assert step_shares(found) == [None]
    assert found.to_dict()["steps"][0]["share"] is None


def test_a_certainty_is_never_whole() -> None:
    assert (certainty_text(1.0), certainty_text(0.95)) == ("> 99.99 %", "95 %")
