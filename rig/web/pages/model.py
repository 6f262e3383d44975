"""Model: see where it fails, click the missing effect, watch the error fall."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from urllib.parse import urlencode

from nicegui import ui

from calibrations.diagnose import Diagnosis
from calibrations.discover import Added
from rig.analysis.trail import Trail
from rig.web.counted import Counted
from rig.web.desk import Desk, runs
from rig.web.frame import Key, frame
from rig.web.pages.model_choice import Choice
from rig.web.pages.model_missing import Missing
from rig.web.pages.model_pictures import Pictures
from rig.web.pages.model_verdict import Verdict
from rig.web.parts import box, div, failed, off_loop, state, words
from rig.web.told import message


def register(desk: Desk) -> None:
    """The page at /."""

    @ui.page("/")
    def page(data: str = "", model: str = "") -> None:
        Workbench(desk, data, model).build()


class Workbench:
    """One open page: data, the model that grows on it, pictures, and what is missing."""

    def __init__(self, desk: Desk, data: str, model: str) -> None:
        self.desk, self.data, self.model = desk, data, model
        self.trail: Trail | None = None
        self.turn = 0  # answers to questions that were asked before the last one are let go
        self.diagnoses: dict[tuple[str, ...], Diagnosis] = {}

    def build(self) -> None:
        """The page, laid out; what takes long is asked for as soon as the browser shows it."""
        self.data = self.data or _newest()
        with frame(self.desk, "/") as keys:
            self.chosen = Choice(self)
            self.body = div("stack")
        with self.body:
            if not self.data:
                _nothing()
                return
            self.notes = div("stack")
            self.verdict = Verdict()
            with div("analysis"):
                self.pictures = Pictures()
                self.missing = Missing(self)
        keys["a"] = Key("add the effect that is looked at", self.missing.add_shown)
        keys["u"] = Key("undo the last effect", self.undo)
        keys["x"] = Key("the next axis", self.pictures.next_axis)
        keys["g"] = Key("V, or g", self.pictures.other_unit)
        keys["Escape"] = Key("select nothing", partial(self.pictures.select, []))
        ui.timer(0.0, self.open, once=True)

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
        self.chosen.opened(trail)
        for note in trail.notes:
            with self.notes, box("note"):
                words(note, "small")
        await self.show(trail)

    async def show(self, trail: Trail) -> None:
        """Pictures and error of the model as it is now; then, when it is found, what it misses."""
        self.turn += 1
        turn = self.turn
        self.trail = trail
        self.desk.keep(self.data, self.model, trail)
        compared = await off_loop(trail.compared)
        if turn != self.turn:
            return
        self.pictures.show(compared.fit, trail)
        self.verdict.error(compared, trail)
        self.chosen.grown(trail)
        await self._diagnose(trail, turn)

    async def _diagnose(self, trail: Trail, turn: int) -> None:
        key = tuple(step.name for step in trail.steps)
        counted = Counted(trail.effects)
        if key not in self.diagnoses:
            self.missing.wait(counted)
            self.verdict.wait("Looking for what is missing")
            try:
                self.diagnoses[key] = await off_loop(replace(trail, effects=counted).diagnosed)
            except Exception as error:
                if turn == self.turn:
                    self.missing.fail(message(error))
                return
        if turn == self.turn:
            self.verdict.found(self.diagnoses[key])
            await self.missing.show(self.diagnoses[key])

    async def add(self, step: Added) -> None:
        """The model gains an effect."""
        if self.trail is not None:
            if (effect := step.after.model.terms[-1].effect).expression:
                self.trail = replace(self.trail, effects={**self.trail.effects, effect.name: effect})
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
    """The newest run that a model can be fitted to; "" where there is none."""
    kinds = ("poses", "positions", "motion", "rates")
    return next((run.run for run in runs() if run.kind in kinds and run.rows and not run.bench.get("sensors")), "")
