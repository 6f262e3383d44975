"""Gyroscopes: effects found and fitted on tables of rates, a published calibration, the rotation of the earth."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError
from calibrations.fitting.fit import Fit, fit
from calibrations.geometry.rate_table import EARTH_DEG_S, earth_rate_warning, rate_deg_s, turn_axes
from calibrations.geometry.sphere import estimate_faces
from calibrations.loop import discover
from calibrations.model.file import dump_model, parse_model, read_model
from calibrations.table import Table
from tests.calibrations import turned

GYROSCOPE = read_model("gyroscope")
WHOLE = GYROSCOPE.with_effect(catalogue()["gyro-misalignment"]).with_effect(catalogue()["gyro-g-sensitivity"])


def values(found: Fit, effect: str) -> dict[str, float]:
    term = next(term for term in found.model.terms if term.name == effect)
    return {f"{e.name} {e.axis}".strip(): e.value for e in term.estimates}


def test_the_published_calibration_is_reproduced() -> None:
    published = json.loads((turned.DATA / "imucal_ferraris_gyro" / "example_cal.json").read_text())
    table = turned.ferraris()
    found = fit(WHOLE, table)
    assert list(values(found, "gyro-scale-factor").values()) == pytest.approx([16.6777, 16.1879, 16.2534], abs=2e-4)
    assert list(values(found, "gyro-bias").values()) == pytest.approx(published["b_g"], abs=0.02)
    lean = np.sin(np.radians(list(values(found, "gyro-misalignment").values())))
    turn = -np.array(published["R_g"])  # theirs were turned the other way round
    assert lean == pytest.approx(turn[[0, 0, 1, 1, 2, 2], [1, 2, 0, 2, 0, 1]], abs=5e-4)
    per_g = 9.81 * np.array(published["K_ga"])  # theirs is per m/s^2
    by_name = values(found, "gyro-g-sensitivity")
    assert [by_name[f"{a} {g}"] for g in "xyz" for a in "xyz"] == pytest.approx(per_g.ravel(), abs=0.06)


def test_the_accelerometer_beside_it_has_the_published_bias() -> None:
    table = turned.ferraris()
    still = table.column("rate_deg_s") == 0
    held = estimate_faces(np.column_stack([table.column(f"a{axis}")[still] for axis in "xyz"]))
    assert held is not None
    assert held.bias == pytest.approx([-6.01887, -48.28787, -28.96637], abs=5e-6)


def test_what_others_found_misaligned_is_found_by_name() -> None:
    found = discover(turned.ferraris(), GYROSCOPE)
    assert found.causes == ("gyro-misalignment",)
    assert found.start.pooled_excess > 50
    assert "the fit cannot check all of the 12 parameters" in str(
        found.caution
    )  # one turn about each edge, and none back


@pytest.mark.parametrize(
    ("lean_deg", "per_g", "causes"),
    [
        (0.0, 0.0, ()),
        (0.4, 0.0, ("gyro-misalignment",)),
        (0.0, 0.5, ("gyro-g-sensitivity",)),
        (0.4, 0.5, ("gyro-misalignment", "gyro-g-sensitivity")),
    ],
)
def test_effects_that_a_gyroscope_model_misses_are_found(
    lean_deg: float, per_g: float, causes: tuple[str, ...]
) -> None:
    found = discover(turned.gyroscope(seed=5, lean_deg=lean_deg, per_g=per_g), GYROSCOPE)
    assert set(found.causes) == set(causes)
    assert found.verdict == "adequate"


def test_values_come_back_within_their_uncertainties() -> None:
    errors = []
    for seed in range(12):
        found = fit(WHOLE, turned.gyroscope(seed, lean_deg=0.4, per_g=0.5))
        lean = Rotation.from_rotvec([0.12, -0.4, 0.24], degrees=True).as_matrix()
        truth = {"xy": lean[0, 1], "xz": lean[0, 2], "zx": lean[2, 0], "zy": lean[2, 1]}
        estimates = {(t.name, e.name, e.axis): e for t in found.model.terms for e in t.estimates}
        for name, sine in truth.items():
            e = estimates["gyro-misalignment", name, ""]
            errors.append((e.value - np.degrees(np.arcsin(sine))) / (e.std or 1))
        e = estimates["gyro-g-sensitivity", "z", "x"]
        errors.append((e.value - 0.5) / (e.std or 1))
    assert 0.8 < np.std(errors) < 1.25


def about_z(rates: tuple[float, ...] = (0.0, 30.0, -30.0, 60.0, -60.0), **more: float) -> Table:
    """What the rig's table does: turns about z alone, both ways; x leans by 0.01 rad towards z."""
    rate = np.array(rates * 4)
    noise = 0.001 * np.random.default_rng(0).standard_normal((3, len(rate)))
    columns = {
        "rate_deg_s": rate,
        "gx": 0.5 * 0.01 * rate + noise[0],
        "gy": 0.2 + noise[1],
        "gz": 0.5 * rate + noise[2],
    }
    return Table.from_columns("rates", columns, dict(more), "made")


