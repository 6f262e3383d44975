"""A plan in a few lines, and every move of it where it is wanted."""

from __future__ import annotations

import pytest

from procedures.catalogue import find
from procedures.session import Pose
from procedures.settings import parse
from rig.bench import read_bench
from rig.planning.plan import Plan, plan, stretches, turn_words
from rig.planning.planned import PlannedDwell, Step
from tests.rig.conftest import Rig
from tests.rig.rigging import ON_STAGES


def planned(name: str, **settings: str) -> Plan:
    procedure = find(name)
    return plan(read_bench(), procedure, parse(procedure, settings))


def test_a_sweep_is_one_line_for_each_direction() -> None:
    found = stretches(planned("sweep"))
    assert len(found) == 14
    assert found[0].words == "alpha 90, beta 0 to 360 deg: 37 poses"
    assert found[1].words == "alpha 90, beta 360 to 0 deg: 37 poses"
    assert [stretch.start_s for stretch in found] == sorted(stretch.start_s for stretch in found)


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        (Pose(30, 360, -1, "B+ to A-"), "alpha 30 deg, beta falling"),
        (Pose(90, 0, 1, "sweep A+ to B-"), "sweep alpha 90 deg, beta rising"),
        (Pose(90, 45, 1, "reference"), "reference"),
    ],
)
def test_a_path_is_named_by_its_angles(pose: Pose, expected: str) -> None:
    assert turn_words(pose) == expected


@pytest.mark.parametrize("name", ON_STAGES)
def test_every_pose_of_every_procedure_is_in_one_stretch(name: str) -> None:
    whole = planned(name)
    assert [pose for stretch in stretches(whole) for pose in stretch.poses] == [held.pose for held in whole.held]
    assert all(0 <= held.start_s <= whole.duration_s for held in whole.held)
    assert whole.duration_s > 0
    assert {"alpha", "beta"} <= set(whole.reach)


def test_a_stretch_lists_each_other_action_once_and_adds_up_long_waits() -> None:
    found = stretches(planned("temperature-cycle", temperatures_c="35,50"))
    assert found[0].also == ("oven to 35 C", "oven on", "waiting for 3600 s")
    assert found[0].words.endswith("8 poses  up 35 cycle 1")


@pytest.mark.parametrize(("oven_c", "first"), [("0", ()), ("45", ("oven to 45 C", "oven on"))])
def test_a_repeated_command_without_effect_is_no_step(oven_c: str, first: tuple[str, ...]) -> None:
    cold, *others = stretches(planned("soak", duration_s="3600", block_s="60", oven_c=oven_c))
    switched = ("adc switches the sensor off", "adc switches the sensor on")
    assert cold.also == (*switched, *first, "waiting for 3600 s")
    assert not any(stretch.also for stretch in others)


@pytest.mark.parametrize(
    ("poses", "on_stages"),
    [
        ([Pose(0, 0, 0, f"still {k}") for k in range(6)], True),
        ([Pose(0, 0, mount_deg=90.0, flip=1)], True),
        ([Pose(0, 0, path="+x side up")], False),
        ([Pose(90, beta) for beta in (0, 90, 180, 90, 0)], True),
    ],
    ids=["counted", "mounted otherwise", "by hand", "there and back"],
)
def test_a_stretch_is_described_in_one_line(golden, poses: list[Pose], on_stages: bool) -> None:
    reach = {"alpha": ((0.0, 90.0), (-180.0, 180.0))} if on_stages else {}
    held = tuple(PlannedDwell(float(k), pose) for k, pose in enumerate(poses))
    (only,) = stretches(Plan("any", {}, (Step(0.0, 1.0, "wait 1 s"),), reach, (), held, 10.0, 0))
    golden.same(only.words)


def test_a_long_plan_is_summed_up_and_a_short_one_printed(rig: Rig) -> None:
    summed, whole = rig("plan", "sweep").out, rig("plan", "sweep", "--moves").out
    assert "  24:21  alpha 60, beta 0 to 360 deg: 37 poses\n" in summed
    assert len(summed.splitlines()) < 25
    assert "--moves" in summed
    document = rig("plan", "sweep", "--json").document
    assert all(f"  {step['what']}\n" in whole for step in document["steps"])
    assert [stretch["poses"] for stretch in document["stretches"]] == [37] * 14
    assert "beta from 0 to 180 deg\n" in rig("plan", "level-check").out


def test_a_long_plan_omits_its_middle_stretches(rig: Rig) -> None:
    shown = rig("plan", "soak").out
    assert "similar lines" in shown
    assert len(shown.splitlines()) < 30
