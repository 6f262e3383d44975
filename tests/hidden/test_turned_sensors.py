"""Magnetometers and gyroscopes with a hidden fault: measured by their procedures in the simulated world, and named.

Which effect a mechanism should be called is written here and nowhere else.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from calibrations.fitting.matrices import calibration_matrices
from calibrations.loop import diagnose, discover
from calibrations.model.file import read_model
from calibrations.table import Table
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.magnetometer_turn import magnetometer_turn
from procedures.rate_turn import rate_turn
from rig.record.measured import positions_table, rates_table
from rig.record.values import Run
from rig.results.result import fit_shipped
from tests.procedures.bench import session

SQUARE = {"turn_x_deg": 0.5, "turn_y_deg": -0.8, "turn_z_deg": 0.3}
UNEVEN = {"unbalance_fraction": 0.02, "off_square_per_nm": 40.0, "demodulator_deg": 4.0}
MAGNET = {"magnet": {"x_mm": 28.0, "y_mm": -12.0, "moment_x_ma_m2": 1.6, "moment_z_ma_m2": -2.1}}
IRON = {"iron": {"x_mm": 9.0, "y_mm": 17.0, "z_mm": -4.0, "radius_mm": 7.0}}


def run(kind: str, **constants: float) -> Run:
    """A run as the record has it, of which only kind and constants count."""
    return Run("hidden", kind, kind, "complete", {}, {}, {}, "", constants, "", "", None, None, {}, 0)  # fmt: skip


def turned(seed: int = 2, latitude_deg: float | None = 40.443, world: Any = None, **gyroscope: Any) -> Table:
    """The table of a gyroscope with these faults, each edge up and down, two rates both ways."""
    rig, book = session(World(WorldConfig.ideal().changed({"gyroscope": gyroscope, **(world or {})}), seed))
    rate_turn(rig, rates_deg_s=(60.0, 80.0), rest_s=3.0)
    known = {} if latitude_deg is None else {"latitude_deg": latitude_deg}
    return rates_table(run("rates", **known), book.blocks)


@cache
def _field(seed: int, over: bool, mounts: int, magnet: bool, iron: bool, world: bool) -> Table:
    beside = {**(MAGNET if magnet else {}), **(IRON if iron else {})}
    place = {"laboratory": {**MAGNET, **IRON}} if world else {}
    config = WorldConfig.ideal().changed({"magnetometer": beside, **place})
    rig, book = session(World(config, seed))
    magnetometer_turn(rig, step_deg=30.0, dwell_s=0.2, over=over, mounts=mounts)
    return positions_table(run("positions"), book.blocks)


def field(seed: int = 2, *, over: bool = True, mounts: int = 3, magnet: bool = False, iron: bool = False) -> Table:
    """The table of a magnetometer beside a magnet, iron, or nothing of its own."""
    return _field(seed, over, mounts, magnet, iron, False)


def test_the_fault_of_a_gyroscope_is_named() -> None:
    answer = diagnose(turned(x=UNEVEN, y=UNEVEN, z=UNEVEN), read_model("gyroscope"))
    assert answer.verdict == "effect-missing"
    assert answer.candidates[0].name == "gyro-g-sensitivity"


def test_two_faults_of_a_gyroscope_are_found_one_after_the_other_and_nothing_else() -> None:
    found = discover(turned(**SQUARE, x=UNEVEN, y=UNEVEN, z=UNEVEN), read_model("gyroscope"))
    assert (found.verdict, set(found.causes)) == ("adequate", {"gyro-misalignment", "gyro-g-sensitivity"})


@pytest.mark.parametrize("seed", range(2))
def test_of_a_gyroscope_without_fault_nothing_is_missing(seed: int) -> None:
    assert diagnose(turned(seed), read_model("gyroscope")).verdict == "adequate"


def test_what_is_fitted_is_what_the_mechanism_has() -> None:
    """The die is turned by small angles: x feels a turn about y as the angle about z, and so on, with their signs.

    The pick-up gives 0.11 V for the Coriolis displacement of 1 deg/s, 0.055 nm.
    """
    found = fit_shipped(turned(**SQUARE), "gyroscope", "gyro-misalignment", "gyro-g-sensitivity")
    lean = {e.name: e for e in found.model.estimates("gyro-misalignment")}
    expected = {"xy": -0.3, "yx": 0.3, "xz": -0.8, "zx": 0.8, "yz": -0.5, "zy": 0.5}
    for pair, deg in expected.items():
        assert lean[pair].value == pytest.approx(deg, abs=0.01)
        assert 0 < (lean[pair].std or 0.0) < 0.005
    coriolis_nm = 2 * np.radians(1) * 15e3 * 6e3 / (2 * np.pi * (15300.0**2 - 15e3**2))
    for e in found.model.estimates("gyro-scale-factor"):
        assert e.value == pytest.approx(0.11 * coriolis_nm, rel=2e-4)
    for e in found.model.estimates("gyro-g-sensitivity"):
        assert abs(e.value) < 5 * (e.std or 0.0)


def test_the_earths_rotation_is_in_the_bias_unless_the_latitude_is_known() -> None:
    """At the pole, where it is all vertical, it follows gravity on six faces, along each edge alike."""
    at_the_pole = {"laboratory": {"latitude_deg": 90.0}}
    unknown = fit_shipped(turned(latitude_deg=None, world=at_the_pole, noise_v=1e-4), "gyroscope", "gyro-g-sensitivity")
    known = fit_shipped(turned(latitude_deg=90.0, world=at_the_pole, noise_v=1e-4), "gyroscope", "gyro-g-sensitivity")
    along = {e.axis: e for e in unknown.model.estimates("gyro-g-sensitivity") if e.axis == e.name}
    for axis, e in along.items():
        assert e.value / 6.05e-3 == pytest.approx(0.00418, abs=0.0008), axis
    for e in known.model.estimates("gyro-g-sensitivity"):
        assert abs(e.value) / 6.05e-3 < 0.0008


@pytest.mark.parametrize(
    ("magnet", "iron", "model", "named"),
    [(True, False, "field", "hard-iron"), (False, True, "field", "soft-iron"), (True, True, "field", "hard-iron")],
)
def test_what_lies_beside_a_magnetometer_is_named(magnet: bool, iron: bool, model: str, named: str) -> None:
    start = read_model(model)
    answer = discover(field(magnet=magnet, iron=iron), start)
    assert named in answer.causes
    assert set(answer.causes) <= {"hard-iron", "soft-iron"}
    assert answer.verdict == "adequate"
    assert ("soft-iron" in answer.causes) == iron


@pytest.mark.parametrize("seed", range(2))
def test_of_a_magnetometer_alone_nothing_is_missing(seed: int) -> None:
    assert diagnose(field(seed), read_model("field")).verdict == "adequate"


def test_iron_that_stands_with_the_rig_is_a_part_of_the_field_and_no_fault() -> None:
    assert diagnose(_field(2, True, 3, False, False, True), read_model("field")).verdict == "adequate"


def test_a_ball_of_iron_comes_back_as_its_dipole() -> None:
    """1 + k (3 r r' - 1), k = (a/r)^3 (mu - 1)/(mu + 2): symmetric and without trace, as the mechanism has it."""
    found = fit_shipped(field(magnet=True, iron=True), "magnetometer")
    r = np.array([9.0, 17.0, -4.0])
    k = (7.0 / np.linalg.norm(r)) ** 3 * 999 / 1002
    expected = k * (3 * np.outer(r, r) / (r @ r) - np.eye(3))
    soft = {e.name: e.value for e in found.model.estimates("soft-iron")}
    assert soft == pytest.approx(
        {"xx": expected[0, 0], "yy": expected[1, 1], "xy": expected[0, 1], "xz": expected[0, 2], "yz": expected[1, 2]},
        abs=2e-4,
    )
    made = calibration_matrices(found)
    assert made is not None
    assert pytest.approx(np.linalg.inv(np.eye(3) + expected), abs=3e-4) == made.M


@pytest.mark.parametrize("seed", range(2))
def test_where_iron_cannot_be_asked_nothing_else_is_blamed(seed: int) -> None:
    """Three turns in a field that dips by 67 deg: soft iron cannot be told, and is nobody else's doing."""
    found = discover(field(seed, over=False, magnet=True, iron=True), read_model("field"))
    assert found.verdict != "adequate"
    assert set(found.causes) <= {"hard-iron"}
