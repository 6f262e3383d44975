"""Questions to a fleet: what the record knows is not asked again, and what comes is kept before it is used.

Answers pass through: no more of them are held than a few chunks, whatever the fleet's size.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

import calibrations
from calibrations.errors import DataError
from rig.files import RECORD, program
from rig.fleet.crew import answered
from rig.fleet.members import Member, content
from rig.fleet.worker import Question, Task, answer
from rig.record import Record
from rig.record.schema import answers, insert_or
from rig.record.store import now

if TYPE_CHECKING:
    from distributed import Client

# Answers about sensors in the rig's own record: kept as they come, and found again by what was asked of which data.

MOST = 500  # keys of one query


def key_of(digest: str, question: Question) -> str:
    """The same for the same data, question and program."""
    asked = json.dumps([_program(), digest, asdict(question)], sort_keys=True)
    return hashlib.sha256(asked.encode()).hexdigest()


@cache
def _program() -> str:
    """Digest of the library's and the fleet's code: a version's number stays while a program is being changed."""
    sha = hashlib.sha256(program().encode())
    for folder in (Path(calibrations.__file__).parent, Path(__file__).parent):
        for path in sorted(folder.rglob("*.py")):
            sha.update(path.read_bytes())
    return sha.hexdigest()


def keep(record: Record, found: Iterable[tuple[str, str, str, Mapping[str, Any]]]) -> None:
    """(key, sensor, data, answer) each, in one transaction; one that is there stays."""
    rows = [{"key": k, "sensor": s, "data": d, "at": now(), "answer": dict(a)} for k, s, d, a in found]
    with record.engine.begin() as to:
        if rows:
            to.execute(insert_or(to, answers).on_conflict_do_nothing(), rows)


def kept(record: Record, keys: Sequence[str]) -> dict[str, Any]:
    """The answers that are there, by key."""
    found: dict[str, Any] = {}
    with record.engine.connect() as at:
        for first in range(0, len(keys), MOST):
            query = select(answers.c.key, answers.c.answer).where(answers.c.key.in_(keys[first : first + MOST]))
            found |= {row.key: row.answer for row in at.execute(query)}
    return found


CHUNK = {"look": 20, "diagnosis": 4}  # sensors of one task: about half a second's work
SLICE = 100  # sensors that the record is asked for at a time
KILLED = "its data ends the worker process; send the data to a maintainer with `rig doctor`"
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
