"""Answers about sensors in the rig's own record: kept as they come, and found again by what was asked of which data."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from sqlalchemy import select

import calibrations
from rig.analysis.provenance import program
from rig.fleet.worker import Question
from rig.record import Record
from rig.record.dialects import insert_or
from rig.record.schema import answers
from rig.record.store import now

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
