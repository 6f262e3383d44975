"""The progress of a long analysis, for a terminal or a page that shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_SHOW: ContextVar[Callable[[str], None] | None] = ContextVar("show", default=None)


def report(text: str) -> None:
    """Report the present step of an analysis, if something shows it."""
    if (show := _SHOW.get()) is not None:
        show(text)


@contextmanager
def show_progress(show: Callable[[str], None]) -> Iterator[None]:
    """Call `show` with the present step of the analyses in this block, also in threads that copy its context."""
    before = _SHOW.set(show)
    try:
        yield
    finally:
        _SHOW.reset(before)
