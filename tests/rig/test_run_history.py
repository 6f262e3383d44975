"""The history of a run: when and where it began, was stopped and went on, in the record, exports and reports."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rig.bench import read_bench
from rig.record import Event, LogLine, Record
from rig.record.history import _turns, history
from rig.record.measured import INTERRUPTIONS, table_of
from rig.runs.runner import resume, start
from rig.services.event_words import events_in_words, in_words
from tests.rig.rigging import Onlooker, sigterm_at, small_sweep


class InATerminal(Onlooker):
    """One who looks on in a terminal."""

    place = "in a terminal"


def lines(*kinds: tuple[str, str]) -> list[LogLine]:
    return [LogLine(f"2026-11-29T12:00:0{k}", 0.0, "run", what, text) for k, (what, text) in enumerate(kinds)]


def test_a_stopped_and_resumed_run_says_so_in_its_events_table_and_export(
    rig: Callable[..., Any], tmp_path: Path
) -> None:
    with Record() as record:
        with sigterm_at(4):
            run = start(record, read_bench(), *small_sweep(), InATerminal()).run
        resume(record, run.run, Onlooker())
        events = [(event.what, event.text) for event in history(record, run.run)]
        constants = table_of(record, run.run).constants
    stop = "by another program; all instruments are at rest"
    assert [event for event in events if not event[0].startswith("answer")] == [
        ("begun", "sweep at pose 0, in a terminal"),
        ("stopped", stop),
        ("resumed", f"sweep at pose {run.rows}"),
        ("complete", ""),
    ]
    told = str(constants[INTERRUPTIONS])
    assert [part.partition(" ")[2] for part in told.split("; 2")] == [
        f"stopped {stop}",
        f"resumed sweep at pose {run.rows}",
    ]
    rig("export", run.run, "--format", "event-model", "--out", tmp_path / "run.jsonl")
    end = json.loads((tmp_path / "run.jsonl").read_text().splitlines()[-1])["doc"]
    assert [event["what"] for event in end["history"] if not event["what"].startswith("answer")] == [
        "begun", "stopped", "resumed", "complete"
    ]  # fmt: skip
    rig("export", run.run, "--format", "csv", "--out", tmp_path / "run.csv")
    assert f"# {INTERRUPTIONS}: {told}" in (tmp_path / "run.csv").read_text().splitlines()


def test_a_page_has_the_question_of_an_answer_and_no_pose_zero() -> None:
    with Record() as record:
        with sigterm_at(4):
            run = start(record, read_bench(), *small_sweep(), InATerminal()).run
        resume(record, run.run, Onlooker())
        events = [(event.what, event.text) for event in events_in_words(record, run.run)]
    assert events[:2] == [
        ("begun", "sweep at the first pose, in a terminal"),
        ("answer", "Is the sensor mounted face up on the table? Can its cable turn freely? yes"),
    ]
    assert ("resumed", f"sweep after {run.rows} poses") in events
    assert in_words(Event("", "resumed", "sweep at pose 1"), {}).text == "sweep after 1 pose"
    older = Event("", "answer level-front-x", "-0.0")
    assert in_words(older, {}).text == "level front x: 0"
    assert in_words(older, {"level-front-x": "What does it show along x, in deg?"}).text.endswith("in deg? 0")


def test_an_undisturbed_run_has_no_interruptions() -> None:
    with Record() as record:
        run = start(record, read_bench(), *small_sweep(), Onlooker()).run
        assert INTERRUPTIONS not in table_of(record, run.run).constants


def test_a_resume_records_that_the_part_before_was_killed() -> None:
    killed = _turns(lines(("begun", "sweep at pose 0"), ("begun", "sweep at pose 3"), ("complete", "")))
    assert [(turn.what, turn.text) for turn in killed] == [
        ("begun", "sweep at pose 0"),
        ("resumed", "sweep at pose 3; before, its process was killed or the disk was full"),
        ("complete", ""),
    ]


def test_the_log_of_an_older_program_has_a_history_too() -> None:
    older = _turns(
        lines(
            ("begun", "sweep at pose 0"),
            ("error", "Stopped: stopped by SIGTERM"),
            ("stopped", "all instruments are at rest"),
            ("begun", "sweep at pose 3"),
            ("error", "an error without a name"),
        )
    )
    assert [(turn.what, turn.text) for turn in older] == [
        ("begun", "sweep at pose 0"),
        ("stopped", "by SIGTERM; all instruments are at rest"),
        ("resumed", "sweep at pose 3"),
        ("failed", "an error without a name"),
    ]
