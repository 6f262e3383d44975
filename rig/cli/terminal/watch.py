"""Observers of a run, guided in a terminal or unattended; and the message at its end."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import click

from calibrations.files import read_mapping
from procedures.catalogue import Procedure
from procedures.errors import BadAnswer, NoAnswer
from procedures.questions import Question
from procedures.session import Guidance, Reading
from rig.bench import Bench
from rig.bench.certificates import EXPIRED
from rig.cli.terminal.output import emit, note, notes
from rig.planning.plan import Plan
from rig.record import Kept, Record
from rig.runs.background.control import PublishingObserver
from rig.runs.host import SENSOR
from rig.runs.progress import RunningEstimates
from rig.runs.runner import Decision, Observer, Outcome
from rig.runs.soak_forecast import SoakForecaster, soak_forecaster
from rig.services.next_steps import next_steps, results_table

trace_option = click.option("--trace", is_flag=True, help="Log every message to and from instruments.")


class Quiet:
    """An unattended run. Answers come from the file, or from the simulated technician of a simulated bench.

    Standard error has the forecast of a soak after every reversal, and for other runs the result so far after every
    path.
    """

    def __init__(self, answers: Mapping[str, str], follower: SoakForecaster | RunningEstimates | None = None) -> None:
        self._answers, self._follower = answers, follower

    def planned(self, plan: Plan) -> None:
        """An unattended run needs no confirmation."""

    def begun(self, run: str) -> None:
        note(f"run {run}")
        if self._follower:
            self._follower.begun(run)

    def doing(self, text: str) -> None:
        """Not shown."""

    def guide(self, guidance: Guidance) -> None:
        """Print what a person with the sensor in the hand does next."""
        note(guidance.text)

    def expect(self, total: int, done: int) -> None:
        note(f"{total - done} of {total} poses remain")

    def kept(self, kept: Kept) -> None:
        """Print the forecast or the result so far."""
        if self._follower and (text := self._follower.told(kept)):
            note(text)

    def read(self, reading: Reading) -> None:
        """Not shown; the record has it."""

    def ask(self, question: Question, instead: str | None) -> str:
        given = self._answers.get(question.name, instead)
        if given is None:
            raise NoAnswer(
                f'the question "{question.text}" has no answer; write `{question.name}: ...` ({question.accepts}) '
                "into a file for --answers, or run in a terminal without --unattended"
            )
        return given

    def interrupted(self, outcome: Outcome) -> Decision:  # noqa: ARG002
        """An unattended run ends: nobody can decide."""
        return "end"


@contextmanager
def watching(procedure: Procedure, bench: Bench, unattended: bool, answers: Path | None) -> Iterator[Observer]:
    """The observer of a run: a person in a terminal, or nobody for an unattended run; pages observe in parallel."""
    given = _answers(answers)
    if unattended or not (sys.stdin.isatty() and sys.stderr.isatty()):
        with PublishingObserver(
            Quiet(given, soak_forecaster(procedure.name) or RunningEstimates()), procedure.name, bench, "nobody"
        ) as observer:
            yield observer
        return
    from rig.cli.terminal.guide import Guide  # only a terminal needs rich

    with (
        Guide(procedure, bench, given) as guide,
        PublishingObserver(guide, procedure.name, bench, "terminal") as observer,
    ):
        yield observer


def _answers(path: Path | None) -> dict[str, str]:
    if path is None:
        return {}
    document = read_mapping(path, "file of answers", BadAnswer, "write an answer in each line, such as `mounting: yes`")
    return {str(name): str(answer) for name, answer in document.items()}


def print_end(record: Record, outcome: Outcome, as_json: bool) -> int:
    """Print the end of a run; raises its error. Returns 1 if results are missing or exceed a limit, else 0."""
    run = outcome.run
    if as_json:
        head = {"schema": "rig.run/1", "run": run.run, "procedure": run.procedure, "state": run.state}
        emit({**head, "poses": run.rows, "results": run.results, EXPIRED: run.constants.get(EXPIRED)})
    else:
        mark = [f"Remark: {run.constants[EXPIRED]}."] if EXPIRED in run.constants else []
        after = next_steps(run, record.excluded(run.run))
        click.echo("\n".join([f"{run.run}: {run.state}, {run.extent}", *results_table(run.results), *mark, *after]))
    if outcome.error is not None:
        notes(outcome.moving)
        raise outcome.error
    notes(f"adc: {event.text}" for event in record.events(run.run) if event.what == SENSOR)
    if run.message:
        note(run.message)
    return int(bool(run.message) or any(result["verdict"] == "fail" for result in run.results.values()))
