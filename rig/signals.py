"""Ctrl-C, SIGTERM and a closed terminal end a run alike, at once and once."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
COMPILED = "drivers.simulation"  # its compiled code calls Python for its generators, and cannot bear an exception there
AGAIN_S = 0.001


@contextmanager
def stoppable() -> Iterator[None]:
    """Inside, the first signal raises KeyboardInterrupt with its name; further ones do not disturb the cleaning up.

    One that comes while the simulated world is being computed waits for an instant; a real rig has no such wait.
    """

    def stop(number: int, frame: FrameType | None) -> None:
        if _computing(frame):
            Timer(AGAIN_S, signal.raise_signal, (number,)).start()
            return
        for each in SIGNALS:
            signal.signal(each, signal.SIG_IGN)
        raise KeyboardInterrupt(signal.Signals(number).name)

    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # by nohup: a closed terminal shall not end it
    before = {each: signal.signal(each, stop) for each in SIGNALS if not (ignored and each == signal.SIGHUP)}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _computing(frame: FrameType | None) -> bool:
    """Whether the simulated world's code is under way."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(COMPILED):
            return True
        frame = frame.f_back
    return False
