"""Signals: Ctrl-C, SIGTERM and a closed terminal stop a run in the same way. Also the trace of all messages."""

from __future__ import annotations

import signal
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Literal

from rig.record import Record

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
STOPPED_BY = {
    "SIGINT": "stopped by a person (SIGINT)",
    "SIGTERM": "stopped by another program (SIGTERM)",
    "SIGHUP": "stopped because its terminal was closed (SIGHUP)",
}
COMPILED = "drivers.world"  # its compiled code calls Python generators; an exception there would break it
# Between bytes and their count: the simulated clock would wait for bytes that have come already.
COUNTING = (("drivers.clock", "step"), ("drivers.transport.link", "put"), ("drivers.transport.link", "take"))
SCREEN = "rich"  # an exception while its console writes would block the console
AGAIN_S = 0.001


def who_stopped(name: str) -> str:
    """Who stopped a run, by the name of the signal; a person where it has none."""
    return STOPPED_BY[name or "SIGINT"]


@contextmanager
def stoppable(ignored: Collection[signal.Signals] = (), inner: bool = False) -> Iterator[None]:
    """Inside the context the first signal raises KeyboardInterrupt with its name. Later signals are ignored.

    `ignored` signals raise nothing. `inner`: the context lies in another one; after a SIGINT the next ones stay ignored
    there, because a person who presses twice wants one pause. A further context hears them again.

    A signal during a computation of the simulated world, a count of bytes or a write to the screen waits a moment. If
    Python discards the exception, as in a finaliser, it is raised again.
    """

    put_off: list[int] = []
    raised: list[int] = []
    fired: list[int] = []

    def later(number: int) -> None:
        put_off[:] = [number]
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S)  # not a thread: the interrupted code may hold its locks

    def stop(number: int, frame: FrameType | None) -> None:
        if _indivisible(frame):
            later(number)
            return
        for signal_number in SIGNALS:
            signal.signal(signal_number, signal.SIG_IGN)
        raised[:] = [number]
        fired.append(number)
        raise KeyboardInterrupt(signal.Signals(number).name)

    def again(_: int, frame: FrameType | None) -> None:
        if put_off:
            stop(put_off.pop(), frame)

    def lost(unraisable: sys.UnraisableHookArgs) -> None:
        if raised and isinstance(unraisable.exc_value, KeyboardInterrupt):
            later(raised.pop())
        else:
            hook(unraisable)

    hook, sys.unraisablehook = sys.unraisablehook, lost
    nohup = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # then a closed terminal must not stop the run
    handlers = {
        signal_number: signal.signal(signal_number, signal.SIG_IGN if signal_number in ignored else stop)
        for signal_number in SIGNALS
        if not (nohup and signal_number == signal.SIGHUP)
    }
    handlers[signal.SIGALRM] = signal.signal(signal.SIGALRM, again)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = hook
        if inner and signal.SIGINT in fired:
            handlers[signal.SIGINT] = signal.SIG_IGN
        for signal_number, handler in handlers.items():
            signal.signal(signal_number, handler)


def _indivisible(frame: FrameType | None) -> bool:
    """Whether an exception here would break the interrupted code."""
    while frame is not None:
        module = str(frame.f_globals.get("__name__"))
        if module.startswith(COMPILED) or (module, frame.f_code.co_name) in COUNTING:
            return True
        if module.partition(".")[0] == SCREEN:
            return frame.f_code.co_name != "input"  # here it waits for a person
        frame = frame.f_back
    return False


SHOWN_BYTES = 64  # of one message: of a stream packet, the header and the first samples


class Trace:
    """Writes every message to and from instruments into the log of the run, also messages before its begin."""

    def __init__(self, record: Record) -> None:
        self._record = record
        self._run = ""
        self._early: list[tuple[float, str, str, str]] = []

    def __call__(self, clock_s: float, wire: str, direction: Literal["sent", "heard"], data: bytes) -> None:
        line = (clock_s, wire, direction, message_text(data))
        if self._run:
            self._record.log(self._run, *line)
        else:
            self._early.append(line)

    def begin(self, run: str) -> None:
        """Write to the log of `run` from now on."""
        self._run = run
        for line in self._early:
            self._record.log(run, *line)
        self._early.clear()


def message_text(data: bytes) -> str:
    """A message as text if it is printable, else in hexadecimal. A long message is cut."""
    length_text = f" ... {len(data)} bytes" if len(data) > SHOWN_BYTES else ""
    begin = data[:SHOWN_BYTES]
    text = begin.decode("ascii", "replace")
    readable = all(character.isprintable() or character in "\r\n" for character in text) and "\ufffd" not in text
    return (repr(text) if readable else begin.hex(" ")) + length_text
