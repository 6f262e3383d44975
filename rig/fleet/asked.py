"""Questions to a fleet: what the record knows is not asked again, and what comes is kept before it is used.

Answers pass through: no more of them are held than a few chunks, whatever the fleet's size.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
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

CHUNK = {"look": 20, "diagnosis": 4}  # sensors of one task: about half a second's work
SLICE = 100  # sensors that the record is asked for at a time
KILLED = "its data kill the process that works on them; send them to a maintainer with `rig doctor`"
Tell = Callable[[int, int], None]


@dataclass(frozen=True)
class Fleet:
    """Workers, the record, and who hears how many of how many sensors are done."""

    client: Client
    record: Record
    tell: Tell

    def ask(self, asked: Sequence[tuple[Member, Question]]) -> Iterator[tuple[Member, Any]]:
        """Every member with its answer, about in the order asked; a `fault` in place of what could not be found."""
        known: list[tuple[Member, Any]] = []
        open_: dict[str, list[tuple[Member, Question]]] = {}
        chunks, done = self._chunks(asked, known, open_), 0
        for found in self._answers(chunks, open_):
            ready = [*known, *found]
            known.clear()
            yield from ready
            done += len(ready)
            if found:
                self.tell(done, len(asked))

    def _chunks(
        self,
        asked: Sequence[tuple[Member, Question]],
        known: list[tuple[Member, Any]],
        open_: dict[str, list[tuple[Member, Question]]],
    ) -> Iterator[list[Task]]:
        """Tasks of what is not in the record, which is added to `open_`, by chunks; what is there is added to `known`.

        A chunk is empty where so much is known that it had better be taken first.
        """
        tasks: list[Task] = []
        size = min((CHUNK[question.what] for _, question in asked), default=1)
        for first in range(0, len(asked), SLICE):
            part = asked[first : first + SLICE]
            keys = [key_of(member.digest, question) for member, question in part]
            there = kept(self.record, keys)
            known += [(member, there[key]) for key, (member, _) in zip(keys, part, strict=True) if key in there]
            if known:
                yield []
            for key, each in zip(keys, part, strict=True):
                if key in there:
                    continue
                if key not in open_:
                    tasks.append(self._task(key, *each))
                open_.setdefault(key, []).append(each)  # copies of a table are one question
                if len(tasks) == size:
                    yield tasks
                    tasks = []
        yield tasks

    def _answers(
        self, chunks: Iterator[list[Task]], open_: dict[str, list[tuple[Member, Question]]]
    ) -> Iterator[list[tuple[Member, Any]]]:
        """What the workers find, as it comes; nothing for an empty chunk."""
        for chunk in chunks:
            if chunk:
                break
            yield []
        else:
            return
        for tasks, found in answered(self.client, answer, chain([chunk], chunks)):
            pairs = found if found is not None else [(task.key, {"fault": KILLED}) for task in tasks]
            rows = [(key, *each, said) for key, said in pairs for each in open_.pop(key)]
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
