"""How far a search through the catalogue is, as seen by the effects that it asks for; and its end before its time."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from threading import Thread
from typing import Any, ParamSpec, TypeVar

from nicegui import ui
from nicegui.element import Element

from calibrations.effects import Effect
from calibrations.errors import CalibrationError
from drivers.errors import DriverError
from procedures.errors import ProcedureError
from rig.errors import RigError


class Cancelled(Exception):
    """Nobody waits for the answer any more."""


class Counted(Mapping[str, Effect]):
    """The same effects. A search goes through them in rounds; `round` is the present one, `at` how far it is."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = effects
        self.round, self.at, self.now = 0, 0, ""
        self.cancelled = False

    def __getitem__(self, name: str) -> Effect:
        """Raises Cancelled."""
        if self.cancelled:
            raise Cancelled
        return self._effects[name]

    def __len__(self) -> int:
        return len(self._effects)

    def __iter__(self) -> Iterator[str]:
        self.round += 1
        for at, name in enumerate(self._effects):
            self.at, self.now = at, name
            yield name
        self.at = len(self)

    @property
    def share(self) -> float:
        """Of the present round."""
        return self.at / len(self)

    @property
    def told(self) -> str:
        """For people."""
        if not self.round:
            return "Fitting the model"
        if self.at == len(self):
            return f"Round {self.round}: weighing what was tried"
        return f"Round {self.round}, effect {self.at + 1} of {len(self)}: {self.now}"


# Small parts that pages are made of: boxes, and the states of having nothing, waiting, and having failed.

# A cell of a sorted table: it leads to the row's `to`, where there is one.
LINKED = """<q-td :props="props">
  <a v-if="props.row.to" :href="props.row.to" @click.stop>{{ props.value }}</a><span v-else>{{ props.value }}</span>
</q-td>"""
P = ParamSpec("P")
R = TypeVar("R")


def box(classes: str = "") -> Element:
    """A sheet of paper on the page."""
    return ui.element("section").classes(f"box {classes}")


def div(classes: str) -> Element:
    """A plain container."""
    return ui.element("div").classes(classes)


def words(text: str, classes: str = "") -> ui.label:
    """A line of text."""
    return ui.label(text).classes(classes)


@contextmanager
def state(title: str, why: str = "", kind: str = "") -> Iterator[None]:
    """A box in place of what is not there, which says what to do; inside, what to press."""
    with box(f"state {kind}").props("role=status"):
        words(title, "title")
        if why:
            words(why, "why quiet")
        with div("row-of"):
            yield


def waiting(text: str) -> ui.label:
    """Something is on its way; the label may be told how far."""
    with div("row-of").props("role=status"):
        ui.spinner(size="1.4em")
        return words(text, "quiet")


def failed(title: str, why: str) -> None:
    """An error state."""
    with box("error").props("role=alert"):
        words(title, "title")
        words(why, "why quiet").style("white-space: pre-wrap")


def facts(rows: Mapping[str, str]) -> None:
    """Names and what they are, in two columns."""
    with div("facts"):
        for name, value in rows.items():
            words(name, "k")
            words(value)


@dataclass(frozen=True)
class Link:
    """A cell that leads somewhere."""

    text: str
    to: str


def table(head: tuple[str, ...], rows: Sequence[tuple[str | Link, ...]]) -> None:
    """A plain table of text and links."""
    with ui.element("table").classes("plain-table"):
        with ui.element("tr"):
            for name in head:
                with ui.element("th"):
                    words(name)
        for row in rows:
            with ui.element("tr"):
                for cell in row:
                    with ui.element("td"):
                        ui.link(cell.text, cell.to) if isinstance(cell, Link) else words(cell)


def redraw(plot: ui.plotly, figure: dict[str, Any]) -> None:
    """A picture that stays as it is keeps its zoom, and a box that is being drawn in it."""
    if figure != plot.figure:
        plot.update_figure(figure)


async def off_loop(call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """What takes long, in a thread: the page stays alive. A server that is to end does not wait for it."""
    future = Future[R]()
    work = partial(copy_context().run, call, *args, **kwargs)
    Thread(target=_settled, args=(future, work), name=call.__name__, daemon=True).start()
    return await asyncio.wrap_future(future)


def _settled(future: Future[R], work: Callable[[], R]) -> None:
    """What came of the work, whatever it was; also where nobody waits for it any more."""
    if future.set_running_or_notify_cancel():
        try:
            result = work()
        except BaseException as error:
            future.set_exception(error)
        else:
            future.set_result(result)


# What the program says, on a page: its sentences with their signs, its errors as one message.
#
# A message says what, where and what to do; what the program did wrong is said to be its fault.

KNOWN = (CalibrationError, ProcedureError, DriverError, RigError)


def message(error: Exception) -> str:
    """What went wrong; a fault of the program goes to the server's log as well."""
    if isinstance(error, KNOWN):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'a file'}: cannot be used: {error.strerror.lower()}"
    logging.getLogger("rig.web").error("a fault of this program", exc_info=error)
    return f"A fault of this program: {type(error).__name__}: {error}. The terminal of `rig web` shows where."


def for_page(text: str) -> str:
    """A sentence of the command line with the signs that a terminal may not have: −, ±, ×, °C."""
    signs = re.sub(r"(?<![\w.)\]-])-(?=\d)", "−", text.replace(" +- ", " ± "))
    return re.sub(r"(?<=\d) x (?=the |that |its )", " × ", re.sub(r"(?<=\d) (deg)?C\b", " °C", signs))
