"""Import page: a file with columns of other names and units becomes a run of the record, by drop-downs."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
from fastapi import Request
from nicegui import ui
from numpy.typing import NDArray
from starlette.datastructures import QueryParams

from calibrations.importing.cells import number_or_text
from calibrations.importing.proposal import column_names, sample_values
from calibrations.importing.sheet import Sheet
from calibrations.importing.topics import SeveralTopics
from calibrations.importing.units import ColumnMapping, column_unit
from calibrations.table import Constant
from calibrations.text import interval, join_words
from calibrations.text import unit as unit_text
from rig.services.importing import (
    TIMES,
    Preview,
    column_words,
    data_chart,
    doubt_of_time,
    lacking,
    open_file,
    preview,
    proposal,
    store_sheet,
)
from rig.services.page_words import IMPORT, address, page_step
from rig.web.address import ModelState
from rig.web.calculations import off_loop
from rig.web.desk import Desk
from rig.web.frame import frame
from rig.web.pages.import_column import MEANING, Column, meanings_of
from rig.web.parts import (
    afresh,
    box,
    div,
    facts,
    for_page,
    raw_message,
    show_error,
    show_remark,
    waiting,
    wide_table,
    words,
)
from rig.web.pictures import draw, plot_with_title
from rig.web.upload import upload

TIME = "t_s"
KINDS = {
    "poses": "Poses: the stage angles are known",
    "positions": "Positions: still, in unknown directions",
    "still": "Still record: single samples at rest",
    "rates": "Rates: a gyroscope that is turned",
    "turns": "Turns: a gyroscope with an accelerometer, between rests",
    "motion": "Motion: with a displacement sensor",
}
CONSTANTS = {  # constants that a person may know, with the labels of their fields
    "sensor": "Sensor",
    "serial": "Serial number",
    "date": "Date (2026-01-31)",
    "sample_rate_hz": "Sample rate (Hz)",
    "gravity_m_s2": "Gravity (m/s²)",
    "turn_deg": "Angle of each turn (deg)",
}
CONSTANT_KINDS = {  # kinds that have a constant; all kinds where it is not here
    "turn_deg": ("rates",),
    "sample_rate_hz": ("positions", "rates", "turns", "still", "motion"),
}
PICTURE = "Data as imported"
UNIT_DOUBT = re.compile(  # the end of a message about a unit that does not fit the values
    r"\nIf its unit is (?P<likely>\S+), import it with:.*\nIf its unit is (?P<stated>\S+) after all, "
    r"state it: --column (?P<name>\w+)=",
    re.DOTALL,
)


def register(desk: Desk) -> None:
    """The page at /import; the file, the kind of table and the constants may be part of the address."""

    @ui.page("/import")
    async def page(request: Request, file: str = "", topic: str = "") -> None:
        with frame(desk, "/record", f"Import {Path(file).name or 'a file'}"):
            if not file:
                _choose()
                return
            body = div("stack")
            with body:
                waiting(f"Reading {Path(file).name}")
            try:
                sheet = await off_loop(open_file, Path(file), topic or None)
            except SeveralTopics as several:
                with afresh(body):
                    _choose_topic(Path(file), several)
            except Exception as error:
                with afresh(body):
                    show_error(f"{Path(file).name} cannot be imported", error, addresses={"Another file": "/import"})
            else:
                with afresh(body):
                    ImportPage(sheet, Path(file), request.query_params)


def _choose() -> None:
    with box("stack"):
        words("Import a file", "title")
        words("A table of numbers: CSV, any separator, with or without a header; or JSON with named arrays.", "quiet")
        upload(_go)


def _choose_topic(path: Path, several: SeveralTopics) -> None:
    """A button for each table of a file in which a person has to choose one."""
    with box("stack"):
        words(f"{path.name} has {len(several.topics)} tables", "title")
        words("Choose the one to import.", "quiet")
        for name, described in several.topics.items():
            button = ui.button(described, on_click=partial(_go_to, path, name)).props("no-caps align=left")
            button.props("" if name == several.proposed else "outline")


def _go_to(path: Path, topic: str) -> None:
    ui.navigate.to(f"/import?{urlencode({'file': str(path), 'topic': topic})}")


async def _go(path: Path) -> None:
    ui.navigate.to(address(IMPORT, str(path)))


class ImportPage:
    """The table of columns with proposals, the constants, the picture, and the button that imports."""

    def __init__(self, sheet: Sheet, path: Path, given: QueryParams) -> None:
        """`given`: the fields of the address, as `_tell_address` writes them."""
        self.sheet, self.path, self.given = sheet, path, given
        self.restored = meanings_of(given)  # until the kind of table changes
        self.turn, self.quiet, self.address = 0, True, ""
        self.asked = False  # the unit of the time is in doubt and no person has stated it
        proposed = proposal(sheet)
        self.proposed_kind = proposed.kind
        with box("row-of"):
            words(f"Import {path.name}", "title grow")
            if len(sheet.topics) > 1:
                tables = ui.select(list(sheet.topics), label="Table of the file", value=sheet.topic)
                tables.props("dense options-dense").on_value_change(lambda event: _go_to(path, event.value))
            kind = given.get("kind", proposed.kind)
            kind = kind if kind in KINDS else proposed.kind
            self.kind = ui.select(KINDS, label="Kind of table", value=kind, on_change=self._offer)
            self.kind.props("dense options-dense").style("min-width: 300px")
            self.button = ui.button("Import", icon="download_done", on_click=self._import)
            self.button.disable()  # until the preview of the present choices
            ui.button("Cancel", on_click=partial(ui.navigate.to, "/record")).props("flat")
        self.fault = div("stack")
        self.question = div("")
        with div("import-page"):
            with box("stack"):
                words("Columns", "title")
                words("Each column of the file, what it means, and its unit. The proposals come from names and values; "
                      "check them. Other columns are stored with their own names.", "quiet small")  # fmt: skip
                with wide_table(), ui.element("table").classes("plain-table mapping"):
                    with ui.element("tr"):
                        for head in ("column of the file", "values", "meaning", "unit"):
                            with ui.element("th"):
                                words(head)
                    self.columns = {name: Column(name, _sample_text(sheet, name), self.look) for name in sheet.header}
                self._constants()
            with div("stack"):
                with box("picture"):
                    self.plot = plot_with_title(PICTURE, classes="tall-plot")
                self.result = box("stack")
        self._offer()

    def _constants(self) -> None:
        words("Constants", "title")
        if self.sheet.constants:
            facts({name: str(value) for name, value in self.sheet.constants.items()})
        with div("settings"):
            self.fields = {
                name: ui.input(label, value=self.given.get(name, ""), on_change=self.look).props("dense debounce=400")
                for name, label in CONSTANTS.items()
                if name not in self.sheet.constants
            }

    def _offer(self) -> None:
        """Offer the columns of the kind of table, with the proposals."""
        kind = str(self.kind.value)
        proposed = proposal(self.sheet, kind)
        self.quiet = True
        for name, column in self.columns.items():
            stated_unit = self.sheet.units[self.sheet.header.index(name)]
            column.offer(column_names(kind), proposed.columns[name], stated_unit)
            if name in self.restored:
                column.choose(self.restored[name])
        for name, field in self.fields.items():
            field.set_visibility(kind in CONSTANT_KINDS.get(name, KINDS))
        self.quiet = False
        self.restored = {}
        self.look()

    def _look_at_time(self) -> None:
        """Ask for the unit of the time where the present columns leave it in doubt and no person has stated it."""
        clock = next((column for column in self.columns.values() if column.name.value == TIME), None)
        is_open = clock is not None and not (clock.confirmed and clock.stated)
        doubt = doubt_of_time(self.sheet, self.mappings) if is_open else None
        self.asked = doubt is not None
        self.question.clear()
        if clock is not None and doubt is not None:
            self._ask_unit(clock, *doubt)

    def _ask_unit(self, clock: Column, doubt: str, fits: str) -> None:
        """Ask for the unit of the time; nothing is imported before the answer."""
        with self.question, box("question stack").props("role=group aria-label='Unit of the time'"):
            words(f'What is the unit of the time "{clock.file_column}"?', "title")
            words(f"It {doubt}; no stage does that." + (f" It fits {fits}." if fits else ""), "quiet")
            with div("row-of"):
                for unit in TIMES:
                    button = ui.button(unit, on_click=partial(clock.state, unit)).props("no-caps")
                    button.props("" if unit == fits else "outline")

    @property
    def mappings(self) -> list[ColumnMapping]:
        """The columns that are used, as chosen."""
        return [m for column in self.columns.values() if (m := column.mapping) is not None]

    @property
    def constants(self) -> dict[str, Constant]:
        """The constants as typed; numbers where they are numbers."""
        texts = {name: str(field.value or "").strip() for name, field in self.fields.items() if field.visible}
        return {name: number_or_text(text) if name.count("_") else text for name, text in texts.items() if text}

    def look(self) -> None:
        """Show what would be imported with the present choices."""
        if not self.quiet:
            self.button.disable()
            with self.fault:  # the clicked element may be gone
                ui.timer(0.0, self._preview, once=True)

    def _tell_address(self) -> None:
        """Write what a person typed and chose into the address, so that it survives a reload and a lost server."""
        typed = {name: str(field.value or "").strip() for name, field in self.fields.items()}
        kind = {"kind": str(self.kind.value)} if self.kind.value != self.proposed_kind else {}
        topic = {"topic": self.sheet.topic} if len(self.sheet.topics) > 1 else {}
        query = {"file": str(self.path)} | topic | kind | {name: text for name, text in typed.items() if text}
        chosen = [(name, *column.chosen) for name, column in self.columns.items() if column.by_person]
        columns = [pair for meaning in chosen for pair in zip(MEANING, meaning, strict=True)]
        address = f"/import?{urlencode([*query.items(), *columns])}"
        if address != self.address:
            self.address = address
            ui.navigate.history.replace(address)

    async def _preview(self) -> None:
        self._tell_address()
        self._look_at_time()
        self.turn += 1
        turn, kind, mappings = self.turn, str(self.kind.value), self.mappings
        names = [m.name for m in mappings]
        if duplicate := next((name for name in names if names.count(name) > 1), ""):
            self._show_fault("", f'Two columns have the meaning {duplicate}. Choose another one, or "other".')
            return
        sheet = replace(self.sheet, constants={**self.sheet.constants, **self.constants})
        if lacks := lacking(sheet, kind, mappings):
            pronoun = "them" if len(lacks) > 1 else "it"
            needed = join_words(map(column_words, lacks))
            self._show_fault("", f'Still needed: {needed}. Select {pronoun} under "meaning".')
            return
        try:
            preview_table = await off_loop(preview, self.sheet, kind, mappings, self.constants)
        except Exception as error:
            if turn == self.turn:
                self._show_fault("This cannot be imported yet", error)
            return
        if turn == self.turn:
            self._show(preview_table)

    def _show_fault(self, title: str, reason: str | Exception) -> None:
        self.button.disable()
        self.result.clear()
        with afresh(self.fault):
            if isinstance(reason, str):
                show_remark(reason)
            else:
                text = raw_message(reason)
                doubt = UNIT_DOUBT.search(text)
                show_error(title, page_step(text[: doubt.start()] if doubt else text).text)
                if doubt:
                    self._offer_doubted_units(doubt["name"], (doubt["likely"], doubt["stated"]))

    def _offer_doubted_units(self, name: str, units: tuple[str, str]) -> None:
        """Buttons for the unit that fits the values, and for the present one, which a person may confirm."""
        column = next(column for column in self.columns.values() if column.name.value == name)
        with box("question").props(f"role=group aria-label='Unit of {name}'"):
            words(f'What is the unit of the column "{column.file_column}"?', "title")
            with div("row-of"):
                for k, unit in enumerate(units):
                    button = ui.button(unit_text(unit), on_click=partial(column.state, unit)).props("no-caps")
                    button.props("outline" if k else "")

    def _show(self, preview_of: Preview) -> None:
        """The picture and the table's first values; the import is possible."""
        self.fault.clear()
        self.result.clear()
        table = preview_of.table
        draw(self.plot, data_chart(table), "import")
        with self.result:
            words(f"{table.n} {'row' if table.n == 1 else 'rows'} of {table.kind}", "title")
            ranges = {name: for_page(f"{_range_text(values)} {unit_text(column_unit(name))}".rstrip())
                      for name, values in table.columns.items()}  # fmt: skip
            facts(ranges)
            for note in preview_of.notes:
                show_remark(note)
        self.button.set_enabled(not self.asked)

    async def _import(self) -> None:
        self.button.disable()
        self.button.props("loading")
        try:
            kind, mappings = str(self.kind.value), self.mappings
            run, _ = await off_loop(store_sheet, self.sheet, kind, mappings, self.constants, lambda _: None)
        except Exception as error:
            self.button.props(remove="loading")
            self.button.enable()
            self._show_fault("The file was not imported", error)
            return
        ui.navigate.to(ModelState(run).address)


def _sample_text(sheet: Sheet, name: str) -> str:
    """The first values of a column and the range of the first rows, or its first words."""
    values = sample_values(sheet, name)
    if not len(values):
        return ", ".join(dict.fromkeys(row[sheet.header.index(name)] for row in sheet.sample[:20]))[:60]
    first = ", ".join(f"{value:.6g}" for value in values[:3])
    return for_page(first if len(values) <= 3 else f"{first} … (first {len(values)} rows: {_range_text(values)})")


def _range_text(values: NDArray[np.float64]) -> str:
    """`1.5 to 3.5`, or the one value that all have."""
    low, high = float(values.min()), float(values.max())
    return f"{low:.6g}" if low == high else interval(low, high)
