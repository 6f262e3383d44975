"""Every message to and from instruments, as lines of a run's log."""

from __future__ import annotations

from typing import Literal

from rig.record import Record

SHOWN_BYTES = 64  # of one message: of a stream's, the header and the first samples


class Trace:
    """A tap on the wires. What is said before the run has begun is part of its log, too."""

    def __init__(self, record: Record) -> None:
        self._record = record
        self._run = ""
        self._early: list[tuple[float, str, str, str]] = []

    def __call__(self, clock_s: float, wire: str, way: Literal["sent", "heard"], data: bytes) -> None:
        line = (clock_s, wire, way, shown(data))
        if self._run:
            self._record.log(self._run, *line)
        else:
            self._early.append(line)

    def begin(self, run: str) -> None:
        """From now on it is the log of `run`."""
        self._run = run
        for line in self._early:
            self._record.log(run, *line)
        self._early.clear()


def shown(data: bytes) -> str:
    """A message as text where it is some, else in hexadecimal; a long one by its beginning and length."""
    rest = f" ... {len(data)} bytes" if len(data) > SHOWN_BYTES else ""
    begin = data[:SHOWN_BYTES]
    text = begin.decode("ascii", "replace")
    readable = all(character.isprintable() or character in "\r\n" for character in text) and "\ufffd" not in text
    return (repr(text) if readable else begin.hex(" ")) + rest
