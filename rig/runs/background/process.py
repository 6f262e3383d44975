"""The background process: `python -m rig.runs.background.process ORDER` runs a procedure as `rig run` does."""

from __future__ import annotations

import atexit
import gc
import json
import os
import select
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from typing import cast

from procedures.catalogue import find
from procedures.errors import BadAnswer
from procedures.questions import Question
from procedures.settings import parse
from rig.bench import Bench
from rig.errors import Stopped
from rig.files import home
from rig.lease import lease
from rig.record import Record
from rig.record.push import push_after
from rig.runs.background.status import Order, StatusWriter, file, lock, open_question
from rig.runs.observer import NEXT_STEP
from rig.runs.runner import Decision, Outcome, resume, start

PAUSE = signal.SIGINT  # by which a page pauses a run
LONGEST = 4096  # bytes of an answer, which a pipe hands over in one piece


class Attendant(StatusWriter):
    """The observer of a background run, which asks through a pipe. A second request for a pause changes nothing."""

    ignored_when_paused = (PAUSE,)
    place = "on a page of the workbench"

    def __init__(self, order: Order, bench: Bench) -> None:
        super().__init__(order.key, order.procedure, bench)
        self._order = order
        self.publish(attended=order.attended)

    def ask(self, question: Question, instead: str | None) -> str:
        """The answer of a person, or of the simulated technician in an unattended run."""
        if question.name in self._order.answers:
            return self._order.answers[question.name]
        if instead is not None and not self._order.attended:
            return instead
        return self._answer(question, instead or "", "asking")

    def interrupted(self, outcome: Outcome) -> Decision:
        """Wait at rest for the decision of a person."""
        reason = "" if isinstance(outcome.error, Stopped) else str(outcome.error)
        if outcome.retried:  # else the page would look as before the click on Continue
            reason = f"continuing failed at {datetime.now(UTC):%H:%M:%S} UTC: {reason}"
        self.publish(error=reason, moving=outcome.moving)
        return cast(Decision, self._answer(NEXT_STEP, "resume", "paused"))

    def _answer(self, question: Question, proposed: str, phase: str) -> str:
        """Ask until the question accepts the answer."""
        question_shown = open_question(question, proposed)
        with _pipe(self._order.key) as receive:  # open before the status shows the question
            while True:
                self.publish(phase=phase, asked=question_shown)
                message = receive()
                try:
                    checked = question.checked(message["text"]) if message.get("name") == question.name else None
                except BadAnswer as error:
                    question_shown = replace(question_shown, refused=error.beside, typed=message["text"])
                    continue
                if checked is not None:
                    self.publish(phase="running", asked=None)
                    return checked


@contextmanager
def _pipe(key: str) -> Iterator[Callable[[], Mapping[str, str]]]:
    """A function that waits for the next answer; a signal interrupts it."""
    pipe = os.open(file(key, "answers"), os.O_RDONLY | os.O_NONBLOCK)

    def wait_for_answer() -> Mapping[str, str]:
        select.select([pipe], [], [])
        try:
            document, _ = json.JSONDecoder().raw_decode(os.read(pipe, LONGEST).decode())  # the first of several
        except ValueError:
            return {}
        return document if isinstance(document, dict) else {}

    try:
        yield wait_for_answer
    finally:
        os.close(pipe)


def main(text: str) -> None:
    """Execute an order. The status has its end in any case."""
    order = Order.read(text)
    with lease(home(), lock(order.key), f"an order, {order.procedure}"), Record() as record:
        writer = Attendant(order, order.bench())
        try:
            outcome = _carry_out(order, record, writer)
        except KeyboardInterrupt as stop:  # before the run began, or between its parts
            writer.publish(phase="ended", state="stopped", asked=None, error=writer.stop_source(str(stop)))
            return
        except Exception as error:
            writer.publish(phase="ended", state="failed", asked=None, error=str(error))
            raise
        writer.ended(outcome.run, str(outcome.error or outcome.run.message or ""), moving=outcome.moving)
        push_after(record, outcome.run, Bench.model_validate(outcome.run.bench).lab, print)


def _carry_out(order: Order, record: Record, writer: Attendant) -> Outcome:
    if order.resume:
        return resume(record, order.resume, writer)
    bench = order.bench()
    procedure = find(order.procedure, bench.folders.procedures)
    return start(record, bench, procedure, parse(procedure, order.settings), writer)


if __name__ == "__main__":
    atexit.register(gc.freeze)  # as in `rig.cli.main`
    main(sys.argv[1])
