"""Ctrl-C, SIGTERM and a closed terminal end a run alike, at once and once."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
COMPILED = "drivers.simulation"  # its compiled code calls Python for its generators, and cannot bear an exception there
SCREEN = "rich"  # left in the middle of writing, its console never writes again
AGAIN_S = 0.001


@contextmanager
def stoppable() -> Iterator[None]:
    """Inside, the first signal raises KeyboardInterrupt with its name; further ones do not disturb the cleaning up.

    One that comes while the simulated world is computed or the screen is written waits for an instant. One that is
    raised where Python cannot hand it on, as in what is called when rubbish is collected, is raised again.
    """

    put_off: list[int] = []
    raised: list[int] = []

    def later(number: int) -> None:
        put_off[:] = [number]
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S)  # no thread: what it needs may be held where this interrupts

    def stop(number: int, frame: FrameType | None) -> None:
        if _indivisible(frame):
            later(number)
            return
        for each in SIGNALS:
            signal.signal(each, signal.SIG_IGN)
        raised[:] = [number]
        raise KeyboardInterrupt(signal.Signals(number).name)

    def again(_: int, frame: FrameType | None) -> None:
        if put_off:
            stop(put_off.pop(), frame)

    def lost(what: sys.UnraisableHookArgs) -> None:
        if raised and isinstance(what.exc_value, KeyboardInterrupt):
            later(raised.pop())
        else:
            hook(what)

    hook, sys.unraisablehook = sys.unraisablehook, lost
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # by nohup: a closed terminal shall not end it
    before = {each: signal.signal(each, stop) for each in SIGNALS if not (ignored and each == signal.SIGHUP)}
    before[signal.SIGALRM] = signal.signal(signal.SIGALRM, again)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = hook
        for each, handler in before.items():
            signal.signal(each, handler)


def _indivisible(frame: FrameType | None) -> bool:
    """Whether code is under way that an exception would break."""
    while frame is not None:
        module = str(frame.f_globals.get("__name__"))
        if module.startswith(COMPILED):
            return True
        if module.partition(".")[0] == SCREEN:
            return frame.f_code.co_name != "input"  # where it waits for a person
        frame = frame.f_back
    return False