def test_turns_about_one_axis_show_what_they_can() -> None:
    found = discover(about_z(), GYROSCOPE)
    assert found.causes == ("gyro-misalignment",)
    assert values(found.end, "gyro-scale-factor") == pytest.approx({"scale z": 0.5}, abs=1e-3)
    lean = values(found.end, "gyro-misalignment")
    assert set(lean) == {"xz", "yz"}
    assert np.sin(np.radians(lean["xz"])) == pytest.approx(0.01, abs=1e-4)
    again = parse_model(dump_model(found.end.model), "again.yaml")
    assert fit(again, about_z()).rmse == pytest.approx(found.end.rmse, rel=1e-6)


def test_an_axis_that_was_hardly_turned_about_has_no_scale_factor_of_its_own() -> None:
    table = about_z()
    given = {"axis_x": np.full(20, 0.03), "axis_y": np.zeros(20), "axis_z": np.ones(20)}
    found = fit(GYROSCOPE, Table.from_columns("rates", {**table.columns, **given}))
    assert set(values(found, "gyro-scale-factor")) == {"scale z"}


def test_the_earths_rotation_is_taken_off_where_the_latitude_is_known() -> None:
    table = about_z(latitude_deg=40.443)
    assert rate_deg_s(table)[0] == pytest.approx([0.0, 0.0, EARTH_DEG_S * np.sin(np.radians(40.443))])
    assert pytest.approx(15.041 / 3600, rel=1e-4) == EARTH_DEG_S  # 15.041 deg an hour
    assert earth_rate_warning(table) is None
    assert "give the constant latitude_deg" in str(earth_rate_warning(about_z()))
    down = turned.gyroscope(seed=0)
    upright = Table.from_columns("rates", down.columns, {"latitude_deg": 90.0})
    assert rate_deg_s(upright)[27] == pytest.approx([-EARTH_DEG_S, 0.0, 0.0])  # x down, at rest


def test_the_axis_of_a_turn_is_given_or_seen() -> None:
    table = turned.gyroscope(seed=0)
    assert np.array_equal(turn_axes(table)[[0, 10, 53]], [[1, 0, 0], [0, 1, 0], [0, 0, -1]])
    columns = {name: table.column(name) for name in ("rate_deg_s", "gx", "gy", "gz")}
    given = {f"axis_{axis}": 2.0 * table.column(f"a{axis}") for axis in "xyz"}
    assert np.array_equal(turn_axes(Table.from_columns("rates", columns | given)), turn_axes(table))


def test_what_cannot_be_known_of_the_turns_is_said(golden) -> None:
    table = turned.gyroscope(seed=0)
    half = {name: table.column(name)[:27] for name in ("rate_deg_s", "gx", "gy", "gz")}
    with golden.refused(DataError):
        fit(GYROSCOPE, Table.from_columns("rates", half))
    upright = {f"a{axis}": table.column(f"a{axis}")[:27] for axis in "xyz"}
    with golden.refused(DataError):
        fit(GYROSCOPE, Table.from_columns("rates", half | upright | {"rate_deg_s": np.zeros(27)}))
    with golden.refused(DataError):
        fit(GYROSCOPE, about_z((30.0,)))
    oblique = {f"a{axis}": np.ones(27) for axis in "xyz"}
    with golden.refused(DataError):
        fit(GYROSCOPE, Table.from_columns("rates", half | oblique))
    none = {f"axis_{axis}": np.zeros(27) for axis in "xyz"}
    with golden.refused(DataError):
        fit(GYROSCOPE, Table.from_columns("rates", half | none))
