"""What is missing: the candidates as cards, the next experiment, what is left unexplained, an effect of one's own."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

from nicegui import ui

from calibrations.criteria import SIGNIFICANT
from calibrations.discovery.verdict import Verdict
from calibrations.presentation.report.report import next_takes, next_words
from calibrations.presentation.text import capital, probability, rounded
from rig.web.parts import box, div, facts, failed, message, off_loop, waiting, words

if TYPE_CHECKING:
    from calibrations.discovery.patterns import Pattern
    from calibrations.discovery.results import Candidate, Diagnosis, Step
    from rig.web.pages.model import Workbench
    from rig.web.parts import Counted


FIRST = 6  # cards that are shown at once
PROGRESS_S = 0.15


class Missing:
    """The side of the page on which a person decides."""

    def __init__(self, page: Workbench, own: bool) -> None:
        self.page = page
        self.looked_at: Candidate | None = None
        self.tried: dict[str, Step[Any]] = {}
        with div("side"):
            words("What is missing", "title")
            self.cards = div("stack")
            self.own = Own(page)
        self.own.box.set_visibility(own)

    @property
    def unit(self) -> str:
        """Of the outputs."""
        return self.page.session.unit if self.page.session is not None else ""

    def wait(self, counted: Counted) -> None:
        """A search is on its way: how far it is."""
        self.cards.clear()
        self.own.begin()
        with self.cards, box():
            hint = waiting(counted.text)
            bar = ui.linear_progress(0.0, show_value=False).props("aria-label='share of the round'")

            def tell() -> None:
                hint.set_text(counted.text)
                bar.set_value(counted.share)

            ui.timer(PROGRESS_S, tell)
            ui.button("Cancel", icon="close", on_click=self.page.cancel).props("dense flat")
            for _ in range(3):
                ui.skeleton(height="58px").style("margin-top: 8px")

    def cancelled(self) -> None:
        """Nobody wanted to wait; an effect of one's own can be tried all the same."""
        self.cards.clear()
        with self.cards, box("stack"):
            words("The search was cancelled.", "quiet")
            ui.button("Look for what is missing", icon="search", on_click=self.page.again).props("dense outline")

    def fail(self, why: str) -> None:
        """The search ended in an error."""
        self.cards.clear()
        with self.cards:
            failed("The search for effects failed", why)

    async def show(self, result: Diagnosis[Any]) -> None:
        """The candidates, best first; the best is looked at where there is one to add."""
        self.cards.clear()
        self.tried, self.looked_at = {}, None
        self.own.begin(result.pattern if result.verdict is Verdict.UNEXPLAINED else None)
        missing = bool(result.missing)
        with self.cards:
            if not missing:
                self._nothing_to_add(result)
            if missing and result.judgement.provisional:
                words("Provisional: may change when further effects are added.", "quiet small")
            cards = [Card(self, c, result, missing and not k) for k, c in enumerate(result.candidates[:FIRST])]
            if len(result.candidates) > FIRST:
                self._others(result)
            below = div("stack")
        if missing and cards:
            await cards[0].open()
        if result.next_experiment is not None:
            with below:
                await self._next(result)

    def _nothing_to_add(self, result: Diagnosis[Any]) -> None:
        good = result.verdict is Verdict.ADEQUATE
        with box("verdict good" if good else "verdict doubt"):
            above = " Write your own effect above." if self.own.box.visible and result.residual_structure else ""
            words("Save the model, or see the candidates below." if good else f"No effect to add.{above} Candidates:")

    def _others(self, result: Diagnosis[Any]) -> None:
        rest = result.candidates[FIRST:]
        with ui.expansion(f"{len(rest)} more, less likely").props("dense"):
            for c in rest:
                Card(self, c, result, best=False)

    async def _next(self, result: Diagnosis[Any]) -> None:
        """The experiment that would tell, planned on the bench."""
        page, notes = self.page, list[str]()
        assert page.session is not None  # noqa: S101 a diagnosis is of a trail
        with box("note"):
            words("Next experiment", "title")
            hint = waiting("Planning it on the bench")
        try:
            found = await off_loop(page.session.with_next, result, notes.append)
            experiment = found.next_experiment
            assert experiment is not None  # noqa: S101 it had one before
            hint.set_text(" ".join([next_words(experiment), next_takes(experiment), *notes]))
            given = {name: _written(value) for name, value in experiment.settings.items()}
            to = f"/run?{urlencode({'procedure': experiment.procedure, **given})}"
            with hint.parent_slot.parent:  # type: ignore[union-attr]
                ui.button("Prepare it", icon="science", on_click=lambda: ui.navigate.to(to)).props("outline dense")
        except Exception as error:
            hint.set_text(message(error))

    async def look_at(self, c: Candidate) -> None:
        """Draw the candidate's curve through the residual."""
        self.looked_at = c
        step = await self.step_of(c)
        if step is not None and self.looked_at is c:
            self.page.pictures.consider(step)

    async def step_of(self, c: Candidate) -> Step[Any] | None:
        """The candidate fitted in full; None where that fails, which is told."""
        session = self.page.session
        if c.name not in self.tried and session is not None:
            try:
                self.tried[c.name] = await off_loop(session.tried, c.effect)
            except Exception as error:
                ui.notify(message(error), type="negative", multi_line=True)
        return self.tried.get(c.name)

    async def add_shown(self) -> None:
        """Add what is looked at."""
        if self.looked_at is not None:
            await self.add(self.looked_at)

    async def add(self, c: Candidate) -> None:
        """The model gains this effect."""
        step = await self.step_of(c)
        if step is not None:
            await self.page.add(step)


