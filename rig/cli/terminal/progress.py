"""Progress of work that takes longer than a second, on standard error.

In a terminal: one line that is written again every second and then removed. In a pipe or a file, which keeps all lines:
a line in each second in which the work has changed, and otherwise one every ten seconds, so that a reader sees that the
work goes on.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from calibrations.effects import Effect
    from rig.services.search import CountedEffects

EVERY_S = 1.0
UNCHANGED_S = 10  # in a pipe or a file, between two lines about the same work
WIDTH = 30  # characters of a bar
ERASE = "\r\x1b[K"


@dataclass
class Progress:
    """The present work, and the share of it that is done (0 to 1; None: not known). Assign to both at any time."""

    text: str | Callable[[], str]
    share: float | None = None
    began_s: float = field(default_factory=time.monotonic)
    search: CountedEffects | None = None
    at_end: ExitStack = field(default_factory=ExitStack)  # what ends with the work

    @property
    def state(self) -> tuple[str, str]:
        """The bar with the share, "" where it is not known, and the work, both as text."""
        text = self.text if isinstance(self.text, str) else self.text()
        if self.share is None:
            return "", text
        filled = round(WIDTH * min(max(self.share, 0.0), 1.0))
        return f"[{'#' * filled}{'.' * (WIDTH - filled)}] {100 * self.share:3.0f} %", text

    def line(self) -> str:
        """The present state and the time in one line."""
        seconds = f"{time.monotonic() - self.began_s:.0f} s"
        bar, text = self.state
        return f"{bar}  {text}, {seconds}" if bar else f"{text}: {seconds}"

    def searched(self, effects: Mapping[str, Effect]) -> Mapping[str, Effect]:
        """The effects for a search, whose progress is shown from now on."""
        from calibrations.progress import show_progress  # `rig --help` loads no calibrations
        from rig.services.search import CountedEffects

        self.search = counted = CountedEffects(effects)
        self.at_end.enter_context(show_progress(self.show))
        self.text = lambda: f"searching for missing effects. {counted.text}"
        return counted

    def show(self, doing: str) -> None:
        """Show what a search does now."""
        if self.search is not None:
            self.search.doing = doing


@contextmanager
def working(text: str, share: float | None = None) -> Iterator[Progress]:
    """Show the progress of the block from its first second on. Shorter work shows nothing."""
    progress, stream, stop_event = Progress(text, share), sys.stderr, threading.Event()
    thread = threading.Thread(target=_show, args=(progress, stream, stream.isatty(), stop_event), daemon=True)
    thread.start()
    try:
        with progress.at_end:
            yield progress
    finally:
        stop_event.set()
        thread.join()
        erase()


def erase() -> None:
    """Remove the line of the progress from the terminal, before something else is written there."""
    if _DRAWN.is_set():
        _DRAWN.clear()
        sys.stderr.write(ERASE)
        sys.stderr.flush()


_DRAWN = threading.Event()  # a line of progress is on the terminal


def _show(progress: Progress, stream: TextIO, terminal: bool, stop_event: threading.Event) -> None:
    written, unchanged_s = ("", ""), 0
    while not stop_event.wait(EVERY_S):
        unchanged_s += 1
        state = progress.state
        if not terminal and state == written and unchanged_s < UNCHANGED_S:
            continue
        written, unchanged_s = state, 0
        stream.write(f"{ERASE}{progress.line()}" if terminal else f"{progress.line()}\n")
        stream.flush()
        if terminal:
            _DRAWN.set()
