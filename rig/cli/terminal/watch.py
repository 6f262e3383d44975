"""Observers of a run, guided in a terminal or unattended; and the message at its end."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import click

from calibrations.files import read_mapping
from procedures.catalogue import Procedure
from procedures.errors import BadAnswer
from procedures.questions import Question
from procedures.session import Guidance
from rig.bench import Bench
from rig.bench.certificates import EXPIRED
from rig.cli.terminal.output import emit, note, notes
from rig.record import KeptPose, Record
from rig.runs.background.control import PublishingObserver
from rig.runs.estimates import live_estimates
from rig.runs.host import SENSOR
from rig.runs.runner import Observer, Outcome
from rig.services.next_steps import next_steps, results_table

trace_option = click.option("--trace", is_flag=True, help="Log every message to and from instruments.")


class Quiet(Observer):
    """An unattended run. Answers come from the file, or from the simulated technician of a simulated bench.

    With the name of its procedure, standard error has the forecast of a soak after every reversal, and for other runs
    the result so far after every path.
    """

    place = "unattended"

    def __init__(self, answers: Mapping[str, str], procedure: str = "") -> None:
        self._answers, self._estimates = answers, live_estimates(procedure) if procedure else None

    def begun(self, run: str) -> None:
        note(f"run {run}")
        if self._estimates:
            self._estimates.begun(run)

    def guide(self, guidance: Guidance) -> None:
        note(guidance.text)

    def expect(self, total: int, recorded_poses: int) -> None:
        note(f"{total - recorded_poses} of {total} poses remain")

    def kept(self, recorded: KeptPose) -> None:
        if self._estimates and (report := self._estimates.report(recorded)):
            note(report)

    def ask(self, question: Question, instead: str | None) -> str:
        return super().ask(question, self._answers.get(question.name, instead))


@contextmanager
def watching(procedure: Procedure, bench: Bench, unattended: bool, answers: Path | None) -> Iterator[Observer]:
    """The observer of a run: a person in a terminal, or nobody for an unattended run; pages observe in parallel."""
    given_answers = _answers(answers)
    if unattended or not (sys.stdin.isatty() and sys.stderr.isatty()):
        with PublishingObserver(Quiet(given_answers, procedure.name), procedure.name, bench, "nobody") as observer:
            yield observer
        return
    from rig.cli.terminal.guide import Guide  # only a terminal needs rich

    with (
        Guide(procedure, bench, given_answers) as guide,
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
        step_lines = next_steps(run, record.excluded(run.run))
        click.echo(
            "\n".join([f"{run.run}: {run.state}, {run.extent}", *results_table(run.results), *mark, *step_lines])
        )
    if outcome.error is not None:
        notes(outcome.moving)
        raise outcome.error
    notes(f"adc: {event.text}" for event in record.events(run.run) if event.what == SENSOR)
    if run.message:
        note(run.message)
    return int(bool(run.message) or any(result["verdict"] == "fail" for result in run.results.values()))
