"""A procedure through the simulated instruments' sockets into the record, disturbed and undisturbed."""

from __future__ import annotations

import re
import signal
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest

from calibrations.table import Table
from drivers.errors import LimitError, StageAlarm
from procedures.catalogue import SHIPPED, find
from procedures.errors import SettingError
from procedures.level_check import FACE_UP
from procedures.session import Limits
from procedures.sweep import grid
from rig.bench import Bench, read_bench
from rig.errors import Busy, InstrumentFailed, RunMismatch
from rig.instruments.instruments import Rig
from rig.instruments.wiring import open_wires
from rig.lease import lease
from rig.record import KeptPose, Record
from rig.record.measured import table_of
from rig.runs.runner import Outcome, resume, start
from tests.rig.rigging import POSES, Onlooker, small_sweep
from tests.slow import first_fast

pytestmark = pytest.mark.sockets


def run_small(record: Record, bench: Bench | None = None, watch: Onlooker | None = None) -> Outcome:
    return start(record, bench or read_bench(), *small_sweep(), watch or Onlooker())


def samples(record: Record, run: str) -> list[Any]:
    """All that was measured, comparable bit for bit."""
    return [
        (kept.pose, kept.samples.volts.tobytes(), kept.samples.start_s, kept.t_s, kept.temperature_c)
        for kept in record.kept(run)
    ]


@dataclass(frozen=True)
class Undisturbed:
    """The small sweep on the default rig: its table, and all that was measured."""

    table: Table
    samples: list[Any]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RIG_HOME", str(tmp_path_factory.mktemp("whole")))
        with Record() as record:
            run = run_small(record).run.run
            return Undisturbed(table_of(record, run), samples(record, run))


class Interrupting(Onlooker):
    """Does something when the pose `at` has been kept."""

    def __init__(self, at: int, then: Callable[[], None]) -> None:
        super().__init__()
        self._at, self._then = at, then

    def kept(self, kept: KeptPose) -> None:
        super().kept(kept)
        if len(self.seen) == self._at:
            self._then()


def raising(error: BaseException) -> Callable[[], None]:
    def then() -> None:
        raise error

    return then


def test_a_sweep_keeps_every_pose_once_in_order() -> None:
    watch = Onlooker()
    with Record() as record:
        outcome = run_small(record, watch=watch)
        table = table_of(record, outcome.run.run)
        poses = record.poses(outcome.run.run)
    assert outcome.error is None
    assert (outcome.run.state, outcome.run.rows, watch.expected) == ("complete", POSES, [(POSES, 0)])
    assert poses == list(grid((90.0, 45.0), 90.0)) == [kept.pose for kept in watch.seen]
    assert watch.said[:3] == [f"mounting: {FACE_UP}", "homing alpha", "homing beta"]
    assert set(table.column("n")) == {200}
    assert np.all(np.diff(table.column("t_s")) > 0)


def test_the_sensor_feels_gravity_through_all_the_wires(whole: Undisturbed) -> None:
    table = whole.table
    alpha, beta = np.radians(table.column("alpha_deg")), np.radians(table.column("beta_deg"))
    assert np.allclose(table.column("vx_v"), 2.5 + np.sin(alpha) * np.cos(beta), atol=0.06)
    assert np.allclose(table.column("vy_v"), 2.5 + np.sin(alpha) * np.sin(beta), atol=0.06)


def test_time_counts_from_the_sensors_power(whole: Undisturbed) -> None:
    with Record() as record:
        cold = run_small(record, read_bench().model_copy(update={"world": {"heat": {"powered_for_s": 0.0}}}))
        assert table_of(record, cold.run.run).column("t_s")[0] < 60
    assert whole.table.column("t_s")[0] > 12 * 3600


class NextDay(datetime):
    """The clock of a computer, one day later."""

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> Self:
        return super().now(tz) + timedelta(days=1)


