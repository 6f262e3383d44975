"""Parts that pages are made of: boxes, tables, messages, states."""

from __future__ import annotations

import html
import logging
import os
import re
from collections.abc import Awaitable, Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from nicegui import ui
from nicegui.element import Element

from calibrations.errors import CalibrationError
from calibrations.text import typeset
from drivers.errors import DriverError
from procedures.errors import ProcedureError
from procedures.settings import setting_label
from rig.errors import RigError
from rig.files import home
from rig.services.page_words import PageStep, page_step
from rig.services.search import Cancelled
from rig.web.desk import FILES

R = TypeVar("R")
PROGRESS_S = 0.5  # the text shows whole seconds; more often costs a busy server time

# Boxes, tables and states.

# A cell of a sorted table: a link to the row's `to`, if it has one.
LINKED = """<q-td :props="props">
  <a v-if="props.row.to" :href="props.row.to" @click.stop>{{ props.value }}</a><span v-else>{{ props.value }}</span>
</q-td>"""


def dialog_with_name(title: str) -> ui.dialog:
    """A dialog with a name for screen readers; the caller adds its card."""
    return ui.dialog().props(f'aria-label="{html.escape(title)}"')


def box(classes: str = "") -> Element:
    """A sheet of paper on the page."""
    return ui.element("section").classes(f"box {classes}")


def div(classes: str) -> Element:
    """A plain container."""
    return ui.element("div").classes(classes)


def wide_table() -> Element:
    """A place for a table that scrolls sideways; the keyboard scrolls it as well."""
    return div("wide-table").props('tabindex=0 role=group aria-label="Table"')


def words(text: str, classes: str = "") -> ui.label:
    """A line of text."""
    return ui.label(text).classes(classes)


def button(label: str, icon: str, act: Callable[..., Any], look: str = "outline dense") -> ui.button:
    """A button with an icon; `look`: properties of Quasar."""
    return ui.button(label, icon=icon, on_click=act).props(look)


@contextmanager
def afresh(place: Element) -> Iterator[None]:
    """Empty a place; the body fills it again."""
    place.clear()
    with place:
        yield


@contextmanager
def state(title: str, advice: str = "", kind: str = "") -> Iterator[None]:
    """A box in place of missing content, with an instruction; the body adds buttons."""
    with box(f"state {kind}").props("role=status"):
        words(title, "title")
        if advice:
            words(advice, "why quiet")
        with div("row-of"):
            yield


def waiting(text: str) -> ui.label:
    """A spinner; the caller may update the returned label with the progress."""
    with div("row-of").props("role=status"):
        ui.spinner(size="1.4em")
        return words(text, "quiet")


async def shown(
    place: Element,
    hint: str | Callable[[], str],
    title: str,
    work: Awaitable[R],
    current: Callable[[], bool] = lambda: True,
    data: str = "",
) -> R | None:
    """Show `hint` in `place` until the work is done, and return its result; the place is empty then.

    None if the work was cancelled, if it is no longer `current`, or if it failed: then the place shows the error under
    `title`, with buttons for `data`. A `hint` that is a function is asked again and again.
    """
    with afresh(place):
        label = waiting(hint if isinstance(hint, str) else hint())
        if callable(hint):
            ui.timer(PROGRESS_S, lambda: label.set_text(hint()))
    try:
        result = await work
    except Cancelled:
        return None
    except Exception as error:
        if current():
            with afresh(place):
                show_error(title, error, data)
        return None
    if not current():
        return None
    place.clear()
    return result


def show_error(title: str, reason: str | Exception, data: str = "", addresses: Mapping[str, str] | None = None) -> None:
    """An error message. `data`: the run or file that it is about; `addresses`: further buttons by their labels."""
    step = page_step(reason if isinstance(reason, str) else raw_message(reason), data)
    with box("error").props("role=alert"):
        words(for_page(title), "title")
        words(for_page(step.text), "why quiet").style("white-space: pre-wrap")
        buttons({**step.to, **(addresses or {})})


