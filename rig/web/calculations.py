"""Calculations of a page: in a thread of their own, which ends with the visit to the page."""

from __future__ import annotations

import asyncio
import ctypes
import os
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from threading import Event, Thread
from typing import Any, Generic, ParamSpec, TypeVar
from weakref import WeakSet

from nicegui import ui

from calibrations.effects import Effect
from calibrations.progress import show_progress
from rig.runs.signals import callers
from rig.services.search import Cancelled, CountedEffects

P = ParamSpec("P")
R = TypeVar("R")

# The compiler and the import of modules: an exception there would leave a lock locked for ever, or be discarded.
INDIVISIBLE = {"numba", "llvmlite", "importlib"}
LATER_S = 0.01


class Visit:
    """One visit to a page: analyses for it end when the page is closed. A run is a process of its own and goes on.

    `doing` says what the present analysis does.

    Made while a page is built; ends after the time in which a lost browser may come back.
    """

    def __init__(self) -> None:
        self.closed = False
        self.search = CountedEffects({})
        self.calculations: list[Calculation[Any]] = []
        self.doing = ""
        ui.context.client.on_delete(self.close)

    def searched(self, effects: Mapping[str, Effect]) -> CountedEffects:
        """The effects for a search of this visit. Reading them raises Cancelled after the page is closed."""
        self.search = CountedEffects(effects)
        self.search.cancelled = self.closed
        return self.search

    def check(self) -> None:
        """Call between the steps of an analysis. Raises Cancelled after the page is closed."""
        if self.closed:
            raise Cancelled

    async def work(self, call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Call in a thread that ends with the visit. Raises Cancelled at its end, and what `call` raises."""
        self.check()
        with show_progress(self._show):
            calculation = begin(call, *args, **kwargs)
        self.calculations.append(calculation)
        try:
            return await asyncio.wrap_future(calculation.future)
        finally:
            self.calculations.remove(calculation)

    def _show(self, doing: str) -> None:
        self.doing = self.search.doing = doing

    def cancel(self) -> None:
        """Cancel the present analyses of this visit; it may start others."""
        self.search.cancelled = True
        for calculation in self.calculations:
            calculation.cancel()

    def close(self) -> None:
        """End the analyses of this visit."""
        self.closed = True
        self.cancel()


_CALCULATIONS = WeakSet[Thread]()


@dataclass(frozen=True)
class Calculation(Generic[R]):
    """Work in a thread, and its result."""

    thread: Thread
    future: Future[R]
    is_cancelled: Event

    def cancel(self) -> None:
        """Raise Cancelled in the thread at its next line of Python, after the compilation or import in which it is."""
        if not self.future.done():
            self.is_cancelled.set()
        if not self._interrupt():
            Thread(target=self._interrupt_later, name="cancellation", daemon=True).start()

    def _interrupt(self) -> bool:
        """Raise Cancelled in the thread; False if it is where an exception would break the code of others."""
        number = self.thread.ident
        if self.future.done() or number is None:
            return True
        modules = {module.partition(".")[0] for module, _ in callers(sys._current_frames().get(number))}
        if not modules.isdisjoint(INDIVISIBLE):
            return False
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(number), ctypes.py_object(Cancelled))
        return True

    def _interrupt_later(self) -> None:
        while not self._interrupt():
            wait([self.future], LATER_S)


def begin(call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> Calculation[R]:
    """Call in a thread. The server does not wait for the thread when it ends."""
    future, is_cancelled = Future[R](), Event()
    work = partial(copy_context().run, call, *args, **kwargs)
    thread = Thread(target=_settle, args=(future, work, is_cancelled), name=call.__name__, daemon=True)
    _CALCULATIONS.add(thread)
    thread.start()
    return Calculation(thread, future, is_cancelled)


async def off_loop(call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Call in a thread, so that the page stays responsive.

    Raises what `call` raises, and asyncio.CancelledError if the page was closed meanwhile: nobody sees the rest.
    """
    client = ui.context.client if ui.context.slot_stack else None  # none in a task of asyncio.gather
    try:
        return await asyncio.wrap_future(begin(call, *args, **kwargs).future)
    finally:
        if client is not None and client.is_deleted:
            raise asyncio.CancelledError


def leave_calculations() -> None:
    """End the process at once, with status 0, if a calculation still runs.

    The interpreter would end its thread at the next line of Python; inside of C++ that aborts the whole process.
    """
    if any(thread.is_alive() for thread in _CALCULATIONS):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)


def _settle(future: Future[R], work: Callable[[], R], is_cancelled: Event) -> None:
    """Set the result or the error of the work, even if no page waits for it.

    Compiled code makes a SystemError of a cancellation that comes while it is called.
    """
    try:
        if future.set_running_or_notify_cancel():
            try:
                result = work()
            except BaseException as error:
                future.set_exception(Cancelled() if is_cancelled.is_set() else error)
            else:
                future.set_result(result)
    except Cancelled as cancellation:  # it came after the end of the work
        if not future.done():
            future.set_exception(cancellation)
