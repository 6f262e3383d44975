"""What is told of a sensor while its poses come: as soon as they tell it, no sooner, and truly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from drivers.recorder import Samples
from procedures.magnetometer_turn import full_turn
from procedures.rate_turn import turns
from procedures.session import Pose
from rig.record import KeptPose, Record
from rig.record.measured import sensor_from_base, sensor_from_table, specific_force_g
from rig.runs.estimates import RunningEstimates

NOISE_V = 1e-4


def kept(poses: Iterator[Pose], outputs: Mapping[str, Any], seed: int = 1) -> list[KeptPose]:
    """Each pose with one sample of each channel: `outputs` by name, of a pose."""
    random, found = np.random.default_rng(seed), []
    for k, pose in enumerate(poses):
        volts = np.array([[of(pose) + NOISE_V * random.standard_normal() for of in outputs.values()]])
        found.append(KeptPose(pose, Samples(volts, tuple(outputs), 1.0, float(k)), float(k), None, number=k))
    return found


@pytest.fixture
def follower(rig_home: Any) -> Any:
    """Of a run of a kind that holds `before`."""

    def begun(kind: str, before: list[KeptPose] | None = None) -> RunningEstimates:
        with Record() as record:
            run = record.begin(
                "made", {}, bench={}, identities={}, configuration="", constants={}, source="made", kind=kind
            )
            for each in before or []:
                record.keep(run, each.number, each, None)
        told = RunningEstimates()
        told.begun(run)
        return told

    return begun


def last(told: RunningEstimates, poses: list[KeptPose]) -> dict[str, str]:
    return {value.name: value.shown for value in [told.values(each) for each in poses][-1]}


def number(words: str) -> tuple[float, float]:
    value, _, std = words.replace("−", "-").partition("(")
    decimals = len(value.partition(".")[2])
    return float(value), float(std.partition(")")[0]) / 10**decimals


def swept(alphas: tuple[float, ...]) -> Iterator[Pose]:
    yield from (Pose(a, b, 0, f"at {a:g}") for a in alphas for b in range(0, 360, 30))


def askew(pose: Pose) -> float:
    f = specific_force_g(pose)
    return float(2.5 + f @ [0.99, 0.01, -0.02])


def test_bias_and_scale_factor_come_with_the_poses(follower: Any) -> None:
    told = last(follower("poses"), kept(swept((90.0, 60.0)), {"vx": askew}))
    for name, true in (("bias-x", 2.5), ("scale-x", 0.99)):
        value, std = number(told[name])
        assert 0 < std < NOISE_V
        assert abs(value - true) < 4 * std


def test_an_estimate_states_its_number_of_poses(follower: Any) -> None:
    """It stays true when the run has ended and its page still shows it."""
    told = follower("poses")
    *_, values = (told.values(each) for each in kept(swept((90.0, 60.0)), {"vx": askew}))
    assert {value.remark for value in values} == {"from 24 poses"}


def test_one_inclination_does_not_separate_the_bias_from_the_load_along_z(follower: Any) -> None:
    assert set(last(follower("poses"), kept(swept((60.0,)), {"vx": askew}))) == {"scale-x"}
    assert last(follower("poses"), kept(swept((90.0,)), {"vx": askew}))["bias-x"].startswith("2.50")


def test_a_gyroscope_sensitive_to_gravity_has_a_bias_after_it_was_turned_over(follower: Any) -> None:
    def gz(pose: Pose) -> float:
        return float(
            2.5 + 6e-3 * -pose.rate_deg_s * sensor_from_table(pose)[2, 2] + specific_force_g(pose) @ [0, 0, 0.02]
        )

    follows, poses = follower("rates"), kept(turns("z", [40.0, 80.0], 360.0), {"gz": gz})
    up = [each for each in poses if each.pose.alpha_deg == 0]
    assert set(last(follows, up)) == {"gyro-scale-z"}
    told = last(follows, poses[len(up) :])
    assert number(told["gyro-bias-z"])[0] == pytest.approx(2.5, abs=3e-4)
    assert number(told["gyro-scale-z"])[0] == pytest.approx(6e-3, abs=3e-6)


def field(axis: int) -> Any:
    earth = np.array([0.4, -0.2, -0.9])
    return lambda pose: float((sensor_from_base(pose) @ earth)[axis] + [0.1, -0.2, 0.3][axis])


def test_the_hard_iron_of_an_axis_is_shown_after_the_turn_in_which_it_is_level(follower: Any) -> None:
    follows = follower("positions")
    first = kept(full_turn("z", "up", 30.0), {f"m{axis}": field(k) for k, axis in enumerate("xyz")})
    assert set(last(follows, first)) == {"hard-iron-x", "hard-iron-y"}
    second = kept(full_turn("x", "up", 30.0), {f"m{axis}": field(k) for k, axis in enumerate("xyz")})
    told = last(follows, second)
    for axis, true in zip("xyz", (0.1, -0.2, 0.3), strict=True):
        value, std = number(told[f"hard-iron-{axis}"])
        assert abs(value - true) < 4 * std
        assert std < 2 * NOISE_V


def test_a_resumed_run_uses_the_earlier_poses_and_reports_each_complete_path(follower: Any) -> None:
    poses = kept(swept((90.0, 60.0)), {"a1.vx": askew, "a2.vx": askew})
    whole, resumed = follower("poses"), follower("poses", poses[:14])
    said = [whole.report(each) for each in poses]
    assert [line for line in said if line] == [said[12]]
    assert said[12].startswith("after at 90\n  a1 bias-x ")
    assert "a2 scale-x" in said[12]
    assert last(resumed, poses[14:]) == last(follower("poses"), poses)


def test_a_run_of_samples_is_not_followed(follower: Any) -> None:
    assert follower("still").report(kept(swept((90.0,)), {"vx": askew})[0]) == ""
