"""The Book's way with full turns, and the elements of the field, on turns that are written out here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibrations.analyses.magnetometer_turn import field_elements, iron_by_extremes, level_elements_by_extremes
from calibrations.design.experiment import experiment_by_physics
from calibrations.table import Array

OVER = np.diag([-1.0, 1.0, -1.0])
FACES = {"z up": np.eye(3), "x up": np.eye(3)[[2, 0, 1]], "y up": np.eye(3)[[1, 2, 0]]}
EARTH = np.array([18.0, -10.0, -43.0])  # uT along base, left of it, upward: D = atan2(10, 18), I = atan2(43, H)


def turns(names: tuple[str, ...], step_deg: float = 10.0) -> tuple[Array, list[str], list[str]]:
    """(sensor from base (n, 3, 3), edge and name of the turn of each row)."""
    beta = np.arange(0.0, 360.0, step_deg)
    round_z = Rotation.from_euler("z", beta[:, None], degrees=True).as_matrix()
    sides = [(FACES[f"{name[0]} up"], OVER if name.endswith("down") else np.eye(3)) for name in names]
    attitudes = np.concatenate([edge @ round_z @ side for edge, side in sides])
    return attitudes, [name[0] for name in names for _ in beta], [name for name in names for _ in beta]


def test_the_elements_are_those_of_the_field() -> None:
    attitudes, _, names = turns(tuple(FACES))
    found = field_elements(attitudes @ EARTH, attitudes, names)
    assert found.value["F"] == pytest.approx(np.linalg.norm(EARTH))
    assert found.value["H"] == pytest.approx(np.hypot(18.0, 10.0))
    assert found.value["D"] == pytest.approx(np.degrees(np.arctan2(10.0, 18.0)))
    assert found.value["I"] == pytest.approx(np.degrees(np.arctan2(43.0, np.hypot(18.0, 10.0))))
    assert all(std == pytest.approx(0.0, abs=1e-6) for std in found.std.values())


def test_their_uncertainty_is_how_the_turns_disagree() -> None:
    """Each of six turns sits in its mount by its own tilt of some 0.1 deg: errors are as large as is said."""
    rng, off = np.random.default_rng(1), []
    names = tuple(FACES)
    attitudes, _, labels = turns(names)
    for _ in range(60):
        tilts = {name: Rotation.from_rotvec(rng.normal(0, 0.1, 3), degrees=True).as_matrix() for name in names}
        tilted = np.array([tilts[label] @ a for label, a in zip(labels, attitudes, strict=True)])
        found = field_elements(tilted @ EARTH, attitudes, labels)
        off.append((found.value["I"] - np.degrees(np.arctan2(43.0, np.hypot(18.0, 10.0)))) / (found.std["I"] or 1.0))
    assert 0.6 < np.median(np.abs(off)) / 0.82 < 1.6  # of t with two degrees of freedom


def test_one_turn_says_nothing_of_how_turns_agree() -> None:
    attitudes, _, names = turns(("z up",))
    found = field_elements(attitudes @ EARTH, attitudes, names)
    assert set(found.std.values()) == {None}


def test_hard_iron_by_hand_is_the_middle_of_each_turn_and_soft_iron_that_of_the_turn_about_z() -> None:
    """Turned over as well: soft iron lets the component that stands still into the others, with the other sign."""
    attitudes, edges, names = turns((*FACES, *(f"{edge} down" for edge in "zxy")), step_deg=1.0)
    iron = np.array([7.0, -3.0, 11.0])
    long = Rotation.from_euler("z", 30.0, degrees=True).as_matrix()
    bent = long @ np.diag([1.2, 1.0, 1.0]) @ long.T  # longer by a fifth along 30 deg from x
    found = iron_by_extremes((attitudes @ EARTH) @ bent.T + iron, edges, names, std=0.02)
    assert found.hard_iron == pytest.approx(iron, abs=0.02)
    assert found.hard_iron_std == pytest.approx([0.01 / np.sqrt(2)] * 3)  # four turns each; half of a sum of two
    assert found.soft_iron.least / found.soft_iron.greatest == pytest.approx(1 / 1.2, rel=1e-3)
    assert np.degrees(found.soft_iron.angle_rad) % 180 == pytest.approx(30.0, abs=1.0)


def test_uncertainties_by_hand_hold_what_one_side_cannot_show() -> None:
    """Iron of any direction: one turn takes what it makes of the upright field for hard iron, and says how much."""
    off: dict[str, list[float]] = {"one": [], "both": [], "H": [], "angle": []}
    for seed in range(80):
        rng = np.random.default_rng(seed)
        soft = rng.normal(0, 0.03, (3, 3))
        bent = np.eye(3) + soft + soft.T - np.eye(3) * np.trace(soft + soft.T) / 3
        for kind, sides in (("one", ("z up",)), ("both", ("z up", "z down"))):
            attitudes, edges, names = turns(sides, step_deg=15.0)
            outputs = (attitudes @ EARTH) @ bent.T + [7.0, -3.0, 11.0] + 0.005 * rng.standard_normal((len(edges), 3))
            found = iron_by_extremes(outputs, edges, names, std=0.005)
            off[kind] += ((found.hard_iron - [7.0, -3.0, 11.0]) / found.hard_iron_std)[:2].tolist()
        level = level_elements_by_extremes(outputs[:24], attitudes[:24], 0.0)
        off["H"].append((level.value["H"] - np.hypot(18.0, 10.0)) / (level.std["H"] or 1.0))
        _, ways = np.linalg.eigh((bent.T @ bent)[:2, :2])
        turned = np.degrees(found.soft_iron.angle_rad - np.arctan2(*ways[::-1, 1]))
        off["angle"].append(((turned + 90) % 180 - 90) / found.soft_iron.angle_std_deg(0.005))
    share = {kind: np.mean(np.abs(each) < 2) for kind, each in off.items()}
    assert 0.9 < share["one"] < 0.99
    assert share["both"] > 0.9
    assert 0.9 < share["H"] <= 1.0
    assert share["angle"] > 0.9


def test_by_one_horizontal_turn_the_third_component_is_not_known() -> None:
    attitudes, edges, names = turns(("z up",))
    found = iron_by_extremes(attitudes @ EARTH + [7.0, -3.0, 11.0], edges, names, std=0.0)
    assert found.hard_iron[:2] == pytest.approx([7.0, -3.0], abs=0.2)
    assert np.isnan(found.hard_iron[2])
    level = level_elements_by_extremes(attitudes @ EARTH + [7.0, -3.0, 11.0], attitudes, 0.1)
    assert level.value["H"] == pytest.approx(np.hypot(18.0, 10.0), rel=0.02)
    assert level.value["D"] == pytest.approx(np.degrees(np.arctan2(10.0, 18.0)), abs=1.0)
    assert 0.1 <= (level.std["D"] or 0.0) < 0.3
    assert level_elements_by_extremes(attitudes @ EARTH, attitudes, None).std["D"] is None  # how it sits in its mount
    assert found.left_per_mille < 5.0


@pytest.mark.parametrize(
    ("names", "procedure"),
    [
        ({"hard-iron", "bias-drift"}, "magnetometer-turn"),
        ({"gyro-g-sensitivity", "gyro-bias"}, "rate-turn"),
        ({"bias-drift", "warm-up-bias"}, "soak"),
    ],
)
def test_what_cannot_be_told_apart_is_turned_otherwise(names: set[str], procedure: str) -> None:
    assert experiment_by_physics(names)[0] == procedure
