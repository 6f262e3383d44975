"""The process of its own: `python -m rig.apart.process ORDER` runs a procedure as `rig run` does, and tells of it."""

from __future__ import annotations

import json
import os
import select
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import Any, cast

from procedures.catalogue import find
from procedures.errors import BadAnswer
from procedures.questions import Choice, Confirm, Question
from procedures.session import Reading
from procedures.settings import parse
from rig.apart.order import Order, file
from rig.apart.status import Asked, Status, lock
from rig.bench import Bench, read_bench
from rig.drawings import drawing_of
from rig.errors import Stopped
from rig.home import home
from rig.lease import lease
from rig.planning.plan import Plan
from rig.record import Kept, Record
from rig.running.runner import Outcome, Wish, resume, start
from rig.running.seen import Sight, values

LONGEST = 4096  # bytes of an answer, which a pipe hands over in one piece
WISHES = Choice("interrupted", "What now?", choices=("resume", "repeat", "end"))


class Teller:
    """Looks on for whoever reads the status; asks through the pipe."""

    def __init__(self, order: Order, bench: Bench) -> None:
        self._order = order
        self._sight = Sight(order.procedure, bench)
        self._status = Status(order.key, os.getpid(), order.procedure, bench.name)
        self.tell()

    def tell(self, **changes: Any) -> None:
        """Say how it stands."""
        seen = self._sight.seen
        way, left = seen.way, seen.left(time.monotonic())
        self._status = replace(self._status, now=seen.now, done=way.done, total=way.total, left=left, **changes)
        self._status.write()

    def planned(self, plan: Plan) -> None:
        self._sight.planned(plan)

    def begun(self, run: str) -> None:
        self._sight.begun(run)
        self.tell(phase="running", run=run, error="", moving=())

    def doing(self, text: str) -> None:
        self._sight.doing(text)
        self.tell()

    def expect(self, total: int, done: int) -> None:
        self._sight.expect(total, done)
        self.tell()

    def kept(self, kept: Kept) -> None:
        self._sight.kept(kept)
        stands = ("alpha_deg", "beta_deg", "mount_deg", "flip")
        self.tell(values=self._values(), attitude={name: getattr(kept.pose, name) for name in stands})

    def read(self, reading: Reading) -> None:
        self._sight.read(reading)
        self.tell(values=self._values())

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
        drawn = drawing_of(question)
        yes_or_no = ("yes", "no") if isinstance(question, Confirm) else ()
        choices = question.choices if isinstance(question, Choice) else yes_or_no
        attitude = asdict(drawn) if drawn else None
        asked = Asked(question.name, question.text, question.accepts, choices, proposed, attitude=attitude)
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

    def _values(self) -> list[dict[str, Any]]:
        return [{**asdict(value), "near": value.near} for value in values(self._sight.seen)]


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
        teller = Teller(order, read_bench(order.bench_path))
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


def _carried_out(order: Order, record: Record, teller: Teller) -> Outcome:
    if order.resume:
        return resume(record, order.resume, teller)
    bench = read_bench(order.bench_path)
    procedure = find(order.procedure, bench.folders.procedures)
    return start(record, bench, procedure, parse(procedure, order.settings), teller)


if __name__ == "__main__":
    main(sys.argv[1])
