"""Model: see where it fails, click the missing effect, watch the error fall."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

from nicegui import ui

from calibrations.discovery.verdict import Verdict
from rig.errors import RecordError
from rig.services.exclusion import numbered_run
from rig.web.desk import Desk, runs
from rig.web.frame import Key, frame
from rig.web.pages import run_record
from rig.web.pages.model_choice import Choice
from rig.web.pages.model_missing import Missing
from rig.web.pages.model_noise import NoisePictures
from rig.web.pages.model_pictures import Pictures
from rig.web.parts import Cancelled, Counted, box, div, failed, for_page, message, off_loop, state, words

if TYPE_CHECKING:
    from calibrations.discovery.results import Comparison, Diagnosis, Step
    from rig.services.session import ModelSession


def register(desk: Desk) -> None:
    """The page at /."""

    @ui.page("/")
    def page(data: str = "", model: str = "") -> None:
        Workbench(desk, data, model).build()


class Workbench:
    """One open page: data, the model that grows on it, pictures, and what is missing."""

    def __init__(self, desk: Desk, data: str, model: str) -> None:
        self.desk, self.data, self.model = desk, data, model
        self.session: ModelSession | None = None
        self.search = Counted({})
        self.turn = 0  # answers to questions that were asked before the last one are let go
        self.diagnoses: dict[tuple[str, ...], Diagnosis[Any]] = {}

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
            self.verdict = VerdictBox()
            self.analysis = div("analysis")
        self.keys = keys
        self._lay_out("rows")
        ui.timer(0.0, self.open, once=True)

    def _lay_out(self, form: str) -> None:
        """The places of pictures and candidates, as the kind of data wants them."""
        self.analysis.clear()
        with self.analysis:
            rows = form == "rows"
            self.pictures: Pictures | NoisePictures = Pictures(self._leaving_out()) if rows else NoisePictures()
            self.missing = Missing(self, own=rows)
        self.keys["a"] = Key("add the effect that is looked at", self.missing.add_shown)
        self.keys["u"] = Key("undo the last effect", self.undo)
        self.keys["x"] = Key("the next axis", self.pictures.next_axis)
        self.keys["g"] = Key("V, or g", self.pictures.other_unit)
        self.keys["l"] = Key("leave out what is selected", self.pictures.leave_selected)
        self.keys["Escape"] = Key("select nothing", partial(self.pictures.select, []))

    def _leaving_out(self) -> Callable[[Sequence[int]], None] | None:
        """What asks why selected poses are to be left out; None where the data are no run of the rig."""
        return partial(run_record.ask, self.data, done=self.afresh) if numbered_run(self.data) else None

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
            session = await off_loop(self.desk.open, self.data, self.model)
        except Exception as error:
            self.body.clear()
            with self.body:
                failed(f"{self.data} cannot be looked at with this model", message(error))
            return
        self._lay_out(session.data.form)
        self.chosen.opened(session)
        for note in session.notes:
            with self.notes, box("note"):
                words(note, "small")
        if found := run_record.left_out(self.data):
            with self.notes, ui.expansion(f"{len(found)} left out of every analysis").props("dense").classes("box"):
                run_record.listed(self.data, self.afresh)
        await self.show(session)

    async def show(self, session: ModelSession) -> None:
        """Pictures and error of the model as it is now; then, when it is found, what it misses."""
        self.turn += 1
        turn = self.turn
        self.session = session
        self.desk.keep(self.data, self.model, session)
        compared = await off_loop(session.compared)
        if turn != self.turn:
            return
        self.pictures.show(compared, session)
        self.verdict.error(compared, session)
        self.chosen.grown(session)
        await self._diagnose(session, turn)

    async def _diagnose(self, session: ModelSession, turn: int) -> None:
        self.search.cancelled = True  # the one before, which nobody waits for any more
        key = session.names
        if key not in self.diagnoses:
            self.search = Counted(session.effects)
            self.missing.wait(self.search)
            self.verdict.wait("Looking for what is missing")
            try:
                self.diagnoses[key] = await off_loop(session.among(self.search).diagnosed)
            except Cancelled:
                return
            except Exception as error:
                if turn == self.turn:
                    self.missing.fail(message(error))
                return
        if turn == self.turn:
            self.verdict.found(self.diagnoses[key])
            await self.missing.show(self.diagnoses[key])

    def cancel(self) -> None:
        """Wait no longer for what is missing."""
        self.turn += 1
        self.search.cancelled = True
        self.verdict.cancelled()
        self.missing.cancelled()

    async def again(self) -> None:
        """Look for what is missing after all."""
        if self.session is not None:
            await self._diagnose(self.session, self.turn)

    async def add(self, step: Step[Any]) -> None:
        """The model gains an effect."""
        if self.session is not None:
            if (effect := step.after.model.terms[-1].effect).expression:
                self.session = self.session.among({**self.session.effects, effect.name: effect})
            await self.show(self.session.with_step(step))

    async def undo(self) -> None:
        """The last effect is taken back."""
        if self.session is not None and self.session.steps:
            last = self.session.steps[-1].name
            self.diagnoses = {key: found for key, found in self.diagnoses.items() if last not in key}
            await self.show(self.session.undone())


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


# The verdict: one sentence, and the numbers that it rests on.


LOOKS = {
    Verdict.ADEQUATE: "good",
    Verdict.EFFECT_MISSING: "bad",
    Verdict.AMBIGUOUS: "doubt",
    Verdict.UNEXPLAINED: "doubt",
    Verdict.NO_RESPONSE: "bad",
}
MOST_PLACES = 3


class VerdictBox:
    """The head of the page: the verdict and its numbers."""

    def __init__(self) -> None:
        with box("verdict").props("role=status aria-live=polite") as self.box:
            with div("grow"):
                self.headline = words("", "headline")
                self.detail = words("", "detail quiet small")
                with self.detail:
                    self.whole = ui.tooltip("").props("max-width=640px")
            self.numbers = div("row-of numbers")

    def error(self, compared: Comparison[Any], session: ModelSession) -> None:
        """How large the error is, and where it is largest: known before anything is diagnosed."""
        self.numbers.clear()
        with self.numbers:
            for name, value in session.data.figures(compared.fit).items():
                with div("figure"):
                    words(value, "value")
                    words(name, "quiet small")
        self._show(_failing(compared))

    def wait(self, what: str) -> None:
        """The verdict is on its way."""
        self.headline.set_text(f"{what} ...")
        self.box.classes(remove="good bad doubt")

    def found(self, result: Diagnosis[Any]) -> None:
        """The verdict."""
        self.headline.set_text(for_page(result.judgement.text))
        if result.caution:
            self._show(f"But {result.caution}. {self.detail.text}")
        self.box.classes(remove="good bad doubt", add=LOOKS[result.verdict])

    def cancelled(self) -> None:
        """The search was cancelled."""
        self.headline.set_text("Not diagnosed")
        self.box.classes(remove="good bad doubt")

    def _show(self, text: str) -> None:
        """A line; all of it when it is pointed at."""
        self.detail.set_text(for_page(text))
        self.whole.set_text(self.detail.text)


def _failing(compared: Comparison[Any]) -> str:
    """The data, and the places where the model fails."""
    places = "; ".join(place.text for place in compared.fails[:MOST_PLACES])
    what = f"{compared.fit.model.name} on {compared.data.description}"
    text = f"{what}. Fails: {places}." if places else f"{what}. No place stands out."
    return " ".join(filter(None, (text, compared.data.note)))
