"""The verdict on the Model page: one sentence and its numbers.

During a search the box shows the verdict of the comparison, as provisional: that the model is incomplete. Where only
the search can decide, it shows no verdict until then.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import TYPE_CHECKING, Any

from nicegui import ui

from calibrations.discovery.verdict import Verdict
from calibrations.presentation.charts.discovery import brief
from calibrations.presentation.views import view_of
from rig.web.parts import PROGRESS_S, afresh, box, div, for_page, words

if TYPE_CHECKING:
    from calibrations.discovery.results import Comparison, Diagnosis
    from calibrations.discovery.verdict import Judgement
    from rig.services.search import CountedEffects
    from rig.services.session import ModelSession
    from rig.web.calculations import Visit

SEARCHING = "Searching for missing effects"
FIRST_LINES = 200  # characters of the details that every width shows
LOOKS = {
    Verdict.ADEQUATE: "good",
    Verdict.EFFECT_MISSING: "bad",
    Verdict.AMBIGUOUS: "doubt",
    Verdict.UNEXPLAINED: "doubt",
    Verdict.INCOMPLETE: "bad",
    Verdict.NO_RESPONSE: "bad",
}


class VerdictBox:
    """The box with the verdict and its numbers."""

    def __init__(self) -> None:
        self.described = ""  # the model and the data
        self.watched: Visit | None = None
        self.search: CountedEffects | None = None
        self.begun_s = 0.0
        with box("verdict").props("role=status aria-live=polite") as self.box:
            with div("grow"):
                with div("row-of"):
                    self.headline = words("", "headline")
                    self.provisional = words("provisional", "chip plain")
                self.progress = words("", "small").props("aria-live=off")  # it changes each second
                self.detail = words("", "detail quiet small")
                self.more = ui.button("Whole verdict", on_click=self._unfold).props("flat dense size=sm")
                self.more.set_visibility(False)
            self.numbers = div("row-of numbers")
            ui.timer(PROGRESS_S, self._tick)
        self._end_search()

    def offer_cancel(self, cancel: Callable[[], None]) -> None:
        """A button that cancels the first fit, in place of the numbers."""
        with self.numbers:
            ui.button("Cancel", icon="close", on_click=cancel).props("dense flat")

    def error(self, compared: Comparison[Any], session: ModelSession[Any]) -> None:
        """Show the error of a model and where it is largest, in place of the verdict on the model before."""
        self.wait(SEARCHING)
        with afresh(self.numbers):
            for name, value in view_of(session.data).figures(compared.fit).items():
                with div("figure"):
                    words(value, "value")
                    words(name, "quiet small")
        self.described = _show_failing(compared)
        self._show(self.described)

    def wait(self, activity: str, visit: Visit | None = None) -> None:
        """Show that the verdict is not known yet; with `visit`, what its analysis does and its time."""
        self.headline.set_text(f"{activity} ...")
        self.box.classes(remove="good bad doubt")
        self._end_search()
        self.watched, self.begun_s = visit, monotonic()
        if visit is not None:
            visit.doing = activity

    def searching(self, judgement: Judgement | None, search: CountedEffects) -> None:
        """Show the progress of a search, and the verdict before it, if there is one."""
        self.wait(SEARCHING)
        self.search = search
        self.progress.set_visibility(True)
        if judgement is not None:
            self.headline.set_text(for_page(judgement.summary))
            self.box.classes(add=LOOKS[judgement.verdict])
            self.provisional.set_visibility(True)
            self.progress.set_text(f"{SEARCHING} ...")

    def _end_search(self) -> None:
        """Remove what is shown during a search only."""
        self.search = None
        self.progress.set_text("")
        for part in (self.provisional, self.progress):
            part.set_visibility(False)

    def _tick(self) -> None:
        """Show the step of the analysis, and its seconds after the first."""
        if not (seconds := int(monotonic() - self.begun_s)):
            return
        if self.watched is not None:
            self.headline.set_text(f"{self.watched.doing} ... {seconds} s")
        if self.search is not None:
            searching = f"{SEARCHING}. " if self.provisional.visible else ""  # else the headline says it
            self.progress.set_text(f"{searching}{self.search.text}, {seconds} s")

    def found(self, result: Diagnosis[Any]) -> None:
        """Show the verdict."""
        self._end_search()
        judgement = result.judgement
        self.headline.set_text(for_page(judgement.summary))
        caution = f"Caution: {result.caution}." if result.caution else ""
        self._show(" ".join(filter(None, (caution, judgement.rest, self.described))))
        self.box.classes(remove="good bad doubt", add=LOOKS[result.verdict])

    def show_no_diagnosis(self) -> None:
        """Show that the search was cancelled or has failed."""
        self._end_search()
        self.headline.set_text("Not diagnosed")
        self.box.classes(remove="good bad doubt")

    def _show(self, text: str) -> None:
        """Show the first lines of a text, and a button that shows the others."""
        self.detail.set_text(for_page(text))
        self.detail.classes(remove="whole")
        self.more.set_visibility(len(self.detail.text) > FIRST_LINES)

    def _unfold(self) -> None:
        self.detail.classes(add="whole")
        self.more.set_visibility(False)


def _show_failing(compared: Comparison[Any]) -> str:
    """The model and the data; the places where it fails have a row of their own."""
    subject = f"{brief(compared.fit.model.name)} on {compared.data.description}."
    text = subject if compared.fails else f"{subject} No place fails."
    return " ".join(filter(None, (text, compared.data.note)))
