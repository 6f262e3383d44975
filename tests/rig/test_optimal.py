"""Poses chosen for a model: better than the sweep by plan and in truth, and a run like any other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.model.file import read_model
from calibrations.text import duration
from procedures.catalogue import find
from procedures.pose_list import format_poses
from procedures.session import Pose
from procedures.settings import parse
from rig.bench import read_bench
from rig.cli.commands.plan import optimal_document, optimal_lines
from rig.errors import PlanError
from rig.planning.optimal import AGAIN, CHECK, DESIGN, Optimal, most_relative, optimal, relative
from rig.planning.planned import EXCHANGE_S, from_home_s, moves_s
from rig.record import KeptPose, Record
from rig.runs.runner import resume, start
from rig.services.optimal_words import _times
from tests.rig.conftest import Rig
from tests.rig.rigging import Onlooker
from tests.slow import first_fast

COARSE = {"step_deg": "30", "inclinations_deg": "90,45,135"}  # a small sweep, to be quick


def settings(**given: str) -> Mapping[str, Any]:
    return parse(find("sweep"), given)


@cache
def chosen(model: str = "linear", criterion: str = "I", poses: int = 40, **given: str) -> Optimal:
    return optimal(read_bench(), find("sweep"), settings(**(given or COARSE)), read_model(model), poses, criterion)


def angles(pose: Pose) -> tuple[float, float]:
    return pose.alpha_deg, pose.beta_deg


@pytest.mark.parametrize("paths", first_fast(["grid", "ang"]))
def test_it_takes_1_8_times_less_rig_time_than_the_standard_sweep(paths: str) -> None:
    found = chosen(poses=60, paths=paths)
    assert found.times_less > 1.8
    assert found.equal.plan.poses == 60
    assert 0.98 < relative(found.standard, found.equal) <= 1
    assert 0.98 < most_relative(found.standard, found.all_equal) <= 1
    assert found.drift_loss < 0.05
    assert abs(found.height_correlation) < 0.3


@pytest.mark.parametrize("criterion", ["D", "I"])
def test_poses_are_those_of_the_range(criterion: str) -> None:
    poses = chosen(criterion=criterion).equal.poses
    paths = Counter(pose.path for pose in poses)
    assert (paths[DESIGN], paths[AGAIN], paths[CHECK]) == (32, 4, 4)
    assert all(45 <= pose.alpha_deg <= 135 and 0 <= pose.beta_deg < 360 for pose in poses)
    design = Counter(angles(pose) for pose in poses if pose.path != CHECK)
    assert all(design[angles(pose)] >= 2 for pose in poses if pose.path == AGAIN)
    assert not {angles(pose) for pose in poses if pose.path == CHECK} & set(design)


def test_the_same_question_has_the_same_answer() -> None:
    assert chosen().equal.poses == chosen.__wrapped__().equal.poses


def test_the_chosen_poses_determine_the_parameters_that_the_sweep_determines() -> None:
    found = chosen("physical")
    assert found.standard.determined.all()
    assert np.all(np.isfinite(found.equal.errors))


def test_the_information_of_check_poses_is_not_counted() -> None:
    found = chosen()
    fitted = format_poses(pose for pose in found.equal.poses if pose.path != CHECK)
    judged = found.over.judged({**found.equal.plan.settings, "pose_list": fitted})
    assert judged.errors == pytest.approx(found.equal.errors)


def test_repeated_poses_do_not_follow_each_other() -> None:
    places = [(pose.alpha_deg, pose.beta_deg, pose.direction) for pose in chosen().equal.poses]
    assert sum(a == b for a, b in pairwise(places)) <= 2 < len(places) - len(set(places))


def test_the_sensor_is_turned_over_once() -> None:
    flips = [pose.flip for pose in chosen(face="both", **COARSE).equal.poses]
    assert flips == sorted(flips)
    assert 0 < sum(flips) < len(flips)


def test_the_travel_equals_that_of_a_plan() -> None:
    found = chosen().equal
    poses = found.poses
    between = moves_s(read_bench(), poses)
    travel = from_home_s(read_bench(), poses)[0] + np.trace(between, offset=1)
    counted = sum(step.duration_s for step in found.plan.steps if " from " in step.what)
    level = sum(step.duration_s for step in found.plan.steps if step.what.startswith("level"))
    assert level > 0  # the table is turned for it, before the first pose
    assert travel <= counted < travel + 20
    assert moves_s(read_bench(), [Pose(0, 0, 1)] * 2)[0, 1] == pytest.approx(2 * (2 * np.sqrt(5 / 60) + EXCHANGE_S))


@pytest.mark.parametrize(("poses", "told"), [(61, "give 14 to 60"), (13, "give 14 to 60 for the 4 parameters")])
def test_too_many_and_too_few_are_refused(poses: int, told: str) -> None:
    with pytest.raises(PlanError, match=told):
        chosen(poses=poses)


@pytest.mark.parametrize("inclination", ["0", "90"])
def test_a_sweep_without_information_is_no_standard(golden, inclination: str) -> None:
    with golden.refused(PlanError):
        chosen("physical", inclinations_deg=inclination)


def test_the_text_states_the_saved_time_and_the_command() -> None:
    text = "\n".join(optimal_lines(chosen("physical"), None))
    assert "physical, 16 parameters: I-optimal poses" in text
    assert "times less rig time for the same worst standard error" in text
    assert "any standard error, relative to the sweep, at most" in text
    for_all = chosen("physical").all_equal
    time = duration(for_all.plan.duration_s)
    sentence = f"{for_all.dwell_s:g} s at these poses, no parameter becomes less certain. The rig time is then {time}, "
    assert sentence in text
    assert f"rig run sweep --pose-list poses.csv --dwell-s {chosen('physical').equal.dwell_s:g}" in text


@pytest.mark.parametrize(
    ("times_less", "words"), [(1.8, "1.8 times less than"), (0.5, "2.0 times"), (1.03, "about"), (0.97, "about")]
)
def test_rig_times_are_compared_in_words(times_less: float, words: str) -> None:
    assert _times(times_less) == words


def test_the_printed_run_is_of_the_bench_that_was_planned_on() -> None:
    *_, last = optimal_lines(chosen("physical"), "my poses.csv", "worm.yaml")
    dwell = f"--dwell-s {chosen('physical').equal.dwell_s:g}"
    assert last == f"Run them:  rig run sweep --pose-list 'my poses.csv' {dwell} --bench worm.yaml"


def test_a_parameter_that_no_sweep_determines_has_no_ratio() -> None:
    oven = read_model("linear").with_effect(catalogue()["temperature-bias"])  # a sweep keeps its temperature
    found = optimal(read_bench(), find("sweep"), settings(**COARSE), oven, 40, "I")
    assert optimal_document(found)["same_dwell"]["errors"]["temperature-bias slope x"] is None


def test_the_command_writes_poses_that_a_run_takes(rig: Rig, tmp_path: Path) -> None:
    out = tmp_path / "poses.csv"
    small = ("--step-deg", "30", "--inclinations-deg", "90,45,135")
    ended = rig("plan", "sweep", *small, "--optimal", "--poses", "20", "--out", str(out), "--json")
    said = ended.document
    assert said["schema"] == "rig.plan/1"
    assert said["poses"] == len(said["optimal"]["poses"]) == 20
    assert said["optimal"]["same_worst_error"]["duration_s"] == said["duration_s"]
    planned = rig("plan", "sweep", "--pose-list", str(out), "--dwell-s", "0.2", "--json").document
    assert planned["settings"]["pose_list"] == out.read_text().splitlines()


def test_any_plan_s_poses_can_be_written(rig: Rig, tmp_path: Path) -> None:
    out = tmp_path / "poses.csv"
    rig("plan", "sweep", "--step-deg", "180", "--inclinations-deg", "90", "--out", str(out))
    assert out.read_text().splitlines()[1:3] == ["90,0,1,A+ to B-,0,0", "90,180,1,A+ to B-,0,0"]


def test_options_of_chosen_poses_need_optimal(rig: Rig) -> None:
    assert rig("plan", "sweep", "--poses", "20").status == 2
    assert rig("plan", "soak", "--optimal").status == 2


@pytest.mark.slow
@pytest.mark.sockets
def test_a_run_of_chosen_poses_checks_its_model(rig: Rig, tmp_path: Path, rig_home: Path) -> None:
    out = tmp_path / "poses.csv"
    rig(
        "plan",
        "sweep",
        "--step-deg",
        "30",
        "--inclinations-deg",
        "90,45,135",
        "--optimal",
        "--poses",
        "20",
        "--out",
        out,
    )
    run = rig("run", "sweep", "--pose-list", str(out), "--dwell-s", "0.5", "--unattended", "--json").document
    out.unlink()  # the record has what it needs
    fitted = rig("fit", run["run"], "--json").document
    assert fitted["unseen"]["poses"] == 4
    assert fitted["unseen"]["repeats"] >= 4
    assert "check poses" in rig("fit", run["run"]).out
    assert "pose_list = 21 lines: alpha_deg,beta_deg," in rig("show", run["run"]).out


class Leaving(Onlooker):
    """Stops the run when three poses are kept."""

    def kept(self, kept: KeptPose) -> None:
        super().kept(kept)
        if len(self.seen) == 3:
            raise KeyboardInterrupt


@pytest.mark.sockets
def test_an_interrupted_run_continues_with_the_same_poses() -> None:
    listing = {**chosen(poses=20).equal.plan.settings, "dwell_s": 0.1}
    with Record() as record:
        run = start(record, read_bench(), find("sweep"), listing, Leaving()).run
        assert (run.state, run.rows) == ("stopped", 3)
        assert resume(record, run.run, Onlooker(), read_bench()).run.state == "complete"
        assert tuple(record.poses(run.run)) == chosen(poses=20).equal.poses
