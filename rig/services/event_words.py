"""Events of a run in the words of a page: the question of an answer, and the pose that a part of the run began at."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

from rig.record import Event, Record
from rig.record.history import ANSWER, QUESTION, history

AT_POSE = re.compile(r"^([\w-]+) at pose (\d+)")


def events_in_words(record: Record, run: str) -> list[Event]:
    """The history of `run` for a page."""
    logged = [line.text.partition(": ") for line in record.lines(run, (QUESTION,))]
    questions = {name: text for name, _, text in logged}
    return [in_words(event, questions) for event in history(record, run)]


def in_words(event: Event, questions: Mapping[str, str]) -> Event:
    """An event for a page. `questions`: their texts by name; the log of an older program has none."""
    if event.what.startswith(ANSWER):
        name = event.what.removeprefix(ANSWER)
        question = questions.get(name) or f"{name.replace('-', ' ')}:"
        return replace(event, what=ANSWER.strip(), text=f"{question} {_answer(event.text)}")
    if event.what in ("begun", "resumed"):
        return replace(event, text=AT_POSE.sub(_from_pose, event.text))
    return event


def _answer(text: str) -> str:
    """An answer; a number without the digits that only the record needs."""
    with suppress(ValueError):
        return f"{float(text) + 0.0:g}"
    return text


def _from_pose(match: re.Match[str]) -> str:
    """Poses count from 0 in the record."""
    count = int(match[2])
    return f"{match[1]} at the first pose" if not count else f"{match[1]} after {count} pose{'s' * (count > 1)}"
