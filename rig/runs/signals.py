"""Signals: Ctrl-C, SIGTERM and a closed terminal stop a run in the same way. Also the trace of all messages."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rig.record import Record

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
SIGNAL_SOURCES = {
    "SIGINT": "stopped by a person",
    "SIGTERM": "stopped by another program",
    "SIGHUP": "stopped because its terminal was closed",
}
ON_A_PAGE = "stopped on a page of the workbench"  # also by SIGINT or SIGTERM, with a mark beside the status file
COMPILED_PACKAGE = "drivers.world"  # its compiled code calls Python generators; an exception there would break it
# Between the arrival of bytes and their count: the simulated clock would wait for bytes that are there already.
COUNTERS = (("drivers.clock", "step"), ("drivers.transport.link", "put"), ("drivers.transport.link", "take"))
# Their code discards an exception, or could not be closed after one.
FLEET_STARTS = (("rig.fleet.cluster", "start_cluster"), ("rig.fleet.cluster", "start_client"))
SCREEN = "rich"  # an exception while its console writes would block the console
QUESTIONS = (("rich.console", "input"), ("rig.cli.terminal.guide", "get_input"))  # these wait for a person
AGAIN_S = 0.001
Handler = Callable[[int, FrameType | None], object]


def stop_source(name: str) -> str:
    """Who stopped a run, by the name of the signal; a person without a name."""
    return SIGNAL_SOURCES[name or "SIGINT"]


@contextmanager
def signal_handlers(handler: Handler, *numbers: signal.Signals) -> Iterator[None]:
    """Inside the context `handler` receives these signals."""
    earlier = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier_handler in earlier.items():
            signal.signal(number, earlier_handler)


@contextmanager
def stoppable(ignored: Collection[signal.Signals] = (), inner: bool = False) -> Iterator[None]:
    """Inside the context the first signal raises KeyboardInterrupt with its name. Later signals are ignored.

    `ignored` signals raise nothing. `inner`: the context lies in another one; after a SIGINT the next ones stay ignored
    there, because a person who presses twice wants one pause. A further context receives them again. Only the main
    thread receives signals: in another one, such as that of a page's computation, the context changes nothing.
    """
    if current_thread() is not main_thread():
        yield
        return
    interrupter = _Interrupter()
    hook, sys.unraisablehook = sys.unraisablehook, interrupter.recover
    nohup = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # then a closed terminal must not stop the run
    numbers = [number for number in SIGNALS if not (nohup and number == signal.SIGHUP)]
    handlers = {number: signal.getsignal(number) for number in (signal.SIGALRM, *numbers)}
    try:
        signal.signal(signal.SIGALRM, interrupter.stop_again)
        for number in numbers:  # within `try`: a signal may come before the last of them
            signal.signal(number, signal.SIG_IGN if number in ignored else interrupter.stop)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = hook
        if inner and signal.SIGINT in interrupter.fired:
            handlers[signal.SIGINT] = signal.SIG_IGN
        for number, handler in handlers.items():
            signal.signal(number, handler)


class _Interrupter:
    """Raises KeyboardInterrupt for the first signal, where an exception breaks nothing.

    A signal during a computation of the simulated world, a count of bytes, a write to the screen or the start of a
    fleet's workers waits a moment. If Python discards the exception, as in a finaliser, it is raised again.
    """

    def __init__(self) -> None:
        self.fired: list[int] = []  # the signals that have raised
        self._delayed: int | None = None  # waits for the timer
        self._raised: int | None = None  # its exception may be discarded
        self._hook = sys.unraisablehook

    def stop(self, number: int, frame: FrameType | None) -> None:
        """Raise KeyboardInterrupt, or delay the signal."""
        if _indivisible(frame):
            self._delay(number)
            return
        for signal_number in SIGNALS:
            signal.signal(signal_number, signal.SIG_IGN)
        self._delayed = None  # an earlier one that waits is the same stop: raised again, it would interrupt the stop
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        self._raised = number
        self.fired.append(number)
        raise KeyboardInterrupt(signal.Signals(number).name)

    def stop_again(self, _: int, frame: FrameType | None) -> None:
        """The timer: stop by the delayed signal."""
        if (number := self._delayed) is not None:
            self._delayed = None
            self.stop(number, frame)

    def recover(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Raise a discarded KeyboardInterrupt once more."""
        if self._raised is not None and isinstance(unraisable.exc_value, KeyboardInterrupt):
            number, self._raised = self._raised, None
            self._delay(number)
        else:
            self._hook(unraisable)

    def _delay(self, number: int) -> None:
        self._delayed = number
        # No thread: the interrupted code may hold its locks. The timer repeats: a wait that begins just after one
        # signal receives the next one.
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S, AGAIN_S)


def _indivisible(frame: FrameType | None) -> bool:
    """Whether an exception here would break the interrupted code."""
    for module, function in callers(frame):
        if (module, function) in QUESTIONS:
            return False
        if (module, function) in (*COUNTERS, *FLEET_STARTS):
            return True
        if module.startswith(COMPILED_PACKAGE) or module.partition(".")[0] == SCREEN:
            return True
    return False


def callers(frame: FrameType | None) -> Iterator[tuple[str, str]]:
    """The module and the name of the function of a frame, then those of its caller, and so on."""
    while frame is not None:
        yield str(frame.f_globals.get("__name__")), frame.f_code.co_name
        frame = frame.f_back


SHOWN_BYTES = 64  # of one message: of a stream packet, the header and the first samples


class Trace:
    """Writes every message to and from instruments into the log of the run, also messages before the run begins."""

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
