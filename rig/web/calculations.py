"""Calculations of a page: in a thread beside the event loop, and ended with the visit to the page."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextvars import copy_context
from functools import partial
from threading import Thread
from typing import ParamSpec, TypeVar
from weakref import WeakSet

from nicegui import ui

from calibrations.effects import Effect
from rig.services.search import Cancelled, Counted

P = ParamSpec("P")
R = TypeVar("R")

class Visit:
    """One visit to a page: analyses for it end when the page is closed. A run is a process of its own and goes on.

    Made while a page is built; ends after the time in which a lost browser may come back.
    """

    def __init__(self) -> None:
        self.closed = False
        self.search = Counted({})
        ui.context.client.on_delete(self.close)

    def searched(self, effects: Mapping[str, Effect]) -> Counted:
        """The effects for a search of this visit. Reading them raises Cancelled after the page is closed."""
        self.search = Counted(effects)
        self.search.cancelled = self.closed
        return self.search

    def check(self) -> None:
        """Call between the steps of an analysis. Raises Cancelled after the page is closed."""
        if self.closed:
            raise Cancelled

    def close(self) -> None:
        """End the analyses of this visit."""
        self.closed = self.search.cancelled = True


_CALCULATIONS = WeakSet[Thread]()


async def off_loop(call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Call in a thread, so that the page stays responsive. The server does not wait for the thread when it ends."""
    future = Future[R]()
    work = partial(copy_context().run, call, *args, **kwargs)
    thread = Thread(target=_settled, args=(future, work), name=call.__name__, daemon=True)
    _CALCULATIONS.add(thread)
    thread.start()
    return await asyncio.wrap_future(future)


def leave_calculations() -> None:
    """End the process at once, with status 0, if a calculation still runs.

    The interpreter would end its thread at the next line of Python; inside of C++ that aborts the whole process.
    """
    if any(thread.is_alive() for thread in _CALCULATIONS):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)


def _settled(future: Future[R], work: Callable[[], R]) -> None:
    """Set the result or the error of the work, even if no page waits for it."""
    if future.set_running_or_notify_cancel():
        try:
            result = work()
        except BaseException as error:
            future.set_exception(error)
        else:
            future.set_result(result)
