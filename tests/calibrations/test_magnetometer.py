"""Magnetometers: hard and soft iron found and fitted, what orientations must cover, and the Book's way by hand."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from calibrations.analyses.magnetometer_turn import (
    correct_by_extremes,
    estimate_hard_iron,
    field_elements,
    fit_ellipse,
)
from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError, ModelError
from calibrations.fitting.fit import fit
from calibrations.geometry.sphere import SOFT_IRON, coverage_fault, directions, harmonics, worst_ratio
from calibrations.importing.raw_logs import is_raw_log, thin_by_direction
from calibrations.loop import compare, diagnose, discover
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import turned

FIELD = read_model("field")
LEFT = {"BB": 0.91, "CF": 0.79, "FG": 1.345, "HC": 0.76, "HC_improved": 0.55, "IB": 1.04, "JG": 1.01}  # per mille


@pytest.mark.parametrize("device", turned.DEVICES)
def test_soft_iron_brings_the_devices_of_others_to_a_thousandth_of_the_field(device: str) -> None:
    found = discover(turned.sap6(device), FIELD)
    assert [step.name for step in found.steps] == ["hard-iron", "soft-iron"]
    hard, soft = (1e3 * step.after.rmse[0] for step in found.steps)
    assert 6.9 < hard < 27.4
    assert soft == pytest.approx(LEFT[device], abs=0.006)
    assert found.verdict == "adequate"


def test_a_magnet_and_iron_are_found_by_name_and_size() -> None:
    found = discover(turned.magnetometer(turned.in_iron(60, seed=1)), FIELD)
    assert found.causes == ("hard-iron", "soft-iron")
    assert found.verdict == "adequate"
    estimates = {e.axis: e for term in found.end.model.terms if term.name == "hard-iron" for e in term.estimates}
    for axis, truth in zip("xyz", (12.0, -7.0, 21.0), strict=True):
        assert estimates[axis].std is not None
        assert abs(estimates[axis].value - truth) < 4 * float(estimates[axis].std or 0)


def test_uncertainties_of_the_offset_cover_it() -> None:
    errors = []
    for seed in range(16):
        found = fit(read_model("magnetometer"), turned.magnetometer(turned.in_iron(60, seed)))
        term = next(term for term in found.model.terms if term.name == "hard-iron")
        errors += [(e.value - t) / (e.std or 1) for e, t in zip(term.estimates, (12.0, -7.0, 21.0), strict=True)]
    assert 0.85 < np.std(errors) < 1.2


def test_a_magnet_alone_is_not_called_iron() -> None:
    u = directions(turned.magnetometer(turned.in_iron(60, seed=2)))
    outputs = 48.0 * u + np.array([5.0, 1.0, -2.0]) + 0.05 * np.random.default_rng(2).standard_normal((60, 3))
    assert discover(turned.magnetometer(outputs), FIELD).causes == ("hard-iron",)


def test_a_field_that_follows_the_temperature_is_found_beside_iron() -> None:
    temperature = np.random.default_rng(4).uniform(15.0, 35.0, 60)
    outputs = turned.in_iron(60, seed=4) + np.outer(temperature - 25.0, [0.1, 0.0, -0.15])
    given = {"temperature_c": temperature} | {f"m{axis}_std": np.full(60, 0.05) for axis in "xyz"} | {"n": np.ones(60)}
    found = diagnose(turned.magnetometer(outputs, **given), read_model("magnetometer"))
    assert found.verdict == "effect-missing"
    assert found.candidates[0].name == "temperature-bias"


def test_where_it_fails_is_told_by_the_side_of_the_sensor() -> None:
    worst = compare(turned.sap6("HC"), FIELD).fails[0]
    assert worst.text.startswith("side -z: the magnitude is off by +")
    assert "‰ of the field" in worst.text


def test_a_magnet_many_times_stronger_than_the_field_is_found() -> None:
    outputs = turned.in_iron(200, seed=6) + np.array([0.0, 250.0, 100.0])
    found = discover(turned.magnetometer(outputs), FIELD)
    assert found.causes == ("hard-iron", "soft-iron")
    assert 1e3 * found.end.rmse[0] < 1.5


def test_a_log_of_turning_by_hand_is_one_sample_for_each_direction() -> None:
    t = np.linspace(0.0, 1.0, 20_000)
    z, turning = 1 - 2 * t, 2 * np.pi * 40 * t  # a spiral from pole to pole
    u = np.column_stack([np.sqrt(1 - z**2) * np.cos(turning), np.sqrt(1 - z**2) * np.sin(turning), z])
    resting = np.vstack([u[:5000], np.tile(u[5000], (30_000, 1)), u[5000:]])
    log = turned.magnetometer(turned.in_iron(50_000, seed=7, directions=resting))
    assert is_raw_log(log)
    table = thin_by_direction(log)
    assert 400 < table.n <= 486  # 81 cells on each face of a cube
    found = fit(read_model("magnetometer"), table)
    offsets = [e.value for term in found.model.terms if term.name == "hard-iron" for e in term.estimates]
    assert offsets == pytest.approx([12.0, -7.0, 21.0], abs=0.03)


def turn(n: int = 24) -> Array:
    """A horizontal turn beside a magnet and iron, which make an ellipse of it: radii 22 and 18, turned by 30 deg."""
    t = np.radians(np.arange(0.0, 360.0, 360.0 / n))
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    x, y = 22.0 * np.cos(t), 18.0 * np.sin(t)
    noise = 0.01 * np.random.default_rng(0).standard_normal((3, n))
    return np.column_stack([c * x - s * y + 5.0, s * x + c * y - 3.0, np.full(n, 40.0)]) + noise.T


def test_too_few_orientations_are_named(golden) -> None:
    few = coverage_fault(turned.magnetometer(turned.in_iron(5, seed=1)), SOFT_IRON)
    golden.same(few)
    cap = np.random.default_rng(3).normal([0.0, 0.0, 2.0], 0.5, (200, 3))
    cap /= np.linalg.norm(cap, axis=1, keepdims=True)
    some = coverage_fault(turned.magnetometer(turned.in_iron(200, 1, directions=cap)), SOFT_IRON)
    golden.same(some)


def test_what_a_single_turn_cannot_show_is_said_and_not_fitted() -> None:
    table = turned.magnetometer(turn())
    with pytest.raises(DataError, match=r"hard-iron is not fitted: the orientations cover too little of the sphere"):
        fit(read_model("magnetometer"), table)
    found = discover(table, FIELD)
    assert found.verdict == "ambiguous"
    assert "hard-iron and soft-iron cannot be tested" in str(found.caution)
    assert str(found.caution).endswith("the values assume a sensor without this effect")


@pytest.mark.parametrize(("degrees", "hard", "soft"), [(180.0, True, True), (75.0, True, False), (20.0, False, False)])
def test_a_cap_of_the_sphere_shows_less_the_smaller_it_is(degrees: float, hard: bool, soft: bool) -> None:
    rng = np.random.default_rng(3)
    z = 1 - rng.uniform(0.0, 1 - np.cos(np.radians(degrees)), 400)
    across, side = rng.uniform(0, 2 * np.pi, 400), np.sqrt(1 - z**2)
    cap = np.column_stack([side * np.cos(across), side * np.sin(across), z])
    table = turned.magnetometer(turned.in_iron(400, seed=3, noise=0.0, directions=cap))
    assert (coverage_fault(table, 1) is None, coverage_fault(table, 2) is None) == (hard, soft)
    assert (catalogue()["soft-iron"].excluded(table) is None) == soft


def test_harmonics_are_orthonormal_over_the_whole_sphere() -> None:
    u = np.random.default_rng(0).standard_normal((200_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    columns = harmonics(u, 2)
    assert np.allclose(columns.T @ columns / len(u), np.eye(9), atol=0.02)
    assert worst_ratio(u, 2) == pytest.approx(1.0, abs=0.02)


def test_a_model_without_a_field_is_refused(golden) -> None:
    with golden.refused(ModelError):
        fit(read_model("linear"), turned.sap6("BB"))


def test_the_way_by_hand_makes_a_circle_of_a_turn() -> None:
    outputs = turn(720)
    assert estimate_hard_iron(outputs)[:2] == pytest.approx([5.0, -3.0], abs=0.05)
    found = fit_ellipse((outputs - estimate_hard_iron(outputs))[:, :2])
    assert (found.greatest, found.least) == pytest.approx((22.0, 18.0), abs=0.06)
    assert np.degrees(found.angle_rad) % 180.0 == pytest.approx(30.0, abs=2.0)
    assert np.ptp(np.linalg.norm(correct_by_extremes(outputs)[:, :2], axis=1)) < 0.2


def test_the_constant_triad_chooses_between_accelerometer_and_magnetometer() -> None:
    mag = turned.sap6("BB")
    columns = {**mag.columns, **{f"a{axis}": mag.column(f"m{axis}") for axis in "xyz"}}
    assert Table.from_columns("positions", columns).output_names == ("ax", "ay", "az")
    assert Table.from_columns("positions", columns, {"triad": "m"}).output_names == ("mx", "my", "mz")


def test_components_of_a_field_give_its_elements() -> None:
    # Potsdam, 2020, as the IGRF gives it: F 49,600 nT, D 4.5, I 67.9 deg
    d, i = np.radians(4.5), np.radians(67.9)
    x, y, z = 49600.0 * np.array([np.cos(i) * np.cos(d), np.cos(i) * np.sin(d), np.sin(i)])
    assert (float(x), float(y), float(z)) == pytest.approx((18603.0, 1464.1, 45955.0), rel=1e-3)
    assert elements(x, y, z) == pytest.approx({"F": 49600.0, "H": 49600.0 * np.cos(i), "D": 4.5, "I": 67.9})
    assert elements(-1.0, -1.0, 0.0)["D"] == pytest.approx(-135.0)  # the quadrant that atan loses


def elements(north: float, east: float, down: float) -> Mapping[str, float]:
    """F, H, D and I of a sensor whose x points to the north and z upward."""
    return field_elements(np.array([[north, -east, -down]]), np.eye(3)[None], ["one"]).value
