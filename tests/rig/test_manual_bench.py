"""A bench whose stages are turned by hand: a whole sweep by the simulated technician, by a script, and by nobody."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from procedures.catalogue import find
from procedures.errors import NoAnswer
from procedures.questions import Question
from procedures.settings import parse
from rig.bench import DEFAULT, Bench, read_bench
from rig.errors import BenchError
from rig.planning.plan import plan
from rig.record import Record
from rig.record.measured import table_of
from rig.runs.runner import resume, start
from tests.rig.conftest import Rig
from tests.rig.rigging import Onlooker

MARK_DEG = 5 / 60
SMALL = ("--inclinations-deg", "90", "--step-deg", "90", "--dwell-s", "0.2")


def manual(url: str = "simulated", **changes: Any) -> dict[str, Any]:
    """The document of Ang's rig: stages turned by hand, a hand level, and no oven."""
    document: dict[str, Any] = yaml.safe_load(DEFAULT.read_text())
    instruments = {"adc": document["instruments"]["adc"]}
    instruments |= {role: {"driver": "manual_stage", "url": url} for role in ("alpha", "beta")}
    return document | {"instruments": instruments} | changes


@pytest.fixture
def file(tmp_path: Path) -> Callable[..., str]:
    """Write a document as a file."""

    def write(document: dict[str, Any], name: str = "bench.yaml") -> str:
        (tmp_path / name).write_text(yaml.safe_dump(document))
        return str(tmp_path / name)

    return write


@pytest.mark.sockets
def test_the_simulated_technician_makes_the_whole_sweep(rig: Rig, file: Callable[..., str]) -> None:
    ended = rig("run", "sweep", *SMALL, "--bench", file(manual()), "--unattended", "--json")
    assert ended.status == 0
    with Record() as record:
        run = ended.document["run"]
        table, events = table_of(record, run), [event.what for event in record.events(run)]
        levels = {reading.name: reading.value for reading in record.readings(run)}
    off = table.column("beta_deg") - table.column("beta_set_deg")
    assert table.n == 10
    assert np.abs(off).max() < MARK_DEG + 1e-3
    np.testing.assert_allclose(off / MARK_DEG, np.round(off / MARK_DEG), atol=0.002)  # whole marks
    assert table.constants["alpha_std_deg"] == pytest.approx(MARK_DEG / np.sqrt(12))
    assert [what for what in events if "beta" in what][:4] == [
        "answer beta-0",
        "answer beta-180",  # the level, half a turn on
        "answer beta--5",  # the first pose is approached from below
        "answer beta-0",
    ]
    assert set(levels) == {f"level-{side}-{axis}" for side in ("front", "back") for axis in "xy"}


@pytest.mark.sockets
def test_the_dial_reading_of_a_script_is_the_angle(rig: Rig, file: Callable[..., str]) -> None:
    answers = file({"mounting": True, "alpha-90": "yes", "beta-90": "90.083", "beta-180": 180}, "answers.yaml")
    ended = rig("run", "sweep", *SMALL, "--bench", file(manual()), "--answers", answers, "--unattended", "--json")
    with Record() as record:
        table = table_of(record, ended.document["run"])
    read = table.column("beta_deg")[table.column("beta_set_deg") == 90]
    np.testing.assert_array_equal(read, [90.083, 90.083])
    np.testing.assert_array_equal(table.column("alpha_deg"), 90.0)


@pytest.mark.sockets
def test_an_implausible_reading_ends_the_run(rig: Rig, file: Callable[..., str]) -> None:
    answers = file({"beta-90": 9}, "answers.yaml")
    ended = rig("run", "sweep", *SMALL, "--bench", file(manual()), "--answers", answers, "--unattended")
    assert ended.status == 2
    assert "beta-90: '9' does not answer 'Turn beta to 90 deg. What does its dial show?'" in ended.err
    assert "yes for 90 deg, or a number from 89.5 to 90.5 deg" in ended.err


