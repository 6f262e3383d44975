"""What happened in a run, step by step and when; on request every message to and from instruments."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from drivers.transport.faults import Fault
from rig.bench import read_bench
from rig.record import Record
from rig.runs.runner import resume, start
from rig.runs.signals import SHOWN_BYTES, message_text
from tests.rig.conftest import Rig
from tests.rig.misbehaving import afflicted
from tests.rig.rigging import POSES, Onlooker, small_sweep


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"ERR?\n", r"'ERR?\n'"),
        (bytes.fromhex("0103007f"), "01 03 00 7f"),
        (b"X=+00.035\r\n", r"'X=+00.035\r\n'"),
        (b"\xff\xfe", "ff fe"),
        (bytes(100), " ".join(["00"] * SHOWN_BYTES) + " ... 100 bytes"),
    ],
)
def test_a_message_is_shown_as_text_where_it_is_some(data: bytes, text: str) -> None:
    assert message_text(data) == text


@pytest.mark.sockets
def test_a_run_shows_its_steps_its_interruption_and_its_continuation(rig: Rig) -> None:
    bench = read_bench()
    with Record() as record:
        broken = afflicted(bench, "alpha", Fault("alarm", at_s=30.0))
        run = start(record, broken, *small_sweep(), Onlooker()).run
        kept = run.rows
        resume(record, run.run, Onlooker(), bench)
        lines = record.lines(run.run)
    told = [line.what for line in lines]
    assert told[0] == "begun"
    assert told.count("kept") == POSES
    error = told.index("error")
    assert lines[error].text.startswith("StageAlarm: alpha: has stopped with alarm 30")
    assert [(line.what, line.text) for line in lines[error + 1 : error + 3]] == [
        ("stopped", "all instruments are at rest"),
        ("begun", f"sweep at pose {kept}"),
    ]
    assert 30.0 <= lines[error].clock_s < 40.0
    assert lines[-1].what == "complete"
    assert {line.who for line in lines} == {"run"}, "messages are logged on request"
    told = [line[23:] for line in rig("show", run.run).out.splitlines() if line.startswith("  20")]
    assert [line.partition(":")[0] for line in told if not line.startswith("answer")] == [
        "begun", "failed", "resumed", "complete"
    ]  # fmt: skip
    assert told[-2].endswith(f"resumed: sweep at pose {kept}")
    assert re.search("failed: alpha: has stopped with alarm 30.*; all instruments are at rest$", told[-3])


@pytest.mark.sockets
def test_every_message_is_logged_on_request_and_shown(rig: Rig, bench_file: Callable[..., Path]) -> None:
    small = ("--step-deg", "180", "--dwell-s", "0.1", "--inclinations-deg", "90")
    ended = rig("run", "sweep", *small, "--unattended", "--json", "--trace")
    run = ended.document["run"]
    log = rig("show", run, "--log", "--json").document["log"]
    sent, heard = ([line for line in log if line["what"] == way] for way in ("sent", "heard"))
    assert len(sent) > 100
    assert len(heard) > 100
    assert any(line["text"].startswith("01 10 00 58 00 10 20") for line in sent), "a move, as the manual writes it"
    assert {line["who"] for line in sent} >= {"alpha, beta", "adc", "oven", "level", "positioner"}, "whose wire"
    assert log[0]["clock_s"] < log[-1]["clock_s"]
    shown_log = rig("show", run, "--log").out
    assert "positioner  sent: '*IDN?" in shown_log
    assert "run  kept: pose 5: 100 samples" in shown_log
    assert "  run  doing: holding alpha 90, beta 0 deg" in shown_log
    assert "sent:" not in rig("show", run).out
