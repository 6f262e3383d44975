"""The history of a run: its events, and from its log each start, stop, resume and end."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from drivers.errors import Interlocked
from procedures.errors import Declined, NoAnswer, SafetyLimit
from rig.errors import Stopped
from rig.record.store import Record
from rig.record.values import Event, LogLine

STOPS = (Stopped, SafetyLimit, Interlocked, NoAnswer, Declined)  # errors that stop a run; others are failures
TURNS = ("begun", "error", "stopped", "complete")  # kinds of lines in the log
ENDS = ("stopped", "failed")  # events that end a part of a run
ANSWER = "answer "  # event: an answer of a person; the name of the question follows
QUESTION = "question"  # kind of the log's lines with the name of a question and its text
WITHOUT_END = "; before, its process was killed or the disk was full"
ERROR = re.compile(r"(\w+): (?:stopped )?(.*?)(?:; `rig resume [^`]*` continues the run)?", re.DOTALL)


def history(record: Record, run: str) -> list[Event]:
    """All events of `run` with its start, stops, resumes and end, in the order of time."""
    return sorted([*record.events(run), *_turns(record.lines(run, TURNS))], key=lambda event: event.at)


def interruptions(record: Record, run: str) -> str:
    """The stops and resumes of `run` with their times, as one line; "" for a run without any."""
    turns = [turn for turn in _turns(record.lines(run, TURNS)) if turn.what in (*ENDS, "resumed")]
    return "; ".join(f"{turn.at[:19]}Z {turn.what} {turn.text}" for turn in turns)


def _turns(lines: Iterable[LogLine]) -> list[Event]:
    """Starts, stops and ends. A stop has its reason, and whether all instruments are at rest."""
    turns: list[Event] = []
    for line in lines:
        previous = turns[-1].what if turns else ""
        if line.what == "begun" and turns:
            turns.append(Event(line.at, "resumed", line.text + ("" if previous in ENDS else WITHOUT_END)))
        elif line.what == "error":
            turns.append(_stop(line))
        elif line.what == "stopped" and previous in ENDS:
            turns[-1] = replace(turns[-1], text=f"{turns[-1].text}; {line.text}")
        else:
            turns.append(Event(line.at, line.what, line.text))
    return turns


def _stop(line: LogLine) -> Event:
    """A stop or a failure, without the name of the error and the command that continues the run."""
    parts = ERROR.fullmatch(line.text)
    if parts is None:
        return Event(line.at, "failed", line.text)
    is_stop = parts[1] in {error.__name__ for error in STOPS}
    return Event(line.at, "stopped" if is_stop else "failed", parts[2])
