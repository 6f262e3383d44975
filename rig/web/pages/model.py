"""Model: see where it fails, click the missing effect, watch the error fall."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING
from urllib.parse import urlencode

from nicegui import ui

from rig.analysis.exclusion import numbered_run
from rig.analysis.trail_still import StillTrail
from rig.errors import RecordError
from rig.web.counted import Cancelled, Counted
from rig.web.desk import Desk, runs
from rig.web.frame import Key, frame
from rig.web.pages import left_out
from rig.web.pages.model_choice import Choice
from rig.web.pages.model_missing import Missing
from rig.web.pages.model_noise import NoisePictures
from rig.web.pages.model_page import AnyPictures
from rig.web.pages.model_pictures import Pictures
from rig.web.pages.model_verdict import Verdict
from rig.web.pages.model_words import OfRows, Words, words_of
from rig.web.parts import box, div, failed, off_loop, state, words
from rig.web.told import message

if TYPE_CHECKING:
    from rig.analysis.growing import Diagnosis, Growing, Step


def register(desk: Desk) -> None:
    """The page at /."""

    @ui.page("/")
    def page(data: str = "", model: str = "") -> None:
        Workbench(desk, data, model).build()


class Workbench:
    """One open page: data, the model that grows on it, pictures, and what is missing."""

    def __init__(self, desk: Desk, data: str, model: str) -> None:
        self.desk, self.data, self.model = desk, data, model
        self.trail: Growing | None = None
        self.told: Words = OfRows()
        self.search = Counted({})
        self.turn = 0  # answers to questions that were asked before the last one are let go
        self.diagnoses: dict[tuple[str, ...], Diagnosis] = {}

    def build(self) -> None:
        """The page, laid out; what takes long is asked for as soon as the browser shows it."""
        try:
            self.data = self.data or _newest()
        except RecordError as error:  # such as a lab that is away
            with frame(self.desk, "/"):
                failed("The record cannot be read", message(error))
            return
        with frame(self.desk, "/") as keys:
            self.chosen = Choice(self)
            self.body = div("stack")
        with self.body:
            if not self.data:
                _nothing()
                return
            self.notes = div("stack")
            self.verdict = Verdict()
            self.analysis = div("analysis")
        self.keys = keys
        self._lay_out(still=False)
        ui.timer(0.0, self.open, once=True)

    def _lay_out(self, still: bool) -> None:
        """The places of pictures and candidates, as the kind of data wants them."""
        self.analysis.clear()
        with self.analysis:
            self.pictures: AnyPictures = NoisePictures() if still else Pictures(self._leaving_out())
            self.missing = Missing(self, own=not still)
        self.keys["a"] = Key("add the effect that is looked at", self.missing.add_shown)
        self.keys["u"] = Key("undo the last effect", self.undo)
        self.keys["x"] = Key("the next axis", self.pictures.next_axis)
        self.keys["g"] = Key("V, or g", self.pictures.other_unit)
        self.keys["l"] = Key("leave out what is selected", self.pictures.leave_selected)
        self.keys["Escape"] = Key("select nothing", partial(self.pictures.select, []))

    def _leaving_out(self) -> Callable[[Sequence[int]], None] | None:
        """What asks why selected poses are to be left out; None where the data are no run of the rig."""
        return partial(left_out.ask, self.data, done=self.afresh) if numbered_run(self.data) else None

    def afresh(self) -> None:
        """Read the data again, which have changed."""
        self.desk.forget(self.data)
        self.go(self.data, self.model)

    def go(self, data: str, model: str) -> None:
        """Another address: data and model are part of it, so that it can be kept and passed on."""
        given = {name: value for name, value in (("data", data), ("model", model)) if value}
        ui.navigate.to(f"/?{urlencode(given)}" if given else "/")

    async def open(self) -> None:
        """Read the data, fit the model, and show how far it had grown."""
        self.verdict.wait(f"Reading {self.data} and fitting the model")
        try:
            trail = await off_loop(self.desk.open, self.data, self.model)
        except Exception as error:
            self.body.clear()
            with self.body:
                failed(f"{self.data} cannot be looked at with this model", message(error))
            return
        self.told = words_of(trail)
        if isinstance(trail, StillTrail):
            self._lay_out(still=True)
        self.chosen.opened(trail)
        for note in trail.notes:
            with self.notes, box("note"):
                words(note, "small")
        if found := left_out.left_out(self.data):
            with self.notes, ui.expansion(f"{len(found)} left out of every analysis").props("dense").classes("box"):
                left_out.listed(self.data, self.afresh)
        await self.show(trail)

    async def show(self, trail: Growing) -> None:
        """Pictures and error of the model as it is now; then, when it is found, what it misses."""
        self.turn += 1
        turn = self.turn
        self.trail = trail
        self.desk.keep(self.data, self.model, trail)
        compared = await off_loop(trail.compared)
        if turn != self.turn:
            return
        self.pictures.show(compared, trail)
        self.verdict.error(self.told, compared, trail)
        self.chosen.grown(trail)
        await self._diagnose(trail, turn)

    async def _diagnose(self, trail: Growing, turn: int) -> None:
        self.search.cancelled = True  # the one before, which nobody waits for any more
        key = tuple(step.name for step in trail.steps)
        if key not in self.diagnoses:
            self.search = Counted(trail.effects)
            self.missing.wait(self.search)
            self.verdict.wait("Looking for what is missing")
            try:
                self.diagnoses[key] = await off_loop(trail.among(self.search).diagnosed)
            except Cancelled:
                return
            except Exception as error:
                if turn == self.turn:
                    self.missing.fail(message(error))
                return
        if turn == self.turn:
            self.verdict.found(self.told, self.diagnoses[key])
            await self.missing.show(self.diagnoses[key])

    def cancel(self) -> None:
        """Wait no longer for what is missing."""
        self.turn += 1
        self.search.cancelled = True
        self.verdict.cancelled()
        self.missing.cancelled()

    async def again(self) -> None:
        """Look for what is missing after all."""
        if self.trail is not None:
            await self._diagnose(self.trail, self.turn)

    async def add(self, step: Step) -> None:
        """The model gains an effect."""
        if self.trail is not None:
            if (effect := step.after.model.terms[-1].effect).expression:
                self.trail = self.trail.among({**self.trail.effects, effect.name: effect})
            await self.show(self.trail.with_step(step))

    async def undo(self) -> None:
        """The last effect is taken back."""
        if self.trail is not None and self.trail.steps:
            last = self.trail.steps[-1].name
            self.diagnoses = {key: found for key, found in self.diagnoses.items() if last not in key}
            await self.show(self.trail.undone())


def _nothing() -> None:
    """The empty record, and the way on."""
    why = (
        "Measure on the rig, which is simulated until you name your instruments; or open a table of your own with the "
        "field above."
    )
    with state("Nothing is measured yet", why):
        ui.button("Measure", icon="play_arrow", on_click=lambda: ui.navigate.to("/run?procedure=sweep"))


def _newest() -> str:
    """The newest run of one sensor; "" where there is none."""
    return next((run.run for run in runs() if run.rows and not run.bench.get("sensors")), "")
