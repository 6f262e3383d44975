"""Questions to a fleet. Answers in the record are not computed again; a new answer is stored before it is used.

Only a few chunks of answers are in memory at a time, for a fleet of any size.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

import calibrations
from calibrations.errors import DataError
from rig.files import RECORD, program
from rig.fleet.cluster import run_tasks
from rig.fleet.members import Member, content
from rig.fleet.worker import Question, Task, answer
from rig.record import Record
from rig.record.rows import timestamp
from rig.record.schema import answers, insert_or

if TYPE_CHECKING:
    from distributed import Client

# Answers about sensors in the rig's own record. Their key is made from the question and the data.

MOST = 500  # keys of one query


def key_of(digest: str, question: Question) -> str:
    """Key of an answer: a digest of data, question and program."""
    text = json.dumps([_program(), digest, asdict(question)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _program() -> str:
    """Digest of the library's and the fleet's code: the number of the version stays the same during development."""
    sha = hashlib.sha256(program().encode())
    for folder in (Path(calibrations.__file__).parent, Path(__file__).parent):
        for path in sorted(folder.rglob("*.py")):
            sha.update(path.read_bytes())
    return sha.hexdigest()


def keep(record: Record, answered_rows: Iterable[tuple[str, str, str, Mapping[str, Any]]]) -> None:
    """Store rows (key, sensor, data, answer) in one transaction; rows that exist do not change."""
    rows = [{"key": k, "sensor": s, "data": d, "at": timestamp(), "answer": dict(a)} for k, s, d, a in answered_rows]
    with record.engine.begin() as connection:
        if rows:
            connection.execute(insert_or(connection, answers).on_conflict_do_nothing(), rows)


def kept(record: Record, keys: Sequence[str]) -> dict[str, Any]:
    """The stored answers, by key."""
    stored: dict[str, Any] = {}
    with record.engine.connect() as connection:
        for first in range(0, len(keys), MOST):
            query = select(answers.c.key, answers.c.answer).where(answers.c.key.in_(keys[first : first + MOST]))
            stored |= {row.key: row.answer for row in connection.execute(query)}
    return stored


CHUNK = {"look": 20, "diagnosis": 4}  # sensors of one task: about half a second's work
SLICE = 100  # sensors in one query of the record
KILLED = "its data ends the worker process; send the data to a maintainer with `rig doctor`"
Tell = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Fleet:
    """The workers, the record, and the function that gets the present step, its finished sensors, and all of them."""

    client: Client
    record: Record
    tell: Tell

    def ask(self, questions: Sequence[tuple[Member, Question]], step: str) -> Generator[tuple[Member, Any], None, None]:
        """Every member with its answer or a `fault`, about in the order of `questions`; `step`: for the progress."""
        stored_answers: list[tuple[Member, Any]] = []
        open_: dict[str, list[tuple[Member, Question]]] = {}
        chunks, answered_count = self._chunks(questions, stored_answers, open_), 0
        if questions:
            self.tell(step, 0, len(questions))
        for new_answers in self._answers(chunks, open_):
            ready = [*stored_answers, *new_answers]
            stored_answers.clear()
            yield from ready
            answered_count += len(ready)
            if new_answers:
                self.tell(step, answered_count, len(questions))

    def _chunks(
        self,
        questions: Sequence[tuple[Member, Question]],
        stored_answers: list[tuple[Member, Any]],
        open_: dict[str, list[tuple[Member, Question]]],
    ) -> Iterator[list[Task]]:
        """Tasks for the questions without a stored answer, in chunks; these questions are added to `open_`.

        The answers in the record are added to `stored_answers`. An empty chunk means: use these answers first, to save
        memory.
        """
        tasks: list[Task] = []
        size = min((CHUNK[question.what] for _, question in questions), default=1)
        for first in range(0, len(questions), SLICE):
            part = questions[first : first + SLICE]
            keys = [key_of(member.digest, question) for member, question in part]
            stored = kept(self.record, keys)
            stored_answers += [
                (member, stored[key]) for key, (member, _) in zip(keys, part, strict=True) if key in stored
            ]
            if stored_answers:
                yield []
            for key, pair in zip(keys, part, strict=True):
                if key in stored:
                    continue
                if key not in open_:
                    tasks.append(self._task(key, *pair))
                open_.setdefault(key, []).append(pair)  # equal tables are one question
                if len(tasks) == size:
                    yield tasks
                    tasks = []
        yield tasks

    def _answers(
        self, chunks: Iterator[list[Task]], open_: dict[str, list[tuple[Member, Question]]]
    ) -> Iterator[list[tuple[Member, Any]]]:
        """The answers of the workers, in the order of completion; an empty list for an empty chunk."""
        for chunk in chunks:
            if chunk:
                break
            yield []
        else:
            return
        for tasks, results in run_tasks(self.client, answer, chain([chunk], chunks)):
            pairs = results if results is not None else [(task.key, {"fault": KILLED}) for task in tasks]
            rows = [(key, *pair, document) for key, document in pairs for pair in open_.pop(key)]
            keep(
                self.record,
                ((key, m.sensor, m.data, document) for key, m, _, document in rows if "fault" not in document),
            )
            yield [(member, document) for _, member, _, document in rows]

    def _task(self, key: str, member: Member, question: Question) -> Task:
        """The task with the text of the file, because the worker may be on another machine."""
        if member.run:
            of_lab = os.environ.get(RECORD)  # its URL, which may hold a password, is not sent: workers have their own
            return Task(key, member.data, question, home=None if of_lab else str(self.record.folder))
        try:
            return Task(key, member.data, question, text=content(member))
        except DataError:  # the file was removed after the listing: the worker reports it
            return Task(key, member.data, question, text="")
