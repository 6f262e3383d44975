"""Pictures of a page drawn on two cores: in this process, and in a second one that waits for the next page.

A second thread would not help: matplotlib holds the interpreter while it draws. The second process ends with its input,
so that it never outlives the first. Without it the first process draws all pictures.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from threading import Lock, Thread
from typing import BinaryIO

from calibrations.presentation.chart import Picture
from calibrations.presentation.static import drawn, inline, remember

Waiting = deque[tuple[bytes, Picture]]  # the pickled arguments of `inline`, and their picture
PROCESS = (sys.executable, "-m", "calibrations.presentation.second_core")


@dataclass
class SecondCore:
    """The second process. Threads may share it: it draws for one page at a time."""

    command: Sequence[str] = PROCESS
    _process: subprocess.Popen[bytes] | None = None
    _lock: Lock = field(default_factory=Lock)
    _ahead: Waiting = field(default_factory=deque)

    def start(self) -> None:
        """Start the process, if it does not run: it loads matplotlib while the charts are computed."""
        if not self._lock.acquire(blocking=False):
            return  # it draws for another page
        try:
            if self._process is not None and self._process.poll() is not None:
                self._end()
            if self._process is None:
                with suppress(OSError):  # too little memory for a second process
                    self._process = subprocess.Popen(  # noqa: S603 our own command
                        self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
                    )
        finally:
            self._lock.release()

    def draw(self, pictures: Sequence[Picture]) -> None:
        """Draw the pictures, so that their page finds them in memory."""
        self._ahead.clear()
        waiting = _undrawn(pictures)
        helper = Thread(target=self._draw_beside, args=(waiting,), daemon=True)
        helper.start()
        try:
            while following := _next(waiting):
                picture = following[1]
                inline(picture.chart, picture.name, picture.words)
        finally:
            waiting.clear()  # if the page was left
        helper.join()

    def draw_ahead(self, pictures: Sequence[Picture]) -> Thread:
        """Let the second process alone draw pictures that a page may soon need, in a thread that is returned.

        It leaves the rest as soon as a page needs pictures, or others are to be drawn ahead.
        """
        self._ahead.clear()
        self._ahead.extend(_undrawn(pictures))
        helper = Thread(target=self._draw_beside, args=(self._ahead,), daemon=True)
        helper.start()
        return helper

    def _draw_beside(self, waiting: Waiting) -> None:
        """Let the second process draw pictures as long as some wait."""
        with self._lock:
            process = self._process
            if process is None or process.stdin is None or process.stdout is None:
                return
            while following := _next(waiting):
                content = following[0]
                try:
                    process.stdin.write(content)
                    process.stdin.flush()
                    remember(content, pickle.load(process.stdout))  # noqa: S301 from our own process
                except (OSError, EOFError, pickle.UnpicklingError):  # it has ended
                    waiting.append(following)
                    self._end()
                    return

    def stop(self) -> None:
        """End the process, also while it draws."""
        if (process := self._process) is not None:
            process.kill()
        with self._lock:
            self._end()

    def _end(self) -> None:
        if self._process is not None:
            with self._process as process:
                process.kill()
            self._process = None


def _undrawn(pictures: Sequence[Picture]) -> Waiting:
    """Those of the pictures that are not in memory."""
    contents = ((pickle.dumps((picture.chart, picture.name, picture.words)), picture) for picture in pictures)
    return deque((content, picture) for content, picture in contents if drawn(content) is None)


def _next(waiting: Waiting) -> tuple[bytes, Picture] | None:
    """The next of the waiting pictures; two threads never get the same."""
    try:
        return waiting.popleft()
    except IndexError:
        return None


def serve(source: BinaryIO, target: BinaryIO) -> None:
    """Draw the pictures that come from `source` until its end."""
    with suppress(EOFError, BrokenPipeError):
        while True:
            chart, name, words = pickle.load(source)  # noqa: S301 from the first process
            pickle.dump(inline(chart, name, words), target)
            target.flush()


if __name__ == "__main__":
    serve(sys.stdin.buffer, sys.stdout.buffer)
