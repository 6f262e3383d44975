"""The verdict: one sentence, and the numbers that it rests on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from calibrations.discovery.verdict import Verdict
from rig.web.parts import box, div, for_page, words

if TYPE_CHECKING:
    from calibrations.discovery.results import Comparison, Diagnosis
    from rig.services.session import ModelSession

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
