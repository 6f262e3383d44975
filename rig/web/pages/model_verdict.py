"""The verdict: one sentence, and the two numbers that it rests on."""

from __future__ import annotations

from nicegui import ui

from calibrations.compare import Comparison
from calibrations.diagnose import Diagnosis
from calibrations.numerals import plain
from calibrations.pictures.view import milli, pooled_mg, rows_of
from calibrations.reports.verdict import headline
from calibrations.reports.words import capital
from calibrations.search.held_out import held_out_excess
from rig.analysis.trail import Trail
from rig.web.parts import box, div, words

LOOKS = {"adequate": "good", "effect-missing": "bad", "ambiguous": "doubt", "unexplained": "doubt"}
MOST_PLACES = 3


class Verdict:
    """What the page says first."""

    def __init__(self) -> None:
        with box("verdict").props("role=status aria-live=polite") as self.box:
            with div("grow"):
                self.headline = words("", "headline")
                self.detail = words("", "detail quiet small")
                with self.detail:
                    self.whole = ui.tooltip("").props("max-width=640px")
            self.seen, self.unseen, self.floor = (_figure(what) for what in ("error", "on unseen rows", "noise floor"))

    def error(self, compared: Comparison, trail: Trail) -> None:
        """How large the error is, and where it is largest: known before anything is diagnosed."""
        fit = compared.fit
        (error, floor), unit = pooled_mg(fit), milli(fit)
        self.seen.set_text(f"{plain(fit.pooled_excess)} × ({plain(error, 2)} {unit})")
        self.unseen.set_text(f"{plain(held_out_excess(trail.end))} ×")
        self.floor.set_text(f"{plain(floor, 2)} {unit}")
        places = "; ".join(place.text for place in compared.fails[:MOST_PLACES])
        rows = f"{compared.fit.model.name} on {fit.table.n} {rows_of(fit.table)}"
        self._tell(f"{rows}. Fails at {places}." if places else f"{rows}. No place stands out.")

    def wait(self, what: str) -> None:
        """The verdict is on its way."""
        self.headline.set_text(f"{what} ...")
        self.box.classes(remove="good bad doubt")

    def found(self, result: Diagnosis) -> None:
        """The verdict."""
        text = capital(headline(result)).replace(" x the noise", " × the noise")
        self.headline.set_text(text)
        if result.caution:
            self._tell(f"But {result.caution}. {self.detail.text}")
        self.box.classes(remove="good bad doubt", add=LOOKS[result.verdict])

    def _tell(self, text: str) -> None:
        """A line; all of it when it is pointed at."""
        self.detail.set_text(text.replace(" x the noise", " × the noise"))
        self.whole.set_text(self.detail.text)


def _figure(what: str) -> ui.label:
    """A number, and under it what it is."""
    with div("figure"):
        value = words("...", "value")
        words(what, "quiet small")
    return value
