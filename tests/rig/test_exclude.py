"""A pose that is left out: it stays, with a reason and a date; results and tables are those of the others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.lease import lease
from rig.record import Record
from rig.record.measured import table_of
from rig.runs.runner import resume, start
from rig.services.exclusion import RESULTS, exclude
from tests.rig.conftest import Rig
from tests.rig.rigging import POSES, Onlooker, sigterm_at, small_sweep

pytestmark = pytest.mark.sockets

NOISE = ("run", "noise-floor", "--duration-s", "3", "--block-s", "1", "--dwell-s", "0.2", "--unattended", "--json")


@pytest.fixture
def run(rig: Rig) -> str:
    """A small noise floor: poses 0 to 3 at +-1 g, 4 to 6 the still record."""
    return str(rig(*NOISE).document["run"])


def results(run: str) -> dict[str, Any]:
    with Record() as record:
        return dict(record.run(run).results)


def events(run: str) -> list[tuple[str, str]]:
    with Record() as record:
        return [(event.what, event.text) for event in record.events(run)]


def test_results_are_computed_from_the_other_poses_and_restored(rig: Rig, run: str) -> None:
    before = results(run)
    ended = rig("exclude", run, "5", "--reason", "a lorry passed", "--json")
    document = ended.document
    assert ended.status == 0
    assert {k: document[k] for k in ("schema", "run", "pose", "excluded")} == {
        "schema": "rig.exclude/1",
        "run": run,
        "pose": 5,
        "excluded": "a lorry passed",
    }
    assert document["results"] == results(run) != before
    assert ("pose 5 excluded", "a lorry passed") in events(run)
    assert (RESULTS, "evaluated again") in events(run)
    assert rig("exclude", run, "5", "--include", "--json").document["excluded"] is None
    assert results(run) == before


def test_an_exclusion_is_confirmed_in_words(rig: Rig, run: str) -> None:
    text = rig("exclude", run, "5", "--reason", "a lorry passed").out
    assert f"{run}: pose 5 excluded: a lorry passed\nresults: evaluated again" in text
    assert "noise-rms-x" in text
    shown = rig("show", run, "--poses").out
    assert "Left out: pose 5 (a lorry passed)" in shown
    assert shown.rstrip().splitlines()[-2].endswith("a lorry passed")
    assert rig("exclude", run, "5", "--include").out.startswith(f"{run}: pose 5 included again")


def test_results_that_the_other_poses_determine_are_given_and_the_others_are_named(rig: Rig, run: str) -> None:
    before = results(run)
    said = rig("exclude", run, "0", "--reason", "x").out
    assert "results: no inclination-x: there is no pose at alpha 90, beta 0 deg" in said
    assert results(run) == {name: result for name, result in before.items() if name != "inclination-x"}
    assert "no inclination-x" in rig("show", run).out


def test_poses_that_do_not_determine_the_results_leave_none(rig: Rig, run: str) -> None:
    for number in ("4", "5", "6"):
        said = rig("exclude", run, number, "--reason", "x").out
    assert "results: none: run " in said
    assert results(run) == {}
    assert rig("show", run).status == 0


def test_a_run_without_poses_can_be_shown(rig: Rig) -> None:
    with Record() as record:
        run = start(record, *_small()).run.run
        for number in range(POSES):
            exclude(record, run, [number], "all wrong")
    assert rig("show", run, "--json").document["columns"] == {}
    assert len(rig("show", run, "--poses", "--json").document["kept"]) == POSES


def _small() -> tuple[Any, ...]:
    from rig.bench import read_bench

    return read_bench(), *small_sweep(), Onlooker()


def test_a_stopped_run_measures_the_pose_again(rig: Rig) -> None:
    with Record() as record:
        with sigterm_at(5):
            start(record, *_small())
        (stopped,) = record.runs()
        number = stopped.rows - 1
        text = rig("exclude", stopped.run, str(number), "--reason", "touched").out
        assert "Next: rig resume" in text
        pose = list(record.kept(stopped.run))[number].pose
        done = resume(record, stopped.run, Onlooker())
        again = [kept for kept in record.kept(stopped.run) if kept.pose == pose]
        assert [kept.excluded for kept in again][:2] == ["touched", None]
        assert table_of(record, stopped.run).n == done.run.rows - 1


def test_results_that_the_procedure_returned_stay(tmp_path: Path) -> None:
    from procedures.catalogue import find
    from rig.bench import read_bench

    (tmp_path / "weigh.py").write_text(
        '"""weigh: a result."""\nfrom procedures.session import Pose\n\n'
        "def weigh(rig):\n    rig.hold(Pose(0, 0), 0.1, 0)\n"
        '    return {"mass": {"value": 2.0, "unit": "g"}}\n'
    )
    with Record() as record:
        run = start(record, read_bench(), find("weigh", tmp_path), {}, Onlooker()).run.run
        assert exclude(record, run, [0], "why not").results["mass"]["value"] == 2.0
    assert events(run)[-1][0] == RESULTS


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("99", "--reason", "x"), "has no pose 99; `rig show .* --poses` lists"),
        (("1",), "give a reason"),
        (("1", "--reason", " "), "give a reason"),
        (("1", "--reason", "x", "--include"), "give a reason"),
        (("one", "--reason", "x"), "'one' is not a valid integer"),
    ],
)
def test_impossible_exclusions_are_refused(rig: Rig, run: str, words: tuple[str, ...], why: str) -> None:
    import re

    before = events(run)
    ended = rig("exclude", run, *words)
    assert (ended.status, ended.out) == (2, "")
    assert re.search(why, ended.err)
    assert events(run) == before


@pytest.fixture
def imported(rig: Rig, tmp_path: Path) -> str:
    """An imported table of four poses, the third with a wrong output."""
    file = tmp_path / "four.csv"
    file.write_text("alpha_deg,beta_deg,vx_v,path\n90,0,3.5,a\n90,90,2.5,b\n90,180,9.9,c\n90,270,2.5,d\n")
    return str(rig("import", str(file), "--json").document["run"])


def test_a_row_of_an_imported_table_is_excluded_and_included_again(rig: Rig, imported: str) -> None:
    with Record() as record:
        whole = table_of(record, imported)
        assert exclude(record, imported, [2], "bumped").results == {}
        assert record.excluded(imported) == {2: "bumped"}
        rest = table_of(record, imported)
        assert (list(rest.column("vx_v")), rest.labels["path"]) == ([3.5, 2.5, 2.5], ("a", "b", "d"))
        assert list(rest.numbered(np.arange(3))) == [0, 1, 3]
    shown = rig("show", imported, "--poses", "--json").document
    assert shown["columns"]["vx_v"]["max"] == 3.5
    assert [row["excluded"] for row in shown["kept"]] == [None, None, "bumped", None]
    assert "2     c     90         180       9.9   bumped" in rig("show", imported, "--poses").out
    assert rig("exclude", imported, "2", "--include").status == 0
    with Record() as record:
        assert record.excluded(imported) == {}
        assert table_of(record, imported).digest == whole.digest


@pytest.mark.parametrize(("row", "status"), [("3", 0), ("4", 2)])
def test_only_a_row_of_the_table_can_be_excluded(rig: Rig, imported: str, row: str, status: int) -> None:
    assert rig("exclude", imported, row, "--reason", "x").status == status


def test_an_imported_table_without_any_row_names_the_command_to_include_one(rig: Rig, imported: str) -> None:
    with Record() as record:
        exclude(record, imported, range(4), "all wrong")
    ended = rig("fit", imported, "--model", "linear")
    assert ended.status == 2
    assert f"all 4 rows are excluded; include one again, as with `rig exclude {imported} 0 --include`" in ended.err
    assert rig("show", imported).status == 0


def test_a_single_sample_of_an_imported_record_cannot_be_left_out(rig: Rig, tmp_path: Path) -> None:
    file = tmp_path / "still.csv"
    file.write_text("t_s,vx_v\n" + "".join(f"{k / 10},{2.5 + k % 3 / 1000}\n" for k in range(40)))
    run = rig("import", str(file), "--kind", "still", "--json").document["run"]
    ended = rig("exclude", run, "3", "--reason", "x")
    assert ended.status == 2
    assert "is an imported table of still: its rows are samples" in ended.err


def test_poses_of_a_run_in_progress_are_not_excluded(rig: Rig, run: str) -> None:
    with Record() as record, lease(record.folder, run, "it"):
        ended = rig("exclude", run, "1", "--reason", "x")
    assert ended.status == 2
    assert f"uses run {run}; wait until it ends" in ended.err