class Card:
    """One candidate: what it is, what it does to the error, and the button that adds it."""

    def __init__(self, side: Missing, c: Candidate, result: Diagnosis[Any], best: bool) -> None:
        self.side, self.c = side, c
        with div("card first" if best else "card"):
            with ui.element("button").classes("head").props("type=button aria-expanded=false") as self.head:
                words(c.name, "what")
                words(f"{rounded(result.held_out_before)} → {rounded(c.held_out_after)} ×", "fall small")
                ui.icon("expand_more")
            self.head.on("click", self.toggle)
            self.body = div("body")
            self.body.set_visibility(False)
            with self.body:
                self._told(result)
                with div("row-of"):
                    ui.button(f"Add {c.name}", icon="add", on_click=lambda: side.add(c)).props("dense unelevated")
                    ui.button("Show its curve", on_click=lambda: side.look_at(c)).props("dense flat")

    def _told(self, result: Diagnosis[Any]) -> None:
        c = self.c
        words(capital(c.effect.summary))
        words(formula(c.effect.formula, self.side.unit), "formula")
        with div("chance"):
            div("").style(f"width: {100 * c.probability:.1f}%")
        rivals = ", ".join(c.indistinguishable_from)
        facts(
            {
                "Symptom": capital(c.effect.symptom),
                **result.findings.data.facts(c, result),
                "Probability": chances(c),
                "Cannot be told from": rivals or "nothing in the catalogue",
                "Source": c.effect.source or "–",
            }
        )

    async def open(self) -> None:
        """Unfold the card, and draw the candidate's curve."""
        self.body.set_visibility(True)
        self.head.props("aria-expanded=true")
        await self.side.look_at(self.c)

    async def toggle(self) -> None:
        """Unfold or fold."""
        if self.body.visible:
            self.body.set_visibility(False)
            self.head.props("aria-expanded=false")
        else:
            await self.open()


def _written(value: object) -> str:
    """A setting as it is written on the command line."""
    return ",".join(f"{part:g}" for part in value) if isinstance(value, (list, tuple)) else str(value)


def chances(c: Candidate) -> str:
    """The probability of a candidate, and the chance of so large a gain where nothing is missing."""
    beyond = "" if c.p_value < SIGNIFICANT else ", which is not significant"
    return f"{share(c.probability)}; by chance {probability(c.p_value)}{beyond}"


