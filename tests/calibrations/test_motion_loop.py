"""Tables of motion in the loop: what is hidden is found first, and a clean record misses nothing."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.documents import comparison_document
from calibrations.fitting.fit import fit
from calibrations.loop import compare, diagnose, discover
from calibrations.model import Model
from calibrations.model.file import parse_model, read_model
from calibrations.table import Table
from tests.calibrations import shaken
from tests.slow import before_release, slow

LINEAR = read_model("linear")
ATTITUDES = ((45.0, 90.0), (90.0, 0.0), (90.0, 180.0), (90.0, 90.0), (90.0, 270.0), (135.0, 45.0))
BIAS_ONLY = "schema: rig.model/1\nname: bias\neffects:\n  - effect: bias\n"


def value(model: Model, effect: str, name: str, axis: str = "x") -> tuple[float, float]:
    term = next(t for t in model.terms if t.name == effect)
    found = next(e for e in term.estimates if e.name == name and e.axis in (axis, ""))
    return found.value, found.std or np.inf


@pytest.mark.slow
@pytest.mark.parametrize("records", [10, *before_release([50])])
def test_a_clean_record_misses_nothing(records: int) -> None:
    excesses, p_values = [], []
    for seed in range(records):
        motion = (shaken.PAPER, shaken.TWO)[seed % 2]
        table = shaken.record(motion, 10.0, seed)
        found = diagnose(table if seed % 3 else shaken.without_y(table), LINEAR)
        assert found.verdict == "adequate"
        assert seed % 5 or compare(table, LINEAR).adequate
        excesses.append(found.excess_before)
        p_values.append(min(c.p_value for c in found.candidates))
    assert np.mean(excesses) == pytest.approx(1.0, abs=0.28 / np.sqrt(records))
    assert np.quantile(p_values, 0.1) > 0.03  # least of a search on noise: uniform, or above


@pytest.mark.slow
def test_slow_noise_is_found_in_the_means_and_is_no_effect() -> None:
    rng = np.random.default_rng(4)
    slow = []
    for seed in range(6):
        table = shaken.record(shaken.TWO, 20.0, seed)
        wander = 4e-6 * np.cumsum(rng.standard_normal(table.n))
        columns = {**table.columns, "vx_v": table.column("vx_v") + wander}
        found = diagnose(Table.from_columns("motion", columns, table.constants), LINEAR)
        assert not found.missing
        slow.append(found.fit.noise.slow / found.fit.noise.floor)
    means, others = np.mean(slow, axis=0)[0], np.mean(slow, axis=0)[1:]
    assert means > 3 * np.max(others)


def test_parameters_are_right_within_their_uncertainty() -> None:
    pulls = []
    for seed in range(20):
        found = fit(LINEAR, shaken.without_y(shaken.record(duration_s=10.0, seed=seed))).model
        pulls.append([(v - true) / std for (v, std), true in
                      ((value(found, "bias", "bias"), 2.5), (value(found, "scale-factor", "scale"), 1.0))])  # fmt: skip
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 4 / np.sqrt(20))
    assert np.all(np.abs(np.std(pulls, axis=0) - 1) < 0.45)


@pytest.mark.slow
@pytest.mark.parametrize("times", [10, *slow([3]), *before_release([30])])  # the noise floor
@pytest.mark.parametrize(
    ("effect", "hidden", "parameter", "true", "noise_v"),
    [
        ("output-filter", {"corner_hz": 14.0}, "off_nominal", -1.07, 150e-6),
        ("sampling-delay", {"delay_s": 3e-4}, "delay", 3e-4, 85e-6),
    ],
    ids=["corner 14 Hz", "delay 0.3 ms"],
)
def test_a_hidden_defect_of_the_output_is_found_first(
    effect: str, hidden: dict[str, float], parameter: str, true: float, noise_v: float, times: int
) -> None:
    table = shaken.record(shaken.TWO, 20.0, times, noise_v=noise_v / times, **hidden)
    found = diagnose(shaken.without_y(table), LINEAR)
    assert found.verdict == "effect-missing"
    assert found.candidates[0].name == effect
    assert found.excess_before == pytest.approx(times, rel=0.4)
    assert found.candidates[0].held_out_after < 1.15
    end = discover(table, LINEAR).end
    assert end.held_out_excess < 1.15
    estimate, std = value(end.model, effect, parameter)
    assert abs(estimate - true) < 4 * std


@pytest.mark.slow
@pytest.mark.parametrize("turn_deg", [0.5, *before_release([1.0, 3.0])])
def test_a_hidden_turn_is_found_first_where_attitudes_differ(turn_deg: float) -> None:
    table = shaken.record(shaken.TWO, 48.0, attitudes=ATTITUDES, turn_deg=(0.3 * turn_deg, 0.0, turn_deg))
    found = diagnose(table, LINEAR)
    assert found.candidates[0].name == "axis-misalignment"
    assert found.verdict == "effect-missing"
    assert found.candidates[0].held_out_after < 1.15
    z, std = value(discover(table, LINEAR).end.model, "axis-misalignment", "z")
    assert abs(z - turn_deg) < 4 * std + 0.01 * turn_deg


@pytest.mark.slow
@pytest.mark.parametrize("more", [2e-3, *before_release([5e-4, 6e-3])])
def test_a_scale_factor_that_differs_between_axes_is_found_first(more: float) -> None:
    table = shaken.record(shaken.TWO, 48.0, attitudes=ATTITUDES, scale_v=(1.0, 1 + more))
    found = diagnose(table, read_model("common-scale"))
    assert found.candidates[0].name == "scale-factor"
    assert found.candidates[0].held_out_after < 1.15
    y, std = value(discover(table, read_model("common-scale")).end.model, "scale-factor", "scale", "y")
    assert abs(y - 1 - more) < 4 * std


def test_at_one_attitude_all_odd_terms_are_scale_factors() -> None:
    found = diagnose(shaken.without_y(shaken.record(duration_s=20.0)), parse_model(BIAS_ONLY, "bias"))
    assert found.verdict == "ambiguous"
    assert "scale-factor" in {found.candidates[0].name, *found.candidates[0].indistinguishable_from}


def test_one_frequency_cannot_tell_a_corner_from_a_delay() -> None:
    found = diagnose(shaken.record(corner_hz=13.0, duration_s=20.0), LINEAR)
    assert found.verdict == "ambiguous"
    assert {found.candidates[0].name, *found.candidates[0].indistinguishable_from} == {
        "output-filter",
        "sampling-delay",
    }


def test_one_attitude_cannot_tell_a_lean_from_a_bias() -> None:
    found = diagnose(shaken.without_y(shaken.record(turn_deg=(0.0, 0.5, 0.0))), LINEAR)
    assert found.verdict == "adequate"
    assert "axis-misalignment" not in {c.name for c in found.candidates}


def test_a_known_skew_of_the_converter_is_no_delay_of_the_sensor() -> None:
    table = shaken.record(shaken.TWO, 20.0, delay_s=-1e-3, constants={"skew_x_s": 1e-3, "skew_y_s": 1e-3})
    assert diagnose(table, LINEAR).verdict == "adequate"


def test_motion_that_begins_in_the_record_is_followed() -> None:
    table = shaken.record(starts_s=4.0, duration_s=15.0)
    assert fit(LINEAR, table).pooled_excess < 1.15
    assert diagnose(table, LINEAR).verdict == "adequate"


def test_comparison_gives_one_value_for_an_axis_and_says_which_part_is_off() -> None:
    result = compare(shaken.record(shaken.TWO, 20.0, corner_hz=12.0), LINEAR)
    document = comparison_document(result, "linear")
    assert set(document["excess"]) == {"x", "y"}
    assert document["fails"][0]["axis"] == "x"
    assert "x in quadrature at 10 Hz is off by" in document["fails"][0]["text"]


@pytest.mark.slow
def test_what_no_effect_explains_is_described() -> None:
    table = shaken.record(shaken.TWO, 20.0)
    echo = 1e-3 * np.cos(2 * np.pi * 10 * (table.time_s - 100) + 0.5) - 1e-3 * np.cos(
        2 * np.pi * 4 * (table.time_s - 100)
    )
    columns = {**table.columns, "vx_v": table.column("vx_v") + echo}
    found = diagnose(Table.from_columns("motion", columns, table.constants), LINEAR)
    assert found.verdict == "unexplained"
    assert found.residual_structure is not None
    assert "is off throughout" in found.residual_structure


def test_a_sensor_that_points_the_other_way_has_a_negative_scale_factor() -> None:
    found = discover(shaken.record(shaken.TWO, 20.0, scale_v=(-1.0, -1.0), delay_s=1e-3), LINEAR)
    assert found.causes == ("sampling-delay",)
    assert value(found.end.model, "scale-factor", "scale")[0] == pytest.approx(-1.0, rel=0.01)
