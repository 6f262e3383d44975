"""The verdict: one sentence, and the numbers that it rests on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from calibrations.reports.words import capital
from rig.web.parts import box, div, words
from rig.web.told import for_page

if TYPE_CHECKING:
    from rig.analysis.growing import Diagnosis, Growing
    from rig.web.pages.model_words import Words

LOOKS = {"adequate": "good", "effect-missing": "bad", "ambiguous": "doubt", "unexplained": "doubt"}


class Verdict:
    """What the page says first."""

    def __init__(self) -> None:
        with box("verdict").props("role=status aria-live=polite") as self.box:
            with div("grow"):
                self.headline = words("", "headline")
                self.detail = words("", "detail quiet small")
                with self.detail:
                    self.whole = ui.tooltip("").props("max-width=640px")
            self.numbers = div("row-of numbers")

    def error(self, told: Words, compared: Any, trail: Growing) -> None:
        """How large the error is, and where it is largest: known before anything is diagnosed."""
        self.numbers.clear()
        with self.numbers:
            for what, value in told.numbers(compared, trail).items():
                with div("figure"):
                    words(value, "value")
                    words(what, "quiet small")
        self._tell(told.detail(compared))

    def wait(self, what: str) -> None:
        """The verdict is on its way."""
        self.headline.set_text(f"{what} ...")
        self.box.classes(remove="good bad doubt")

    def found(self, told: Words, result: Diagnosis) -> None:
        """The verdict."""
        self.headline.set_text(for_page(capital(told.verdict(result))))
        if caution := told.caution(result):
            self._tell(f"But {caution}. {self.detail.text}")
        self.box.classes(remove="good bad doubt", add=LOOKS[result.verdict])

    def cancelled(self) -> None:
        """Nobody wanted to wait for it."""
        self.headline.set_text("Not diagnosed")
        self.box.classes(remove="good bad doubt")

    def _tell(self, text: str) -> None:
        """A line; all of it when it is pointed at."""
        self.detail.set_text(for_page(text))
        self.whole.set_text(self.detail.text)