def share(probability: float) -> str:
    """A probability, which is only approximate: neither certain nor impossible."""
    for limit, text in ((0.999, "above 99.9 %"), (0.99, "above 99 %")):
        if probability > limit:
            return text
    return "below 0.1 %" if probability < 1e-3 else f"{100 * probability:.2g} %"


def formula(text: str, unit: str) -> str:
    """A formula with the data's unit; a remark beside it comes in a line of its own, as a card is narrow."""
    return re.sub(r" {3,}", "\n", text.replace("{out}", unit)).replace("\n\n", "\n")


# An effect of one's own: a line of arithmetic, tried as it is written, with its faults pointed at.


PAUSE_S = 0.35  # without a keystroke, before what is written is tried
HELP = (
    "alpha, beta (rad), alpha_deg, beta_deg, ax ay az (g), t (s), temperature (°C), supply (V), direction, any other "
    "column; every other name is a parameter. Before +=: v, vx, vy, vz, alpha_deg or beta_deg."
)


class Own:
    """The field, its preview and its errors."""

    def __init__(self, page: Workbench) -> None:
        self.page, self.asked = page, 0
        self.step: Step[Any] | None = None
        with box("own") as self.box:
            words("An effect of your own", "title")
            self.hint = words("", "quiet small")
            self.text = ui.input("Expression, such as a*sin(5*beta) + b*cos(5*beta)").props("dense debounce=350")
            self.text.classes("formula").on_value_change(self.tries)
            self.name = ui.input("Name", value="my-effect", on_change=self.tries).props("dense debounce=350")
            self.said = words("", "fault")
            self.fall = words("", "fall small")
            with ui.element("div").classes("row-of"):
                self.add = ui.button("Add it", icon="add", on_click=self._add).props("dense unelevated")
                with ui.button(icon="help_outline").props("flat round dense aria-label='What can be written'"):
                    ui.tooltip(HELP).props("max-width=360px")
        self.add.disable()

    def begin(self, pattern: Pattern | None = None) -> None:
        """A new state of the model; what is left unexplained proposes itself as an expression."""
        self.step, self.asked = None, self.asked + 1
        self.add.disable()
        self.said.set_text("")
        self.fall.set_text("")
        proposed = pattern is not None and bool(pattern.expression)
        self.box.classes(add="proposed" if proposed else "", remove="" if proposed else "proposed")
        self.hint.set_text("What is left looks like this; try it, or write something better." if proposed else "")
        self.text.set_value(pattern.expression if pattern is not None and proposed else "")
        if pattern is not None and proposed:
            self.name.set_value(pattern.name)

    async def tries(self) -> None:
        """Fit what is written, and show its curve and what it does to the error; or where it is wrong."""
        self.asked += 1
        asked, text, session = self.asked, str(self.text.value or "").strip(), self.page.session
        self.step = None
        self.add.disable()
        self.said.set_text("")
        self.fall.set_text("")
        if not text or session is None:
            return
        self.fall.set_text("trying ...")
        try:
            effect = session.written(str(self.name.value or "").strip(), text)
            step = await off_loop(session.tried, effect)
            unseen = await off_loop(lambda: step.after.held_out_excess)
        except Exception as error:
            if asked == self.asked:
                self.fall.set_text("")
                self.said.set_text(message(error))
            return
        if asked == self.asked:
            self._preview(step, unseen)

    def _preview(self, step: Step[Any], unseen: float) -> None:
        self.step = step
        before, after = step.before.pooled_excess, step.after.pooled_excess
        self.fall.set_text(
            f"error {rounded(before)} → {rounded(after)} × the noise floor; held-out error "
            f"{rounded(step.held_out_before)} → {rounded(unseen)} ×"
        )
        self.page.pictures.consider(step)
        self.add.enable()

    async def _add(self) -> None:
        if self.step is not None:
            await self.page.add(self.step)