@pytest.mark.sockets
def test_a_run_without_a_person_at_a_manual_stage_stops_and_is_resumed_later(
    rig: Rig, file: Callable[..., str]
) -> None:
    document = manual(url="person")
    document["limits"]["level_deg"] = None
    bench = file(document)
    settings = ("--inclinations-deg", "90", "--step-deg", "180", "--dwell-s", "0.01", "--settle-s", "0")
    answers = file({"mounting": "yes"}, "few.yaml")
    ended = rig("run", "sweep", *settings, "--bench", bench, "--answers", answers, "--unattended", "--json")
    document = ended.document
    assert (ended.status, document["state"], document["poses"]) == (4, "stopped", 0)
    assert (
        'the question "Turn alpha to 90 deg. What does its dial show?" has no answer; write `alpha-90: ...`'
        in ended.err
    )
    asked = {f"beta-{deg}": "yes" for deg in (-5, 0, 180, 360, 365)} | {"alpha-90": "90.083", "beta-dial": 0}
    ended = rig("resume", document["run"], "--answers", file(asked, "all.yaml"), "--unattended", "--json")
    assert (ended.status, ended.document["poses"]) == (0, 6)
    with Record() as record:
        np.testing.assert_array_equal(table_of(record, document["run"]).column("alpha_deg"), 90.083)


@dataclass
class Called(Onlooker):
    """A technician who is called away at their twelfth question."""

    def ask(self, question: Question, instead: str | None) -> str:
        if len([each for each in self.said if "?" in each]) == 12:
            raise NoAnswer("called away")
        return super().ask(question, instead)


@pytest.mark.sockets
def test_a_resumed_run_equals_an_undisturbed_one_sample_for_sample() -> None:
    sweep, bench = find("sweep"), Bench.model_validate(manual())
    settings = parse(sweep, {"inclinations_deg": "90", "step_deg": "90", "dwell_s": "0.2"})
    with Record() as record:
        whole = start(record, bench, sweep, settings, Onlooker()).run
        stopped = start(record, bench, sweep, settings, Called()).run
        assert stopped.state == "stopped"
        assert 0 < stopped.rows < whole.rows
        assert resume(record, stopped.run, Onlooker()).run.state == "complete"
        for a, b in zip(record.kept(whole.run), record.kept(stopped.run), strict=True):
            assert (a.pose, a.alpha_read_deg, a.beta_read_deg) == (b.pose, b.alpha_read_deg, b.beta_read_deg)
            np.testing.assert_array_equal(a.samples.volts, b.samples.volts)


@pytest.mark.sockets
def test_its_plan_takes_as_long_as_the_technician() -> None:
    sweep, bench = find("sweep"), Bench.model_validate(manual())
    settings = parse(sweep, {"inclinations_deg": "90", "step_deg": "90", "dwell_s": "0.2"})
    planned = plan(bench, sweep, settings)
    with Record() as record:
        run = start(record, bench, sweep, settings, Onlooker()).run
        state: Any = record.state(run.run)
    assert state["rig"]["clock_s"] == pytest.approx(planned.duration_s, rel=0.02)
    assert planned.duration_s > 14 * 20  # most of it in the technician's hands
    search = find("misalignment")
    rehearsed = plan(bench, search, parse(search, {"dwell_s": "0.2", "most_rounds": "1"}))
    assert (rehearsed.poses, len(rehearsed.questions)) == (22, 5)  # mounting, and two axes of the level twice


def test_a_stage_turned_by_a_person_has_no_faults(golden, file: Callable[..., str]) -> None:
    document = manual()
    document["instruments"]["beta"]["faults"] = [{"what": "silence"}]
    with golden.refused(BenchError):
        read_bench(Path(file(document)))


def test_only_instruments_with_an_interface_are_served(rig: Rig, file: Callable[..., str]) -> None:
    document = manual()
    del document["instruments"]["adc"]
    ended = rig("simulate", "--bench", file(document))
    assert ended.status == 2
    assert "alpha, beta: moved by hand, so it is not served" in ended.err
