"""Ctrl-C, SIGTERM and a closed terminal end a run alike, at once and once."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stoppable() -> Iterator[None]:
    """Inside, the first signal raises KeyboardInterrupt with its name; further ones do not disturb the cleaning up."""

    def stop(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
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