def test_a_run_of_a_real_bench_is_resumed_unless_the_clock_was_set_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its time counts from the begin of the run. The clock of a simulated bench begins again: it is set back."""
    monkeypatch.setattr(Rig, "power_on_s", lambda rig: None)
    monkeypatch.setattr(Rig, "state", lambda rig: None)
    with Record() as record:
        run = run_small(record, watch=Interrupting(1, raising(KeyboardInterrupt()))).run.run
        refused = resume(record, run, Onlooker())
        assert isinstance(refused.error, RunMismatch)
        assert refused.run.rows == 1
        monkeypatch.setattr("rig.runs.host.datetime", NextDay)
        resume(record, run, Interrupting(1, raising(KeyboardInterrupt())))
        first_s, second_s = table_of(record, run).column("t_s")
    assert first_s < 3600 < 24 * 3600 < second_s


def test_the_same_seed_gives_the_same_run_sample_for_sample(whole: Undisturbed) -> None:
    with Record() as record:
        other = run_small(record, read_bench().model_copy(update={"seed": 2})).run.run
        again = run_small(record).run.run
        assert samples(record, again) == whole.samples
        assert samples(record, other) != whole.samples


STOPPED = [
    (signal.SIGINT, "stopped by a person"),
    (signal.SIGTERM, "stopped by another program"),
    (signal.SIGHUP, "stopped because its terminal was closed"),
]


@pytest.mark.parametrize(("number", "source"), first_fast(STOPPED))
def test_a_signal_stops_and_resume_makes_the_same_run(number: signal.Signals, source: str, whole: Undisturbed) -> None:
    with Record() as record:
        broken = run_small(record, watch=Interrupting(7, lambda: signal.raise_signal(number)))
        assert broken.run.state == "stopped"
        assert broken.run.rows == 7
        assert str(broken.error).startswith(source)
        watch = Onlooker()
        done = resume(record, broken.run.run, watch)
        assert (done.run.state, watch.expected) == ("complete", [(POSES, 7)])
        assert samples(record, done.run.run) == whole.samples


def test_a_run_may_be_interrupted_again_and_again(whole: Undisturbed) -> None:
    with Record() as record:
        run = run_small(record, watch=Interrupting(1, raising(KeyboardInterrupt()))).run.run
        for step in (3, 5):
            resume(record, run, Interrupting(step, raising(KeyboardInterrupt())))
        assert record.run(run).rows == 9
        resume(record, run, Onlooker())
        assert samples(record, run) == whole.samples


def test_a_failing_instrument_leaves_a_run_that_can_be_resumed(whole: Undisturbed) -> None:
    with Record() as record:
        alarm = StageAlarm("beta: has stopped with alarm 30", "Look at the stage", 0x30)
        failed = run_small(record, watch=Interrupting(4, raising(alarm)))
        assert (failed.run.state, failed.error) == ("failed", alarm)
        assert "alarm 30" in (failed.run.message or "")
        resume(record, failed.run.run, Onlooker())
        assert samples(record, failed.run.run) == whole.samples


def test_a_fault_of_the_program_is_recorded_and_raised() -> None:
    with Record() as record:
        with pytest.raises(ZeroDivisionError):
            run_small(record, watch=Interrupting(2, raising(ZeroDivisionError("x"))))
        (run,) = record.runs()
        assert (run.state, run.message, run.rows) == ("failed", "ZeroDivisionError: x", 2)


def test_a_temperature_outside_the_limits_stops_the_run() -> None:
    bench = read_bench().model_copy(update={"limits": Limits(temperature_c=(0.0, 10.0))})
    with Record() as record:
        outcome = run_small(record, bench)
    assert (outcome.run.state, outcome.run.rows) == ("stopped", 0)
    assert "outside the limits of 0 to 10 C" in str(outcome.error)


def test_resuming_a_complete_run_measures_nothing() -> None:
    with Record() as record:
        run = run_small(record).run
        watch = Onlooker()
        assert resume(record, run.run, watch).run == run
        assert not watch.seen


def test_a_question_is_asked_once_even_if_the_run_is_resumed() -> None:
    with Record() as record:
        run = run_small(record, watch=Interrupting(2, raising(KeyboardInterrupt()))).run.run
        watch = Onlooker()
        resume(record, run, watch)
        assert not any(said.startswith("mounting") for said in watch.said)
        assert [(event.what, event.text) for event in record.events(run)] == [("answer mounting", "yes")]


def test_another_bench_is_refused() -> None:
    with Record() as record:
        run = run_small(record, watch=Interrupting(2, raising(KeyboardInterrupt()))).run.run
        with pytest.raises(RunMismatch, match="began with another bench"):
            resume(record, run, Onlooker(), read_bench().model_copy(update={"seed": 2}))
        assert resume(record, run, Onlooker(), read_bench()).run.state == "complete"


def test_two_processes_do_not_work_on_one_run() -> None:
    with Record() as record:
        run = run_small(record, watch=Interrupting(2, raising(KeyboardInterrupt()))).run.run
        with lease(record.folder, run, "it"):
            record.set_state(run, "running")
            assert record.run(run).state == "running"
            with pytest.raises(Busy, match=f"another process .* uses run {run}"):
                resume(record, run, Onlooker())
        assert record.run(run).state == "stopped"  # nobody holds it


def test_a_bench_without_a_thermometer_measures_without_temperature() -> None:
    document = read_bench().document()
    del document["instruments"]["oven"]
    with Record() as record:
        table = table_of(record, run_small(record, Bench.model_validate(document)).run.run)
    assert table.n == POSES
    assert "temperature_c" not in table


def test_limits_hold_before_anything_is_written() -> None:
    document = read_bench().document()
    document["instruments"]["beta"]["settings"]["limits_deg"] = [-360, 360]
    with Record() as record:
        with pytest.raises(LimitError, match=r"beta: 365 deg is outside its limits -360 \.\. 360"):
            run_small(record, Bench.model_validate(document))
        assert record.runs() == []


def test_settings_are_refused_before_anything_is_written() -> None:
    sweep, settings = small_sweep()
    with Record() as record:
        with pytest.raises(SettingError, match="step_deg is 7"):
            start(record, read_bench(), sweep, settings | {"step_deg": 7.0}, Onlooker())
        assert record.runs() == []


@pytest.mark.parametrize("url", ["tcp://127.0.0.1:1", "serial:/dev/there-is-none?baud=9600&parity=N"])
def test_an_unreachable_instrument_is_named_and_nothing_is_written(url: str) -> None:
    document = read_bench().document()
    document["instruments"]["oven"]["url"] = url
    with Record() as record:
        with pytest.raises(InstrumentFailed, match=r"oven \(omega_cn7500\) at .* Check") as error:
            run_small(record, Bench.model_validate(document))
        assert record.runs() == []
    assert str(error.value).count(url.partition("?")[0]) == 1
    assert url in str(error.value)


def test_results_of_a_procedure_are_kept(tmp_path: Path) -> None:
    from procedures.catalogue import find

    (tmp_path / "weigh.py").write_text(
        '"""weigh: a result."""\n\ndef weigh(rig, *, grams: float = 1.0):\n'
        '    return {"mass": {"value": grams, "std": 0.1, "unit": "g"}}\n'
    )
    with Record() as record:
        outcome = start(record, read_bench(), find("weigh", tmp_path), {"grams": 2.0}, Onlooker())
    assert outcome.run.results["mass"] == {"value": 2.0, "std": 0.1, "unit": "g", "limit": None, "verdict": None}


def test_a_run_marks_the_pose_from_which_the_program_changed(tmp_path: Path) -> None:
    own = tmp_path / "procedures"
    own.mkdir()
    (own / "sweep.py").write_text((SHIPPED / "sweep.py").read_text())
    bench = read_bench()
    bench = bench.model_copy(update={"folders": bench.folders.model_copy(update={"procedures": own})})
    procedure, settings = find("sweep", own), small_sweep()[1]
    with Record() as record:
        run = start(record, bench, procedure, settings, Interrupting(5, raising(KeyboardInterrupt()))).run.run
        (line,) = record.lines(run, ("program",))
        assert re.fullmatch(r"inertial-rig \S+, procedure sweep [0-9a-f]{16}", line.text)
        with (own / "sweep.py").open("a") as file:
            file.write("# edited\n")
        assert resume(record, run, Onlooker(), bench).run.state == "complete"
        (event,) = (event for event in record.events(run) if event.what == "program changed")
        assert event.text.startswith("from pose 5: ")
        assert str(table_of(record, run).constants["program_changed"]).startswith("from pose 5: ")


def test_a_wire_is_busy_for_runs_of_another_record(
    tmp_path: Path, bench_file: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tty").touch()
    parts = {"alpha": {"driver": "oriental_az", "url": f"serial:{tmp_path}/tty", "unit": 1}}
    bench = read_bench(bench_file({"instruments": parts}))
    with open_wires(bench):
        monkeypatch.setenv("RIG_HOME", str(tmp_path / "another"))
        monkeypatch.setenv("TMPDIR", str(tmp_path))
        monkeypatch.setattr(tempfile, "tempdir", None)  # as in another process
        with pytest.raises(Busy, match="uses serial:"), open_wires(bench):
            pass
