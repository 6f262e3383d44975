"""Questions to a fleet: what the record knows is not asked again, and what comes is kept before it is used."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from calibrations.errors import DataError
from rig.fleet.crew import answered
from rig.fleet.kept import keep, kept, key_of
from rig.fleet.members import Member, content
from rig.fleet.worker import Question, Task, answer
from rig.home import RECORD
from rig.record import Record

if TYPE_CHECKING:
    from distributed import Client

CHUNK = {"look": 20, "diagnosis": 4}  # sensors of one task: about a second's work
KILLED = "its data kill the process that works on them; send them to a maintainer with `rig doctor`"
Tell = Callable[[int, int], None]


@dataclass(frozen=True)
class Fleet:
    """Workers, the record, and who hears how many of how many sensors are done."""

    client: Client
    record: Record
    tell: Tell

    def ask(self, asked: Sequence[tuple[Member, Question]]) -> Iterator[tuple[Member, Any]]:
        """Every member with its answer, in any order; a `fault` in place of what could not be found."""
        keys = [key_of(member.digest, question) for member, question in asked]
        known = kept(self.record, keys)
        open_ = {key: each for key, each in zip(keys, asked, strict=True) if key not in known}
        for key, (member, _) in zip(keys, asked, strict=True):
            if key in known:
                yield member, known[key]
        done = len(asked) - len(open_)
        for found in self._new(open_) if open_ else ():
            done += len(found)
            self.tell(done, len(asked))
            yield from found

    def _new(self, asked: dict[str, tuple[Member, Question]]) -> Iterator[list[tuple[Member, Any]]]:
        size = min((CHUNK[question.what] for _, question in asked.values()), default=1)
        tasks = (self._task(key, *each) for key, each in asked.items())
        for chunk, found in answered(self.client, answer, tasks, size):
            pairs = found if found is not None else [(task.key, {"fault": KILLED}) for task in chunk]
            rows = [(key, *asked[key], said) for key, said in pairs]
            keep(self.record, ((key, m.sensor, m.data, said) for key, m, _, said in rows if "fault" not in said))
            yield [(member, said) for _, member, _, said in rows]

    def _task(self, key: str, member: Member, question: Question) -> Task:
        """With the text of its file, which the worker's machine need not have."""
        if member.run:
            of_lab = os.environ.get(RECORD)  # its URL, which may hold a password, is not sent: workers have their own
            return Task(key, member.data, question, home=None if of_lab else str(self.record.folder))
        try:
            return Task(key, member.data, question, text=content(member))
        except DataError:  # gone since it was listed: the worker's reading says so
            return Task(key, member.data, question, text="")
