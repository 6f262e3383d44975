"""Free forms that a person asks for by name, and places that a search leaves out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import calibrations as cal
from calibrations.discovery.rows import Rows
from calibrations.discovery.structural import structure
from calibrations.effects.catalogue import catalogue
from calibrations.errors import CalibrationError, ModelError
from calibrations.fitting.fit import Fit, evaluate, fit
from calibrations.free_forms.chain import ModelEffects, start, state_at
from calibrations.free_forms.place_names import EFFECTS_AT, GEOMETRY_PLACE, PLACES, place_of_effect
from calibrations.free_forms.places import components
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.requested import DRIVERS, RequestedForm, resolve_effect
from calibrations.loop import dataset, discover
from calibrations.model.file import dump_model, parse_model, read_model
from calibrations.table import Array, Table
from tests.calibrations.test_free_forms import forces_of_sweep, poses

FORCES = forces_of_sweep()
WARMING = np.linspace(20.0, 35.0, len(FORCES))
HEADINGS = np.radians(poses(np.zeros((len(FORCES), 2))).column("beta_deg"))
TILTED = np.column_stack([np.sin(HEADINGS), -np.cos(HEADINGS)])  # by a tilt of the base about its x axis
CURVES: dict[str, Array] = {
    "own-response": 1e-3 * np.sin(4 * FORCES[:, :2]),
    "cross-response": 1e-3 * np.cos(4 * FORCES[:, [1, 0]]),
    "temperature-bias": 1e-3 * np.tanh((WARMING - 28) / 3)[:, None] * [1.0, -0.5],
    "temperature-axes": 1e-3 * ((WARMING - 28) / 8)[:, None] * (FORCES[:, [1, 0]] + [0.5, -0.8] * FORCES[:, [2, 2]]),
    "tilt-over-time": 1e-3 * np.linspace(-1, 1, len(FORCES))[:, None] ** 3 * TILTED,
    "beta-bias": 1e-3 * np.cos(HEADINGS)[:, None] * [1.0, -0.4],
    "time-bias": 1e-3 * np.exp(-np.linspace(0, 5, len(FORCES)))[:, None] * [1.0, 2.0],
    "column:humidity": 1e-3 * ((WARMING - 27) / 8)[:, None] ** 2 * [1.0, 1.0],
}


def table(added: Array | float = 0.0, **columns: Array) -> Table:
    made = poses(np.zeros((len(FORCES), 2)) + added)
    return replace(made, columns={**made.columns, **columns})


def with_form(place: str, data: Table) -> Fit:
    return Rows(data).add(resolve_effect(f"free:{place}", {}), read_model("linear"), catalogue()).end


def changing(place: str) -> dict[str, Array]:
    warming = {"temperature_c": WARMING}
    return {
        "temperature-bias": warming, "temperature-axes": warming, "column:humidity": {"humidity": WARMING},
    }.get(place, {})  # fmt: skip


@pytest.mark.parametrize("place", CURVES)
def test_a_requested_form_takes_up_the_curve_at_its_place(place: str) -> None:
    found = with_form(place, table(CURVES[place], **changing(place)))
    assert found.pooled_excess < 1.1
    assert found.held_out_excess < 1.5  # folds of neighbouring poses: a curve over time is continued


def test_the_library_adds_a_curve_by_the_name_of_its_place() -> None:
    data = table(CURVES["own-response"])
    wavy = cal.add("linear", "free:own-response")
    assert cal.fit(data, wavy).pooled_excess < 1.1 < cal.fit(data, "linear").pooled_excess
    with pytest.raises(ModelError, match="free:own-response is already in the model"):
        cal.add(wavy, "free:own-response")
    with pytest.raises(CalibrationError, match="own-response"):
        cal.add("linear", "free:own-respons")


@pytest.mark.parametrize("place", ["own-response", "z-response", "history", "time-scale", "output"])
def test_a_requested_form_changes_nothing_where_nothing_acts(place: str) -> None:
    data = table()
    without, found = fit(read_model("linear"), data), with_form(place, data)
    assert found.pooled_excess == pytest.approx(without.pooled_excess, rel=5e-3)
    assert found.held_out_excess == pytest.approx(without.held_out_excess, rel=5e-3)
    for key, e in without.params.items():
        assert e.std is not None
        assert found.params[key].value == pytest.approx(e.value, abs=e.std)


def test_a_model_file_may_name_a_form_without_sizes() -> None:
    text = "schema: rig.model/1\nname: mine\neffects:\n- effect: bias\n- effect: scale-factor\n"
    model = parse_model(f"{text}- effect: free:own-response\n", "mine.yaml")
    assert parse_model(dump_model(model), "again").effects == model.effects
    data = table(CURVES["own-response"])
    assert evaluate(model, data) is None
    assert dataset(data).compare(model).adequate
    found = fit(model, data)
    assert found.model.name == "mine"
    again = evaluate(parse_model(dump_model(found.model), "again"), data)
    assert again is not None
    assert np.array_equal(again.residual, found.residual)


def test_a_search_begins_with_a_requested_form() -> None:
    model = read_model("linear").with_effect(resolve_effect("free:own-response", {}))
    assert discover(table(CURVES["own-response"]), model).steps == ()


def test_a_form_does_not_depend_on_the_order_of_rows() -> None:
    data = table(CURVES["own-response"])
    shuffled = data.rows(np.random.default_rng(1).permutation(data.n))
    a, b = with_form("own-response", data), with_form("own-response", shuffled)
    assert b.residual == pytest.approx(a.residual, abs=1e-9)


few = np.arange(0, len(FORCES), 20)
BAD = {
    "free:own-respons": (table(), 'did you mean "own-response"'),
    "free:geometry": (table(), "axis-misalignment"),
    "free:own-response": (table().rows(few), "needs 24 poses or more, and the data has 19"),
    "free:z-response": (table().rows(table().column("alpha_deg") == 90), "has one only, 90; measure at other"),
    "free:temperature-bias": (table(temperature_c=np.full(len(FORCES), 24.0)), "has one only, 24; measure while"),
    "free:temperature-scale": (table(), "needs the column temperature_c"),
    "free:column:humidity": (table(humidity=np.full(len(FORCES), 40.0)), "humidity is constant"),
    "free:column:humidty": (table(humidity=WARMING), 'did you mean "humidity"'),
    "free:column:temperature_c": (table(temperature_c=WARMING), "use free:temperature-bias"),
    "free:column:std": (table(), "vx_std_v is constant"),
    "free:history": (table().rows(table().column("direction") > 0), "from one only"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_form_that_the_data_cannot_show_is_refused_with_the_data_it_needs(name: str) -> None:
    data, message = BAD[name]
    with pytest.raises(CalibrationError, match=message):
        dataset(data).add(resolve_effect(name, {}), read_model("linear"), catalogue())


def test_a_model_with_a_form_that_the_data_cannot_show_is_refused() -> None:
    model = read_model("linear").with_effect(resolve_effect("free:own-response", {}))
    with pytest.raises(ModelError, match="needs 24 poses"):
        fit(model, table().rows(few))


def test_a_curve_over_beta_has_no_line_beside_it() -> None:
    """It has its first wave, which is that of a tilted base, in itself."""
    start = fit(read_model("linear"), table(CURVES["beta-bias"]))
    found = structure(start, catalogue())
    (over_beta,) = found.free_forms
    with_line = replace(found, geometry=replace(found.geometry, lines={"beta-bias": 1e-3}))
    assert with_line.free_forms == (over_beta,)
    assert {form.place for form in over_beta} == {"beta-bias"}


def test_every_place_has_a_driver_and_an_entry_of_effects() -> None:
    assert set(DRIVERS) == set(PLACES)
    assert set(PLACES) | {GEOMETRY_PLACE} <= set(EFFECTS_AT)
    named_effects = [name for effects in EFFECTS_AT.values() for name in effects]
    assert sorted(named_effects) == sorted(set(named_effects) & set(catalogue()))
    assert all(RequestedForm(place).acts_on for place in PLACES)


def test_effects_of_the_search_are_listed_at_their_places() -> None:
    data = PoseData.of(table(temperature_c=WARMING, supply_v=5 + 0.01 * WARMING, vx_std_v=WARMING, vy_std_v=WARMING))
    nothing = ModelEffects.without_effects(data)
    for c in components(data, state_at(data, nothing, start(data, nothing), ())):
        assert not c.cause or place_of_effect(c.cause) == c.place


def test_a_component_has_as_many_columns_at_any_lead_of_a_coarse_thermometer() -> None:
    """Its readings have few values, and the level that leads them has many."""
    data = PoseData.of(table(temperature_c=np.round(WARMING / np.ptp(WARMING) * 3) / 3))
    nothing = ModelEffects.without_effects(data)
    state = state_at(data, nothing, start(data, nothing), ())
    curves = [c for c in components(data, state) if c.name in ("temperature-bias/curve", "temperature-scale/curve")]
    assert len(curves) == 2
    for curve in curves:
        assert curve.reshaped is not None
        assert curve.reshaped((-60.0,)).jacobian(state).shape == curve.jacobian(state).shape


@pytest.mark.slow
def test_a_place_left_out_gets_neither_a_cause_nor_a_curve() -> None:
    data = table(1e-3 * FORCES[:, [1, 0]] ** 2)
    assert discover(data, read_model("linear")).causes == ("cross-axis-bias",)
    found = discover(data, read_model("linear"), without=["cross-response"])
    assert {"cross-axis-bias", "free:cross-response"}.isdisjoint(step.name for step in found.steps)
    assert "Places left out of the search: cross-response." in found.judgement.text
    assert found.to_dict()["left_out"] == ["cross-response"]


@pytest.mark.parametrize(
    ("place", "message"), [("own-respons", 'did you mean "own-response"'), ("column:humidty", "has no column humidty")]
)
def test_an_unknown_place_cannot_be_left_out(place: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        discover(table(), read_model("linear"), without=[place])
