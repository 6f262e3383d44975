"""The process of its own: `python -m rig.apart.process ORDER` runs a procedure as `rig run` does, and tells of it."""

from __future__ import annotations

import json
import os
import select
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import cast

from procedures.catalogue import find
from procedures.errors import BadAnswer
from procedures.questions import Choice, Question
from procedures.settings import parse
from rig.apart.order import Order, file
from rig.apart.status import lock
from rig.apart.teller import Teller, asked_of
from rig.bench import Bench, read_bench
from rig.errors import Stopped
from rig.home import home
from rig.lease import lease
from rig.record import Record
from rig.record.catch_up import push_after
from rig.running.runner import Outcome, Wish, resume, start

LONGEST = 4096  # bytes of an answer, which a pipe hands over in one piece
WISHES = Choice("interrupted", "What now?", choices=("resume", "repeat", "end"))


class Attendant(Teller):
    """A teller that asks through the pipe."""

    def __init__(self, order: Order, bench: Bench) -> None:
        super().__init__(order.key, order.procedure, bench)
        self._order = order
        self.tell()

    def ask(self, question: Question, instead: str | None) -> str:
        """A person's answer; that of a simulated bench where nobody wants to be asked."""
        if instead is not None and not self._order.attended:
            return instead
        return self._answer(question, instead or "", "asking")

    def interrupted(self, outcome: Outcome) -> Wish:
        """All stands still until a person has said how it goes on."""
        by_a_person = isinstance(outcome.error, Stopped)
        self.tell(error="" if by_a_person else str(outcome.error), moving=outcome.moving)
        return cast(Wish, self._answer(WISHES, "resume", "paused"))

    def _answer(self, question: Question, proposed: str, phase: str) -> str:
        """Asked until the answer makes sense."""
        asked = asked_of(question, proposed)
        with _pipe(self._order.key) as heard:  # open before it is said that something is asked
            while True:
                self.tell(phase=phase, asked=asked)
                given = heard()
                try:
                    checked = question.checked(given["text"]) if given.get("name") == question.name else None
                except BadAnswer as refused:
                    asked = replace(asked, refused=str(refused))
                    continue
                if checked is not None:
                    self.tell(phase="running", asked=None)
                    return checked


@contextmanager
def _pipe(key: str) -> Iterator[Callable[[], Mapping[str, str]]]:
    """What gives the next answer: it waits until somebody writes one, and a signal interrupts it."""
    pipe = os.open(file(key, "answers"), os.O_RDONLY | os.O_NONBLOCK)

    def heard() -> Mapping[str, str]:
        select.select([pipe], [], [])
        try:
            document = json.loads(os.read(pipe, LONGEST))
        except ValueError:
            return {}
        return document if isinstance(document, dict) else {}

    try:
        yield heard
    finally:
        os.close(pipe)


def main(text: str) -> None:
    """Carry out an order; whatever happens, the status says how it ended."""
    order = Order.read(text)
    with lease(home(), lock(order.key), f"an order, {order.procedure}"), Record() as record:
        teller = Attendant(order, read_bench(order.bench_path))
        try:
            outcome = _carried_out(order, record, teller)
        except KeyboardInterrupt as signal:  # before the run began, or between its parts
            teller.tell(phase="ended", state="stopped", asked=None, error=f"stopped by {signal}")
            return
        except Exception as error:
            teller.tell(phase="ended", state="failed", asked=None, error=str(error))
            raise
        teller.tell(
            phase="ended",
            state=outcome.run.state,
            asked=None,
            error=str(outcome.error or outcome.run.message or ""),
            moving=outcome.moving,
        )
        push_after(record, outcome.run, Bench.model_validate(outcome.run.bench).lab, print)


def _carried_out(order: Order, record: Record, teller: Attendant) -> Outcome:
    if order.resume:
        return resume(record, order.resume, teller)
    bench = read_bench(order.bench_path)
    procedure = find(order.procedure, bench.folders.procedures)
    return start(record, bench, procedure, parse(procedure, order.settings), teller)


if __name__ == "__main__":
    main(sys.argv[1])
