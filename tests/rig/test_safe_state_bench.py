"""Faults in the bench file: what is refused, and a run that fails, is repaired and goes on, by commands alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from rig.bench import DEFAULT, read_bench
from rig.errors import BenchError
from rig.record import Record
from tests.rig.conftest import Rig
from tests.rig.rigging import SMALL_ARGUMENTS


def with_faults(role: str, *faults: dict[str, Any], **part: Any) -> dict[str, object]:
    """The instruments of the simulated rig; one of them has faults."""
    instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
    instruments[role] |= {"faults": list(faults), **part}
    return {"instruments": instruments}


@pytest.mark.parametrize(
    ("role", "fault", "said"),
    [
        ("alpha", {"what": "alram"}, "key instruments.alpha.faults.0.what: no fault 'alram'. Did you mean 'alarm'?"),
        ("adc", {"what": "servo"}, "key instruments.adc.faults.0.what: no fault 'servo'."),
        (
            "alpha",
            {"what": "alarm", "for": 3},
            "key instruments.alpha.faults.0.for: no such key. Did you mean 'for_s'?",
        ),
        ("alpha", {"at_s": 3}, "key instruments.alpha.faults.0.what: this key is missing"),
        ("alpha", {"what": "alarm", "at_s": -1}, "at_s and after must not be negative"),
        ("alpha", {"what": "alarm", "probability": 2}, "probability must be above 0, and at most 1"),
        ("oven", {"what": "garbage", "size": 0}, "key instruments.oven.faults.0.size: must be at least 1 byte"),
        ("oven", {"what": "silence", "size": 3}, "faults.0.size: this fault has no size; remove it"),
    ],
)
def test_an_impossible_fault_is_refused(
    bench_file: Callable[..., Path], role: str, fault: dict[str, Any], said: str
) -> None:
    path = bench_file(with_faults(role, fault))
    with pytest.raises(BenchError) as error:
        read_bench(path)
    assert str(error.value).startswith(str(path))
    assert said in str(error.value)


def test_a_real_instrument_is_given_no_faults(golden, bench_file: Callable[..., Path]) -> None:
    path = bench_file(with_faults("alpha", {"what": "alarm"}, url="serial:/dev/ttyUSB0"))
    with golden.refused(BenchError):
        read_bench(path)


@pytest.mark.sockets
def test_a_run_that_fails_continues_after_a_repair(bench_file: Callable[..., Path], rig: Rig) -> None:
    fault = {"what": "flipped-bit", "at_s": 40, "size": 20}
    broken = bench_file(with_faults("beta", fault))
    failed = rig("run", "sweep", *SMALL_ARGUMENTS, "--bench", str(broken), "--unattended", "--json")
    run = failed.document["run"]
    assert (failed.status, failed.document["state"]) == (3, "failed")
    said = "rig: beta: reading register 0x007F (driver output status): received 11 bytes that are not an answer"
    assert failed.err.splitlines()[-1].startswith(said)
    assert rig("resume", run, "--unattended").status == 3  # nobody has repaired it
    sound = bench_file({})
    assert rig("resume", run, "--unattended", "--bench", str(sound)).status == 0
    with Record() as record:
        assert record.run(run).bench["instruments"]["beta"]["faults"][0]["what"] == "flipped-bit"
        assert any(event.what == "not stopped" and event.text.startswith("beta may") for event in record.events(run))


@pytest.mark.sockets
def test_a_plan_is_made_with_sound_instruments(bench_file: Callable[..., Path], rig: Rig) -> None:
    path = bench_file(with_faults("alpha", {"what": "silence"}))
    assert rig("plan", "misalignment", "--most-rounds", "1", "--dwell-s", "0.1", "--bench", str(path)).status == 0
