"""A run that nobody looks at never waits: what would need a person stops it safely, says so, and can be resumed."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.world.world import World
from procedures.catalogue import find
from procedures.errors import NoAnswer, SafetyLimit
from procedures.questions import Question
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.cli.terminal.failure import status_of
from rig.cli.terminal.watch import Quiet
from rig.instruments.instruments import Rig
from rig.planning.plan import plan
from rig.record import Record
from rig.runs.runner import Outcome, resume, start
from tests.rig.rigging import ON_STAGES, Onlooker, small_sweep

pytestmark = pytest.mark.sockets

ASKING = [name for name in ON_STAGES if plan(read_bench(), find(name), parse(find(name), {})).asked]


def bench_without_level() -> Bench:
    """A person reads a spirit level there."""
    document = read_bench().document()
    del document["instruments"]["level"]
    return Bench.model_validate(document)


@pytest.fixture
def deserted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Nobody stands at the simulated bench; what was stopped there, in order."""
    monkeypatch.setattr("rig.runs.host.answer", lambda question, rig: None)
    stopped: list[str] = []
    stop = Rig.stop

    def noted(rig: Rig) -> list[str]:
        stopped.append("all")
        return stop(rig)

    monkeypatch.setattr(Rig, "stop", noted)
    return stopped


def stops_and_says(outcome: Outcome, stopped: list[str]) -> None:
    assert isinstance(outcome.error, NoAnswer)
    assert status_of(outcome.error) == 4
    assert (outcome.run.state, outcome.moving, stopped) == ("stopped", (), ["all"])
    assert "has no answer" in str(outcome.run.message)
    assert "--answers" in str(outcome.run.message)


@pytest.mark.parametrize("name", ASKING)
def test_a_question_stops_every_procedure_that_has_one(name: str, deserted: list[str]) -> None:
    procedure = find(name)
    with Record() as record:
        outcome = start(record, read_bench(), procedure, parse(procedure, {}), Quiet({}))
    stops_and_says(outcome, deserted)


@pytest.mark.parametrize("name", sorted(set(ON_STAGES) - set(ASKING)))
def test_a_level_that_must_be_read_by_a_person_stops_the_others(name: str, deserted: list[str]) -> None:
    procedure = find(name)
    with Record() as record:
        outcome = start(record, bench_without_level(), procedure, parse(procedure, {}), Quiet({}))
    stops_and_says(outcome, deserted)
    assert "level-front-x" in str(outcome.error)


def test_a_file_of_answers_continues_the_run(deserted: list[str]) -> None:
    sweep, settings = small_sweep()
    with Record() as record:
        run = start(record, read_bench(), sweep, settings, Quiet({})).run.run
        assert resume(record, run, Quiet({"mounting": "yes"})).run.state == "complete"


def test_a_table_that_is_not_level_stops_it_and_is_read_again_when_it_was_levelled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown = iter([(1.0, 0.0)] * 2 + [(-1.0, 0.0)] * 2)  # before it is levelled: each axis on its own
    real = World.level_deg
    monkeypatch.setattr(World, "level_deg", lambda world: next(shown, None) or real(world))
    monkeypatch.setattr("rig.runs.host.answer", typed)
    watch = Onlooker(wishes=["resume"])
    with Record() as record:
        outcome = start(record, bench_without_level(), *small_sweep(), watch)
    assert [type(seen.error) for seen in watch.outcomes] == [SafetyLimit]
    assert "tilted by 1.000 deg along x" in str(watch.outcomes[0].error)
    assert "level the base, correct the zero of alpha, resume the run" in str(watch.outcomes[0].error)
    assert outcome.run.state == "complete"


def typed(question: Question, rig: Rig) -> Any:
    """What a person reads off the spirit level."""
    if question.name == "mounting":
        return "yes"
    assert rig.world is not None
    return repr(rig.world.level_deg()[0 if question.name.endswith("-x") else 1])