def show_remark(text: str, data: str = "") -> None:
    """A box with a remark on `data`; what a command does, its buttons do."""
    with box("note"):
        step_row(page_step(text, data), "small")


def step_row(step: PageStep, classes: str = "") -> None:
    """A sentence, and buttons to the pages where it is done."""
    with div("row-of"):
        words(for_page(step.text), f"{classes} grow")
        buttons(step.to)


def buttons(addresses: Mapping[str, str]) -> None:
    """Buttons that open addresses, by their labels."""
    for label, address in addresses.items():
        ui.button(label, on_click=partial(ui.navigate.to, address)).props("outline dense")


def facts(rows: Mapping[str, str]) -> None:
    """Names and values in two columns."""
    with div("facts"):
        for name, value in rows.items():
            words(name, "k")
            words(value)


@dataclass(frozen=True)
class Link:
    """A cell with a link."""

    text: str
    to: str


def sortable(labels: Mapping[str, str], fixed: Collection[str] = ()) -> list[dict[str, object]]:
    """The columns of an `ui.table` by the keys of its rows; all but the `fixed` ones can be sorted."""
    return [
        {"name": name, "label": label, "field": name, "align": "left", "sortable": name not in fixed}
        for name, label in labels.items()
    ]


def table(head: Sequence[str], rows: Sequence[Sequence[str | Link | Callable[[], Any]]]) -> None:
    """A plain table, with a head or without. A cell is a text, a link, or a function that makes its content."""
    with ui.element("table").classes("plain-table"):
        if head:
            with ui.element("tr"):
                for name in head:
                    with ui.element("th"):
                        words(name)
        for row in rows:
            with ui.element("tr"):
                for cell in row:
                    with ui.element("td"):
                        if isinstance(cell, str):
                            words(cell)
                        elif isinstance(cell, Link):
                            ui.link(cell.text, cell.to)
                        else:
                            cell()


def redraw(plot: ui.plotly, figure: dict[str, Any]) -> None:
    """Update a plot only if its figure changed: an unchanged plot keeps its zoom and its selection."""
    if figure != plot.figure:
        plot.update_figure(figure)


# Messages. An error of the user or of an instrument says what, where and what to do; any other error is called a fault
# of the program.

KNOWN = (CalibrationError, ProcedureError, DriverError, RigError)


def message(error: Exception) -> str:
    """The text of an error for a page: pages in place of commands."""
    return for_page(page_step(raw_message(error)).text)


def notify_error(error: Exception, stays: bool = False) -> None:
    """Show an error as a notification, for some seconds or, with `stays`, until a person closes it."""
    lasting: dict[str, Any] = {"timeout": 0, "close_button": "Close"} if stays else {}
    ui.notify(message(error), type="negative", multi_line=True, **lasting)


def raw_message(error: Exception) -> str:
    """The text of an error; a fault of the program also goes to the server's log."""
    if isinstance(error, KNOWN):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'a file'}: cannot be used: {error.strerror.lower()}"
    logging.getLogger("rig.web").error("a fault of this program", exc_info=error)
    return f"A fault of this program: {type(error).__name__}: {error}. The terminal of `rig web` shows where."


def for_page(text: str) -> str:
    """A sentence of the command line with the signs of a page and the own names of uploaded files."""
    return typeset(text.replace(f"{home() / FILES}{os.sep}", ""))


# Settings of a procedure in messages: their labels, as the form shows them.


def with_labels(text: str, names: Iterable[str]) -> str:
    """A message with the labels of settings in place of their names: "step (deg)" for step_deg."""
    for name in sorted(names, key=len, reverse=True):
        if "_" in name:
            text = re.sub(rf"(?<![\w-]){re.escape(name)}(?!\w)", f'"{setting_label(name)}"', text)
    return text
