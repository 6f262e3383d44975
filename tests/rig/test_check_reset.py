"""`rig check --reset`: a person sees the alarm and its cause, and decides; nothing is reset without an answer."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.rig.conftest import Rig

CONVERTER = {"driver": "labjack_t7", "url": "simulated", "settings": {"channels": {"vx": 0}}}
TIME_OUT, OVERCURRENT = 0x85, 0x20  # the second needs a power cycle


@pytest.fixture
def check(rig: Rig, bench_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Call `rig check` on a bench of one stage with this alarm and these settings; `answer` is what a person types."""

    def call(*options: str, alarm: int | None = None, answer: str = "", **settings: object) -> Any:
        faults = [] if alarm is None else [{"what": "alarm", "size": alarm}]
        stage = {"driver": "oriental_az", "url": "simulated", "settings": settings, "faults": faults}
        bench = bench_file(json.dumps({"name": "one stage", "instruments": {"alpha": stage, "adc": CONVERTER}}))
        monkeypatch.setattr("sys.stdin", io.StringIO(answer))
        return rig("check", *options, "--bench", str(bench))

    return call


def row(shown: str, name: str) -> str:
    """The result of a check of the stage."""
    return next(line for line in shown.splitlines() if f" {name} " in line)


def test_a_person_sees_the_alarm_and_resets_it(check: Callable[..., Any]) -> None:
    ended = check("--reset", alarm=TIME_OUT, answer="y\n")
    assert "alpha: alarm 85, RS-485 communication time-out. Find out why the controller fell silent." in ended.err
    assert "alpha: the alarm is reset" in ended.err
    assert ended.status == 0
    assert " ok " in row(ended.out, "alarm")


@pytest.mark.parametrize(("answer", "status"), [("n\n", 3), ("\n", 3), ("", 4)], ids=["no", "return", "no answer"])
def test_without_a_yes_the_alarm_stays(check: Callable[..., Any], answer: str, status: int) -> None:
    ended = check("--reset", alarm=TIME_OUT, answer=answer)
    assert "the alarm is reset" not in ended.err
    assert ended.status == status


def test_an_alarm_that_needs_a_power_cycle_is_not_asked_about(check: Callable[..., Any]) -> None:
    ended = check("--reset", alarm=OVERCURRENT, answer="y\n")
    assert "alpha: no command resets this alarm; it needs a power cycle" in ended.err
    assert "nobody near the rig" not in ended.err
    assert ended.status == 3


def test_an_alarm_is_shown_with_its_remedy_without_the_option(check: Callable[..., Any]) -> None:
    ended = check(alarm=TIME_OUT)
    assert ended.status == 3
    assert row(ended.out, "alarm").endswith("reset the alarm with `rig check --reset`, or switch the drive off and on")


def test_a_drive_without_an_alarm_is_left_alone(golden, check: Callable[..., Any]) -> None:
    ended = check("--reset")
    assert ended.status == 0
    golden.same(ended.err)


def test_a_reset_is_not_asked_for_with_json(check: Callable[..., Any]) -> None:
    assert check("--reset", "--json", alarm=TIME_OUT).status == 2


def test_parameters_at_unconfirmed_addresses_are_shown_where_they_are_used(check: Callable[..., Any]) -> None:
    assert "0x138A" not in check().out
    used = check(communication_timeout_s=1, own_limits=True).out
    assert "0 s in register 0x138A" in row(used, "time-out")
    assert "it is not confirmed for AZ drives" in row(used, "time-out")
    assert "0x0386" in row(used, "own limits")


def test_a_wrong_register_of_the_time_out_fails_the_check(check: Callable[..., Any]) -> None:
    """Here 0x00F8, the drive's temperature: a wrong address would change another parameter of the drive."""
    ended = check(communication_timeout_s=1, communication_timeout_register=0x00F8)
    assert ended.status == 3
    assert " FAILED " in row(ended.out, "time-out")
