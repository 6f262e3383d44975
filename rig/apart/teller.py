"""Writes how a run stands into its status, as its watch hears it: for whoever looks on from another process."""

from __future__ import annotations

import os
import time
from dataclasses import asdict, replace
from typing import Any

from procedures.questions import Choice, Confirm, Question
from procedures.session import Reading
from rig.apart.status import Asked, Seat, Status
from rig.bench import Bench
from rig.drawings import drawing_of
from rig.planning.plan import Plan
from rig.record import Kept
from rig.running.seen import Sight, values


class Teller:
    """A watch without its questions. `seat`: where the person sits who is asked."""

    def __init__(self, key: str, procedure: str, bench: Bench, seat: Seat = "page") -> None:
        self._sight = Sight(procedure, bench)
        self._status = Status(key, os.getpid(), procedure, bench.name, seat=seat)

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

    def _values(self) -> list[dict[str, Any]]:
        return [{**asdict(value), "near": value.near} for value in values(self._sight.seen)]


def asked_of(question: Question, proposed: str) -> Asked:
    """A question as the status has it."""
    drawn = drawing_of(question)
    yes_or_no = ("yes", "no") if isinstance(question, Confirm) else ()
    choices = question.choices if isinstance(question, Choice) else yes_or_no
    attitude = asdict(drawn) if drawn else None
    return Asked(question.name, question.text, question.accepts, choices, proposed, attitude=attitude)
