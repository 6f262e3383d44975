"""Model page: where the model fails, the missing effect, the error after each step."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastapi import Request
from nicegui import ui

from calibrations.text import rounded
from rig.errors import RecordError
from rig.services.content import Content, content_of
from rig.services.exclusion import find_numbered_run
from rig.services.page_words import IMPORT, address
from rig.services.search import Cancelled
from rig.services.tables import with_run_ids
from rig.web.address import ModelState, parse_state
from rig.web.calculations import Visit, off_loop
from rig.web.desk import Desk, runs
from rig.web.frame import Key, frame
from rig.web.pages import run_record
from rig.web.pages.model_choice import Choice
from rig.web.pages.model_missing import Missing
from rig.web.pages.model_noise import NoisePictures
from rig.web.pages.model_parameters import ParametersBox
from rig.web.pages.model_pictures import Pictures
from rig.web.pages.model_verdict import VerdictBox
from rig.web.pages.run_report import draw_ahead
from rig.web.parts import afresh, box, div, for_page, message, notify_error, show_error, show_remark, state, words

if TYPE_CHECKING:
    from calibrations.discovery.findings import Step
    from calibrations.discovery.results import Comparison, Diagnosis
    from rig.services.session import ModelSession


LOOK_S = 2.0
LONGEST_ADDRESS = 4000  # characters; a longer one keeps the last state that fits


def register(desk: Desk) -> None:
    """The page at /."""

    @ui.page("/")
    def page(request: Request) -> None:
        Workbench(desk, parse_state(request.query_params)).build()


class Workbench:
    """One open page: data, model session, pictures, candidates."""

    def __init__(self, desk: Desk, address: ModelState) -> None:
        self.desk, self.requested = desk, address
        self.data, self.model, self.noise = address.data, address.model, address.noise
        self.address = ""
        self.session: ModelSession[Any] | None = None
        self.visit = Visit()
        self.turn = 0  # results of older requests are ignored
        self.diagnoses: dict[tuple[str, ...], Diagnosis[Any]] = {}
        self.shown_state: tuple[bool, Content] | None = None
        self.discovering = False  # effects are added one after another

    def build(self) -> None:
        """Build the page; long computations start when the browser shows it."""
        try:
            self.data = with_run_ids(self.data) or _newest_run()
        except RecordError as error:  # for example a lab that does not answer
            with frame(self.desk, "/"):
                show_error("The record cannot be read", error)
            return
        with frame(self.desk, "/", f"Model of {Path(self.data).name}" if self.data else "") as keys:
            self.chosen = Choice(self)
            self.body = div("stack")
        with self.body:
            if not self.data:
                _empty_page()
                return
            self.newer = div("")
            self.notes = div("stack")
            self.verdict = VerdictBox()
            self.places = div("")
            self.analysis = div("analysis")
        self.keys = keys
        self._lay_out("rows")
        ui.context.client.on_delete(self.left)
        ui.timer(0.0, self.open, once=True)

    def _lay_out(self, form: str) -> None:
        """Place pictures and candidates for the kind of data."""
        with afresh(self.analysis):
            rows = form == "rows"
            with div("stack"):
                self.pictures: Pictures | NoisePictures = (
                    Pictures(self._exclude_dialog(), self.tell_address, self.requested.selected)
                    if rows
                    else NoisePictures()
                )
                self.parameters = ParametersBox(self)
            self.missing = Missing(self, allows_own=rows)
        self.keys["a"] = Key("add the shown effect", self.missing.add_shown)
        self.keys["u"] = Key("undo the last effect", self.undo)
        self.keys["x"] = Key("next axis", self.pictures.next_axis)
        self.keys["g"] = Key("switch between V and g", self.pictures.other_unit)
        self.keys["l"] = Key("exclude the selected poses", self.pictures.leave_selected)
        self.keys["t"] = Key("go to the parameters", self.see_parameters)
        self.keys["Escape"] = Key("clear the selection", partial(self.pictures.select, []))

    def see_parameters(self) -> None:
        """Scroll to the parameters."""
        ui.run_javascript("document.querySelector('.parameters')?.scrollIntoView({block: 'start'})")

    def _exclude_dialog(self) -> Callable[[Sequence[int]], None] | None:
        """The dialog that excludes selected poses; None for a file and for samples."""
        return partial(run_record.ask, self.data, on_done=self.afresh) if find_numbered_run(self.data) else None

    def afresh(self) -> None:
        """Read the changed data again."""
        self.desk.forget(self.data)
        self.go(self.data, self.model, self.noise)

    def go(self, data: str, model: str, noise: str = "") -> None:
        """Go to the address of data, model and noise model."""
        ui.navigate.to(ModelState(data, model, noise=noise).address)

    def tell_address(self) -> None:
        """Write the present state into the address, so that it can be passed on, and survives a reload."""
        if self.session is None:
            return
        selected = tuple(self.pictures.selected) if isinstance(self.pictures, Pictures) else ()
        address = ModelState(self.data, self.model, self.session.added, selected, self.noise).address
        if address != self.address and len(address) < LONGEST_ADDRESS:
            self.address = address
            ui.navigate.history.replace(address)

    async def open(self) -> None:
        """Read the data, fit the model, and show the session."""
        self.verdict.wait(for_page(f"Reading {self.data}"), self.visit)
        self.verdict.offer_cancel(self.visit.cancel)
        try:
            session = await self.visit.work(self.desk.open, self.data, self.model, self.requested.added, self.noise)
        except Cancelled:
            self._show_cancelled()
            return
        except Exception as error:
            with afresh(self.body):
                addresses = {IMPORT: address(IMPORT, self.data)} if Path(self.data).is_file() else {}
                show_error(f"Cannot analyse {self.data}", error, self.data, addresses)
            return
        if session.data.form != "rows":  # the present layout may hold text that a person wrote
            self._lay_out(session.data.form)
        self.chosen.opened(session)
        for note in filter(None, (session.change, *session.notes)):
            with self.notes:
                show_remark(note, self.data)
        if excluded := run_record.left_out(self.data):
            with (
                self.notes,
                ui.expansion(f"{len(excluded)} excluded from every analysis").props("dense").classes("box"),
            ):
                run_record.list_excluded(self.data, self.afresh)
        ui.timer(LOOK_S, self._look_for_changes)
        await self.show(session)

    def _show_cancelled(self) -> None:
        """The person cancelled the fit: nothing is shown."""
        if self.visit.closed:
            return
        with afresh(self.body), state("The analysis was cancelled", for_page(f"{self.data} is unchanged.")):
            ui.button("Analyse again", icon="refresh", on_click=partial(self.go, self.data, self.model, self.noise))

    def _show_places(self, compared: Comparison[Any]) -> None:
        """The places where the model fails; a click selects their poses."""
        self.places.clear()
        if not compared.fails:
            return
        rows = compared.data.form == "rows"
        with self.places, box("row-of places").props('role=group aria-label="Where the model fails"'):
            words("Fails at (error / noise floor)" if rows else "Fails at", "k")
            for place in compared.fails:
                place_text, _, description = for_page(place.text).partition(": ")
                place_label = f"{place_text}, {place.axis}"
                if rows:
                    place_label += f": {rounded(place.excess, 2)} ×"
                    description += f". Click to select these {compared.fit.measured.type.rows}"
                with ui.button(place_label, on_click=partial(self.pictures.show_place, place)).props("outline dense"):
                    ui.tooltip(description)

    async def _look_for_changes(self) -> None:
        """Say that the run grows, or that data or model have changed, with a button that updates the analysis."""
        if self.session is None:
            return
        analysed = self.session.content
        try:
            present = await off_loop(content_of, self.data, self.model or None)
        except Exception:  # the record is busy, or the file is being written: look again later
            return
        is_changed = present.key != analysed.key
        if (state := (is_changed, present)) == self.shown_state:
            return
        self.shown_state = state
        self.newer.clear()
        if not is_changed and not present.growing:
            return
        extent_text = f"{present.extent} by now; " if is_changed and present.extent else ""
        subject = f"{self.data} is still running" if present.growing else f"{self.data} or the model has changed"
        with self.newer, box("note row-of").props("role=status"):
            words(for_page(f"{subject}: {extent_text}this page analyses {self.session.data.description}."), "grow")
            if is_changed:
                ui.button("Update", icon="refresh", on_click=self._update).props("dense")

    def _update(self) -> None:
        """Open the changed data, whose change is shown already."""
        self.desk.updates.add((self.data, self.model, self.noise))
        self.go(self.data, self.model, self.noise)

    async def show(self, session: ModelSession[Any]) -> None:
        """Show pictures and error of the present model, then its missing effects."""
        self.visit.cancel()  # the results for the previous model are not needed
        self.turn += 1
        turn = self.turn
        self.session = session
        self.desk.keep(self.data, self.model, session, self.noise)
        try:
            compared = await self.visit.work(session.compared)
        except Cancelled:
            return
        if turn != self.turn:
            return
        self.pictures.show(compared, session)
        self.tell_address()
        self.verdict.error(compared, session)
        self._show_places(compared)
        self.chosen.grown(session)
        self.missing.grown(session)
        await asyncio.gather(self.parameters.show(session), self._diagnose(session, turn))

    async def _diagnose(self, session: ModelSession[Any], turn: int) -> None:
        key, is_first = session.names, session.search_made is None
        if key not in self.diagnoses:
            search = self.visit.searched(session.effects)
            self.missing.wait(search)
            try:
                self.verdict.searching(await self.visit.work(session.judged), search)
                self.diagnoses[key] = await self.visit.work(session.with_effects(search).diagnosed)
            except Cancelled:
                return
            except Exception as error:
                if turn == self.turn:
                    self.verdict.show_no_diagnosis()
                    self.missing.fail(message(error))
                return
        if turn == self.turn:
            self.verdict.found(self.diagnoses[key])
            self.parameters.diagnosed(self.diagnoses[key])
            ahead = [self._draw_report_ahead(session)] if is_first else []
            await asyncio.gather(self.missing.show(self.diagnoses[key]), *ahead)

    async def _draw_report_ahead(self, session: ModelSession[Any]) -> None:
        """Draw what the report on the data would show: the search, which takes longest, is known."""
        if session.data.form == "rows" and not (session.names or self.model or self.noise):
            with suppress(Cancelled, Exception):  # the report itself says why it cannot be made
                await self.visit.work(draw_ahead, self.desk, self.data, session)

    def left(self) -> None:
        """End the search for missing effects: the page is closed, and nobody waits for the result."""
        self.discovering = False
        self.turn += 1
        self.visit.cancel()

    def cancel(self) -> None:
        """Cancel the search for missing effects."""
        self.left()
        self.verdict.show_no_diagnosis()
        self.missing.cancelled()

    async def again(self) -> None:
        """Start the cancelled search again."""
        if self.session is not None:
            await self._diagnose(self.session, self.turn)

    async def discover(self) -> None:
        """Add the missing effects step by step, and show each step, until no effect is missing or a person stops it."""
        if self.discovering:
            return
        self.discovering = True
        count = 0
        try:
            while self.session is not None and self.discovering:
                result = self.diagnoses.get(self.session.names)
                if result is None or not result.missing or not result.findings.steps:
                    break
                step, count = result.findings.steps[0], count + 1
                self.missing.discovering(step.name, count, count + len(result.missing) - 1)
                await self.add(step)
        finally:
            self.discovering = False
            self.missing.discovered()
        diagnosis = self.diagnoses.get(self.session.names) if self.session is not None else None
        if diagnosis is not None:  # stopped: offer the rest again; at the end: plan the next experiment
            await self.missing.show(diagnosis)

    async def remove(self, name: str) -> None:
        """Remove one of the added effects; the later ones are fitted again."""
        if self.session is None:
            return
        self.verdict.wait(f"Removing {name} and fitting the others", self.visit)
        try:
            session = await self.visit.work(self.session.removed, name)
        except Cancelled:
            return
        except Exception as error:
            notify_error(error)
            return
        for note in session.notes[len(self.session.notes) :]:
            with self.notes:
                show_remark(note, self.data)
        self.diagnoses = {key: diagnosis for key, diagnosis in self.diagnoses.items() if name not in key}
        await self.show(session)

    async def add(self, step: Step[Any]) -> None:
        """Add an effect to the model, unless it is there already."""
        if self.session is not None and step.name not in self.session.names:
            if (effect := step.effect).expression:
                self.session = self.session.with_own(effect)
            await self.show(self.session.with_step(step))

    async def undo(self) -> None:
        """Remove the last effect."""
        if self.session is not None and self.session.steps:
            last = self.session.steps[-1].name
            self.diagnoses = {key: diagnosis for key, diagnosis in self.diagnoses.items() if last not in key}
            await self.show(self.session.undone())


def _empty_page() -> None:
    """The page of an empty record."""
    advice = "Measure on the rig (simulated, until a bench file names your instruments), or open a table of your own."
    with state("There are no measurements yet", advice):
        ui.button("Measure", icon="play_arrow", on_click=lambda: ui.navigate.to("/run?procedure=sweep"))
        ui.button("Open a file", icon="upload_file", on_click=lambda: ui.navigate.to("/import")).props("outline")


def _newest_run() -> str:
    """The newest run of one sensor; "" without one."""
    return next((run.run for run in runs() if run.rows and not run.bench.get("sensors")), "")
