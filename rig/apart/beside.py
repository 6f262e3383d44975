"""A run that was begun in a terminal, watched there, and told beside so that a page can look on."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from types import TracebackType
from typing import ParamSpec, Self

from procedures.questions import Question
from procedures.session import Reading
from rig.apart.order import new_key
from rig.apart.status import Seat, folder, lock, tidy
from rig.apart.teller import Teller, asked_of
from rig.bench import Bench
from rig.errors import RigError
from rig.home import home
from rig.lease import lease
from rig.planning.plan import Plan
from rig.record import Kept, Record
from rig.running.watch import Outcome, Watch, Wish

P = ParamSpec("P")


class Beside:
    """Hands all that it hears to `watch`, and tells of it as soon as there is a run.

    What cannot be told is let go: whether anybody looks on makes no difference to a run.
    """

    def __init__(self, watch: Watch, procedure: str, bench: Bench, seat: Seat) -> None:
        self._watch, self._procedure = watch, procedure
        self._key, self._run = new_key(), ""
        self._teller = Teller(self._key, procedure, bench, seat)
        self._held = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._run:
            with suppress(RigError, OSError):
                self._end()
        self._held.close()

    def planned(self, plan: Plan) -> None:
        self._watch.planned(plan)
        self._teller.planned(plan)

    def begun(self, run: str) -> None:
        if not self._run:
            with suppress(RigError, OSError):
                folder().mkdir(parents=True, exist_ok=True)
                tidy()
                self._held.enter_context(lease(home(), lock(self._key), f"an order, {self._procedure}"))
        self._run = run
        self._watch.begun(run)
        self._tell(self._teller.begun, run)

    def doing(self, text: str) -> None:
        self._watch.doing(text)
        self._tell(self._teller.doing, text)

    def expect(self, total: int, done: int) -> None:
        self._watch.expect(total, done)
        self._tell(self._teller.expect, total, done)

    def kept(self, kept: Kept) -> None:
        self._watch.kept(kept)
        self._tell(self._teller.kept, kept)

    def read(self, reading: Reading) -> None:
        self._watch.read(reading)
        self._tell(self._teller.read, reading)

    def ask(self, question: Question, instead: str | None) -> str:
        self._tell(self._teller.tell, phase="asking", asked=asked_of(question, instead or ""))
        given = self._watch.ask(question, instead)
        self._tell(self._teller.tell, phase="running", asked=None)
        return given

    def interrupted(self, outcome: Outcome) -> Wish:
        self._tell(self._teller.tell, phase="paused", error=str(outcome.error), moving=outcome.moving)
        return self._watch.interrupted(outcome)

    def _tell(self, what: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        if self._run:
            with suppress(RigError, OSError):
                what(*args, **kwargs)

    def _end(self) -> None:
        with Record() as record:
            run = record.run(self._run)
        self._teller.tell(phase="ended", state=run.state, asked=None, error=run.message or "")
