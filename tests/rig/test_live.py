"""A live discovery on simulated rigs: the cause, in less rig time than the standard sweep, and a clean end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from calibrations.design.experiment import Experiment
from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit
from calibrations.loop import discover
from calibrations.model.file import read_model
from rig.bench import read_bench
from rig.record import Record
from rig.record.measured import table_of
from rig.runs.live import FIRST, Live, Measurement, is_confirmed
from tests.hidden.quick_rig import QuickRig
from tests.hidden.rigs import IDEAL
from tests.rig.conftest import Rig

FAST_ADC = {"driver": "labjack_t7", "url": "simulated", "settings": {"channels": {"vx": 0, "vy": 1}, "rate_hz": 200}}
TURNED = {"preset": "ideal", "sensor": {"package": {"turn_z_deg": 0.1}}}
FORESHORTENED = {"preset": "ideal", "sensor": {axis: {"springs": {"foreshortening_per_um": 0.2}} for axis in "xy"}}


@pytest.fixture
def bench(bench_file: Callable[..., Path]) -> Callable[..., str]:
    """A simulated rig of the given physics, its converter slow enough for a test."""

    def write(world: Any, **changes: Any) -> str:
        parts = {role: part.model_dump(mode="json") for role, part in read_bench(None).instruments.items()}
        parts = {role: part for role, part in parts.items() if role in ("alpha", "beta", "oven")} | {"adc": FAST_ADC}
        for role, more in changes.items():
            parts[role] |= more
        return str(bench_file({"instruments": parts, "world": world, "limits": {}, "d63": None}))

    return write


@pytest.mark.slow
@pytest.mark.sockets
@pytest.mark.parametrize(
    ("world", "cause"),
    [(TURNED, "axis-misalignment"), (FORESHORTENED, "cross-axis-bias")],
    ids=["turned", "bent"],
)
def test_the_cause_is_found_in_less_rig_time_than_the_standard_sweep(
    rig: Rig, bench: Callable[..., str], tmp_path: Path, world: Any, cause: str
) -> None:
    out = str(tmp_path / "found.yaml")
    ended = rig("discover", "--live", "--bench", bench(world), "--unattended", "--out", out, "--json")
    found = ended.done().document
    assert (found["schema"], found["verdict"], found["causes"]) == ("rig.discovery/1", "adequate", [cause])
    assert found["stands"]
    assert found["rig_time_s"] < found["standard_rig_time_s"] / 2
    assert [e["run"] for e in found["experiments"]] == found["runs"]
    assert cause in read_model(out).effects
    with Record() as record:
        tables = [table_of(record, run) for run in found["runs"]]
        assert all(record.run(run).state == "complete" for run in found["runs"])
    ends = [table.time_s.max() for table in tables[:-1]]
    assert all(table.time_s.min() > end for table, end in zip(tables[1:], ends, strict=True))
    again = rig("discover", *found["runs"], "--json").document
    assert (again["verdict"], again["causes"]) == (found["verdict"], found["causes"])
    assert f"{found['runs'][0]}: 54 poses in " in ended.err
    assert "Next, " in ended.err


@pytest.mark.sockets
def test_a_failure_ends_the_loop_and_the_runs_stay(rig: Rig, bench: Callable[..., str]) -> None:
    ended = rig(
        "discover", "--live", "--unattended", "--bench",
        bench(TURNED, beta={"faults": [{"what": "silence", "at_s": 100}]}),
    )  # fmt: skip
    assert ended.status == 3
    with Record() as record:
        (run,) = record.runs()
    assert (run.state, 0 < run.rows < 54) == ("failed", True)
    assert f"To continue: rig resume {run.run}, then rig discover {run.run}" in ended.err
    assert ended.out == ""


def found(**changes: Any) -> Discovery[Fit]:
    bench = read_bench(None)
    one = discover(QuickRig(IDEAL, 1, bench).measure(FIRST)[1], read_model("linear"))
    return changed(one, **changes)


def changed(one: Discovery[Fit], **changes: Any) -> Discovery[Fit]:
    """The same discovery with other findings."""
    return Discovery.of(replace(one.findings, **changes))


def done(*answers: Discovery[Fit]) -> list[Measurement]:
    return [Measurement(FIRST, "run", answer, 0.0) for answer in answers]


def test_an_explanation_is_confirmed_if_later_data_give_it_as_the_only_one() -> None:
    one = found(causes=("hysteresis",))
    doubtful = changed(one, alternatives={"hysteresis": ("dead-zone",)})
    assert doubtful.verdict == "ambiguous"
    assert not is_confirmed(done(one))
    assert is_confirmed(done(one, one))
    assert is_confirmed(done(doubtful, one))
    assert is_confirmed(done(doubtful, changed(one, causes=("dead-zone",))))
    assert not is_confirmed(done(one, doubtful))
    assert not is_confirmed(done(one, changed(one, causes=("bias-drift",))))
    assert not is_confirmed(done(one, changed(one, causes=("hysteresis", "bias-drift"))))


def test_an_unexplained_verdict_is_confirmed_if_the_pattern_stays() -> None:
    steps = [found(spoilt=True, left=f"step at t = {t} s") for t in (900, 917)]
    assert [step.verdict for step in steps] == ["unexplained", "unexplained"]
    assert is_confirmed(done(*steps))
    assert not is_confirmed(done(steps[0], changed(steps[1], left="5th harmonic of the stage angle beta")))


def loop(world: dict[str, Any], minutes: float) -> list[Measurement]:
    bench = read_bench(None)
    rig = QuickRig(IDEAL.changed(world), 1, bench)
    return list(Live(bench, None, read_model("linear"), catalogue(), 60 * minutes, rig.measure).measurements())


def test_no_experiment_begins_that_is_longer_than_the_remaining_time() -> None:
    (only,) = loop({}, minutes=10)
    assert (only.following, only.used_s < 600) == (None, True)


@pytest.mark.slow
def test_an_experiment_without_poses_is_proposed_and_the_time_is_used() -> None:
    told = loop({"base": {"tilt_y_deg": 0.1}}, minutes=20)
    last = told[-1].discovery
    assert last.verdict == "ambiguous"
    assert {*last.causes, *last.alternatives[last.causes[0]]} == {"base-tilt", "stage-zero-offset"}
    assert isinstance(last.next_experiment, Experiment)
    assert last.next_experiment.procedure == "level-check"
    assert told[-1].used_s <= 1200
