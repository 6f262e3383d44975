"""An interrupted run: stages stand still, then whoever looks on has it resumed, its last pose repeated, or ended."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any, cast

import pytest

from drivers.errors import StageAlarm
from procedures.catalogue import find
from procedures.errors import Declined
from procedures.session import Limits
from procedures.settings import parse
from rig.bench import read_bench
from rig.errors import InstrumentFailed
from rig.instruments.instruments import Rig
from rig.planning.plan import Plan
from rig.record import KeptPose, Record
from rig.runs.runner import REPEATED, Decision, Outcome, start
from tests.rig.rigging import POSES, Onlooker, small_sweep
from tests.slow import first_fast

pytestmark = pytest.mark.sockets


class Disturbed(Onlooker):
    """Something happens, once, when the pose `at` has been kept."""

    def __init__(self, then: Callable[[], object], *wishes: Decision, at: int = 7) -> None:
        super().__init__(wishes=list(wishes))
        self._then, self._at = then, at

    def kept(self, kept: KeptPose) -> None:
        super().kept(kept)
        if len(self.seen) == self._at:
            self._then()


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def alarm() -> None:
    raise StageAlarm("beta: has stopped with alarm 30", "Look at the stage", 0x30)


def measured(record: Record, run: str) -> list[object]:
    """What analyses see, comparable bit for bit."""
    return [(k.pose, k.samples.volts.tobytes(), k.t_s) for k in record.kept(run) if k.excluded is None]


@pytest.mark.parametrize("disturb", first_fast([alarm, interrupt]))
def test_resumed_at_once_it_equals_an_undisturbed_run(disturb: Callable[[], object]) -> None:
    with Record() as record:
        whole = start(record, read_bench(), *small_sweep(), Onlooker())
        watch = Disturbed(disturb, "resume")
        outcome = start(record, read_bench(), *small_sweep(), watch)
        assert (outcome.run.state, outcome.error, len(watch.outcomes)) == ("complete", None, 1)
        assert measured(record, outcome.run.run) == measured(record, whole.run.run)
        assert len(record.runs()) == 2


def test_a_repeated_pose_stays_in_the_record_and_is_measured_again() -> None:
    watch = Disturbed(interrupt, "repeat")
    with Record() as record:
        outcome = start(record, read_bench(), *small_sweep(), watch)
        kept = list(record.kept(outcome.run.run))
        events = [(event.what, event.text) for event in record.events(outcome.run.run)]
    assert outcome.run.state == "complete"
    assert [k.excluded for k in kept] == [None] * 6 + [REPEATED] + [None] * (POSES - 6)
    assert kept[7].pose == kept[6].pose
    assert kept[7].t_s > kept[6].t_s
    assert ("pose 6 excluded", REPEATED) in events


def test_repeat_without_a_recorded_pose_continues() -> None:
    watch = Onlooker(wishes=["repeat"])
    first = iter([interrupt])
    watch.doing = lambda text: next(first, lambda: None)()
    with Record() as record:
        outcome = start(record, read_bench(), *small_sweep(), watch)
        assert (outcome.run.state, outcome.run.rows) == ("complete", POSES)


def test_the_stages_stand_still_before_a_person_is_asked() -> None:
    watch = Disturbed(interrupt)
    with Record() as record:
        outcome = start(record, read_bench(), *small_sweep(), watch)
    (seen,) = watch.outcomes
    assert (seen.run.state, seen.moving) == ("stopped", ())
    assert outcome == seen


@pytest.mark.parametrize("number", first_fast([signal.SIGTERM, signal.SIGHUP]))
def test_a_signal_other_than_ctrl_c_ends_the_run_without_a_question(number: signal.Signals) -> None:
    watch = Disturbed(lambda: signal.raise_signal(number), "resume")
    with Record() as record:
        outcome = start(record, read_bench(), *small_sweep(), watch)
    assert (outcome.run.state, outcome.run.rows, watch.outcomes) == ("stopped", 7, [])


class Impatient(Disturbed):
    """Sends a signal while they are asked."""

    signal = signal.SIGINT

    def interrupted(self, outcome: Outcome) -> Decision:
        signal.raise_signal(self.signal)
        return "resume"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_at_the_question_ends_the_run(number: signal.Signals) -> None:
    watch = Impatient(interrupt)
    watch.signal = number
    with Record() as record:
        outcome = start(record, read_bench(), *small_sweep(), watch)
        assert (outcome.run.state, outcome.run.rows) == ("stopped", 7)
        assert str(outcome.error).startswith("stopped by a person; `rig resume ")


def test_an_instrument_that_still_does_not_answer_is_reported_and_the_question_is_repeated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def gone(*arguments: object) -> None:
        raise InstrumentFailed("beta does not answer")

    monkeypatch.setattr("rig.runs.runner._stop", lambda _: ["beta may still move"])
    watch = Disturbed(
        lambda: (monkeypatch.setattr("rig.runs.runner._require_same_instruments", gone), alarm()), "resume"
    )
    with Record() as record:
        outcome = start(record, read_bench(), *small_sweep(), watch)
    assert [str(seen.error) for seen in watch.outcomes][1:] == ["beta does not answer"]
    assert [seen.moving for seen in watch.outcomes] == [("beta may still move",)] * 2  # until something stops it
    assert [seen.retried for seen in watch.outcomes] == [False, True]
    assert (outcome.run.state, outcome.run.rows) == ("failed", 7)


def test_a_limit_that_is_still_passed_is_asked_about_until_the_end() -> None:
    bench = read_bench().model_copy(update={"limits": Limits(temperature_c=(0.0, 10.0))})
    watch = Onlooker(wishes=["resume", "resume"])
    with Record() as record:
        outcome = start(record, bench, *small_sweep(), watch)
    assert len(watch.outcomes) == 3
    assert "outside the limits" in str(outcome.error)


def test_a_declined_run_leaves_nothing() -> None:
    watch = Onlooker()

    def refuse(plan: Plan) -> None:
        assert plan.poses == POSES
        raise Declined("not begun")

    watch.planned = refuse
    with Record() as record:
        with pytest.raises(Declined):
            start(record, read_bench(), *small_sweep(), watch)
        assert record.runs() == []


class DisturbedMotion(Onlooker):
    """Presses Ctrl-C in the middle of the stream in which the sensor is shaken, once."""

    def kept(self, kept: KeptPose) -> None:
        super().kept(kept)
        if kept.pose.path.startswith("motion") and not self.outcomes:
            interrupt()


def test_positioner_and_stream_stop_at_once_too(monkeypatch: pytest.MonkeyPatch) -> None:
    moved_um: list[float] = []
    stop = Rig.stop

    def watched(rig: Rig) -> list[str]:
        complaints, positioner = stop(rig), cast(Any, rig.drivers["positioner"])
        before_um = positioner.position_um("x")
        rig.clock.sleep(0.03)
        moved_um.append(abs(positioner.position_um("x") - before_um))
        return complaints

    monkeypatch.setattr(Rig, "stop", watched)
    motion = find("motion")
    settings = parse(motion, {"duration_s": "5", "still_s": "2", "block_s": "1", "dwell_s": "0.1"})
    watch = DisturbedMotion(wishes=["resume"])
    with Record() as record:
        outcome = start(record, read_bench(), motion, settings, watch)
        paths = [kept.pose.path for kept in record.kept(outcome.run.run) if kept.pose.path.startswith("motion")]
    assert (outcome.run.state, len(watch.outcomes), watch.outcomes[0].moving) == ("complete", 1, ())
    assert moved_um[0] < 0.1  # it swings by 60 um
    assert len(set(paths)) == len(paths) == 5
