"""Missing effects on the model page: candidates, next experiment, and an effect of your own."""

from __future__ import annotations

from functools import partial
from time import monotonic
from typing import TYPE_CHECKING, Any

from nicegui import ui
from nicegui.element import Element
from nicegui.events import ValueChangeEventArguments

from calibrations.discovery.summary import certainty_of
from calibrations.discovery.verdict import Verdict
from calibrations.presentation.formula import formula_html
from calibrations.presentation.views import view_of
from calibrations.text import capital, probability, rounded
from rig.web.calculations import off_loop
from rig.web.pages.next_experiment import show_next
from rig.web.parts import (
    PROGRESS_S,
    afresh,
    box,
    button,
    div,
    facts,
    message,
    notify_error,
    show_error,
    waiting,
    words,
)

if TYPE_CHECKING:
    from calibrations.discovery.findings import Candidate, Step
    from calibrations.discovery.patterns import Pattern
    from calibrations.discovery.results import Diagnosis
    from rig.services.search import CountedEffects
    from rig.services.session import ModelSession
    from rig.web.pages.model import Workbench


FIRST = 6  # cards without unfolding the rest
MOST_CHIPS = 4  # added effects without folding them
OWN_NAME = "my-effect"


class Missing:
    """The candidates, with buttons to add them."""

    def __init__(self, page: Workbench, allows_own: bool) -> None:
        self.page = page
        self.looked_at: Candidate | None = None
        self.tried: dict[str, Step[Any]] = {}
        self.unfolded = False  # the added effects, where they are many
        with div("side"):
            words("Missing effects", "title")
            self.added = div("row-of added")
            self.steps = div("")
            self.cards = div("stack")
            self.own = OwnEffect(page)
        self.own.box.set_visibility(allows_own)

    @property
    def unit(self) -> str:
        """Unit of the outputs."""
        return self.page.session.unit if self.page.session is not None else ""

    def wait(self, counted: CountedEffects) -> None:
        """Show the progress of the search."""
        self.own.begin()
        with afresh(self.cards), box():
            hint = waiting(counted.text)
            bar = ui.linear_progress(0.0, show_value=False).props("aria-label='progress of the round'")

            begun_s = monotonic()

            def tell() -> None:
                hint.set_text(f"{counted.text}, {monotonic() - begun_s:.0f} s")
                bar.set_value(counted.share)
                compares = counted.share == 1  # of unknown length
                bar.props(add="indeterminate" if compares else "", remove="" if compares else "indeterminate")

            ui.timer(PROGRESS_S, tell)
            button("Cancel", "close", self.page.cancel, "dense flat")
            for _ in range(3):
                ui.skeleton(height="58px").style("margin-top: 8px")

    def grown(self, session: ModelSession[Any]) -> None:
        """Show the added effects; each can be removed."""
        self.added.clear()
        if not session.steps:
            return
        with self.added, self._place_of_chips(len(session.names)):
            for name in session.names:
                removal = ui.button(name, on_click=partial(self.page.remove, name))
                with removal.props(f'outline dense no-caps icon-right=close aria-label="Remove {name}"'):
                    ui.tooltip(f"Remove {name}; the others are fitted again")

    def _place_of_chips(self, count: int) -> Element:
        """A line for a few chips; many are folded, so that the candidates stay in view."""
        if count <= MOST_CHIPS:
            words("Added:", "quiet small")
            return div("row-of")
        title = f"Added: {count} effects"
        return ui.expansion(title, value=self.unfolded, on_value_change=self._keep_fold).props("dense").classes("grow")

    def _keep_fold(self, event: ValueChangeEventArguments[bool]) -> None:
        self.unfolded = bool(event.value)

    def discovering(self, name: str, at: int, total: int) -> None:
        """Show the present step of the discovery, with a button that ends it after this step."""
        with afresh(self.steps), box("stack").props("role=status"):
            words(f"Step {at} of {total}: adding {name}")
            ui.linear_progress((at - 1) / total, show_value=False).props("aria-label='progress of the discovery'")
            button("Stop after this step", "stop", self._stop, "dense flat")

    def discovered(self) -> None:
        """The discovery has ended."""
        self.steps.clear()

    def _stop(self) -> None:
        self.page.discovering = False

    def cancelled(self) -> None:
        """The search was cancelled; an effect of your own can still be tested."""
        with afresh(self.cards), box("stack"):
            words("The search was cancelled.", "quiet")
            button("Search for missing effects", "search", self.page.again)

    def fail(self, reason: str) -> None:
        """The search ended in an error."""
        with afresh(self.cards):
            show_error("The search for effects failed", reason)

    async def show(self, result: Diagnosis[Any]) -> None:
        """Show the candidates, best first, and the curve of the best if an effect is missing."""
        self.tried, self.looked_at = {}, None
        if not self.own.written:  # a person may have written one meanwhile
            self.own.begin(result.pattern if result.verdict is Verdict.UNEXPLAINED else None)
        missing = bool(result.missing)
        with afresh(self.cards):
            if not missing:
                self._show_nothing_to_add(result)
            if missing and result.judgement.provisional:
                words("Provisional: may change when further effects are added.", "quiet small")
            if len(result.missing) > 1 and result.findings.steps and not self.page.discovering:
                title = f"Discover: add all {result.missing_count}"
                button(title, "auto_fix_high", self.page.discover)
            cards = self._show_first(result)
            if len(result.candidates) > FIRST:
                self._show_further(result)
            candidate_box = div("stack")
        if missing and cards:
            cards[0].open()
            await self.look_at(cards[0].c)
        if result.next_experiment is not None and not self.page.discovering:  # the steps do not wait for a plan
            with candidate_box:
                await self._show_next(result)

    async def _show_next(self, result: Diagnosis[Any]) -> None:
        session = self.page.session
        assert session is not None  # noqa: S101 a diagnosis is of a trail
        await show_next(self.page.visit, lambda notify: session.with_next(result, notify).next_experiment)

    def _show_nothing_to_add(self, result: Diagnosis[Any]) -> None:
        is_adequate = result.verdict is Verdict.ADEQUATE
        with box("verdict good" if is_adequate else "verdict doubt"):
            place = "above" if self.own.proposed else "below"
            hint = f" Write your own effect {place}." if self.own.box.visible and result.residual_structure else ""
            words(
                "Save the model, or see the candidates below."
                if is_adequate
                else f"No effect to add.{hint} Candidates:"
            )

    def _show_first(self, result: Diagnosis[Any]) -> list[Card]:
        """The cards of the best candidates: first those that are missing, in the order in which they are added."""
        if result.candidates:
            order = "Missing, in the order in which they are added. " if len(result.missing) > 1 else ""
            unseen = result.findings.data.unseen
            words(f"{order}Right: error on {unseen}, without → with this effect alone.", "quiet small")
        cards: list[Card] = []
        for k, c in enumerate(result.candidates[:FIRST]):
            is_missing = c.name in result.missing
            if cards and not is_missing and cards[-1].c.name in result.missing:
                words("Other candidates, which are not missing:", "quiet small")
            cards.append(Card(self, c, result, best=bool(result.missing) and not k))
        return cards

    def _show_further(self, result: Diagnosis[Any]) -> None:
        further = result.candidates[FIRST:]
        expansion = ui.expansion(f"{len(further)} more, less likely").props("dense")

        def fill() -> None:
            if not expansion.default_slot.children:
                with expansion:
                    for c in further:
                        Card(self, c, result, best=False)

        expansion.on_value_change(fill)

    async def look_at(self, c: Candidate, look: bool = False) -> None:
        """Draw the candidate in the residual; with `look`, against the column that it follows."""
        self.looked_at = c
        step = await self.step_of(c)
        if step is not None and self.looked_at is c:
            self.page.pictures.consider(step, look)

    async def step_of(self, c: Candidate) -> Step[Any] | None:
        """The complete fit of a candidate; None if it fails, with a message."""
        session = self.page.session
        if c.name not in self.tried and session is not None:
            try:
                self.tried[c.name] = await off_loop(session.tried, c.effect)
            except Exception as error:
                notify_error(error)
        return self.tried.get(c.name)

    async def add_shown(self) -> None:
        """Add the shown candidate."""
        if self.looked_at is not None:
            await self.add(self.looked_at)

    async def add(self, c: Candidate) -> None:
        """Add this effect to the model."""
        step = await self.step_of(c)
        if step is not None:
            await self.page.add(step)


class Card:
    """One candidate: error before and after; unfolded, its description and the button to add it."""

    def __init__(self, side: Missing, c: Candidate, result: Diagnosis[Any], best: bool) -> None:
        self.side, self.c, self.result = side, c, result
        with div("card first" if best else "card"):
            with ui.element("button").classes("head").props("type=button aria-expanded=false") as self.head:
                words(c.name, "what")
                words(f"{rounded(result.held_out_before)} → {rounded(c.held_out_after)} ×", "fall small")
                ui.icon("expand_more")
            self.head.on("click", self.toggle)
            self.body = div("body")
            self.body.set_visibility(False)

    def _describe(self) -> None:
        c, result, side = self.c, self.result, self.side
        words(capital(c.effect.summary))
        with div("row-of"):
            button(f"Add {c.name}", "add", lambda: side.add(c), "dense unelevated")
            ui.button("Show the curve", on_click=lambda: side.look_at(c, look=True)).props("dense flat")
        ui.html(formula_html(c.effect.formula, side.unit), sanitize=False).classes("formula")  # it escapes
        with div("chance"):
            div("").style(f"width: {100 * (1 - c.p_value):.1f}%")
        rivals = ", ".join(c.indistinguishable_from)
        facts(
            {
                "Symptom": capital(c.effect.symptom),
                **view_of(result.findings.data).facts(c, result),
                "Certainty": certainty_of(c),
                "Cannot be separated from": rivals or "nothing in the catalogue",
                "p-value": f"{probability(c.p_value)}, the chance of so large an improvement if no effect is missing",
                "Source": c.effect.source or "–",
            }
        )

    def open(self) -> None:
        """Unfold the card; the pictures stay as they are."""
        if not self.body.default_slot.children:
            with self.body:
                self._describe()
        self.body.set_visibility(True)
        self.head.props("aria-expanded=true")

    def toggle(self) -> None:
        """Unfold or fold the card."""
        if self.body.visible:
            self.body.set_visibility(False)
            self.head.props("aria-expanded=false")
        else:
            self.open()


# An effect of your own: an expression, tested as you type, with its errors.


HELP = (
    "alpha, beta (rad), alpha_deg, beta_deg, ax ay az (g), t (s), temperature (°C), supply (V), direction, any other "
    "column; every other name is a parameter. Before +=: v, vx, vy, vz, alpha_deg or beta_deg. Or a curve of unknown "
    "form: free:PLACE, such as free:own-response."
)


class OwnEffect:
    """Field, preview and errors of an expression."""

    def __init__(self, page: Workbench) -> None:
        self.page, self.turn = page, 0
        self.step: Step[Any] | None = None
        self.proposal = ""
        self.proposed = False  # the box is then above the candidates
        with box("own") as self.box:
            words("Your own effect", "title")
            self.hint = words("", "quiet small")
            self.text = ui.input("Expression, such as a*sin(5*beta) + b*cos(5*beta)").props("dense debounce=350")
            self.text.classes("formula").on_value_change(self.tries)
            self.name = ui.input("Name", value=OWN_NAME, on_change=self.tries).props("dense debounce=350")
            self.fault = words("", "fault")
            self.fall = words("", "fall small")
            with ui.element("div").classes("row-of"):
                self.add = button("Add effect", "add", self._add, "dense unelevated")
                with ui.button(icon="help_outline").props("flat round dense aria-label='Columns and functions'"):
                    ui.tooltip(HELP).props("max-width=360px")
        self.add.disable()

    def begin(self, pattern: Pattern | None = None) -> None:
        """Start with a new state of the model; an unexplained pattern is the proposal. What a person wrote stays."""
        if self.written:
            with self.box:
                ui.timer(0.0, self.tries, once=True)
            return
        self.step, self.turn = None, self.turn + 1
        self.add.disable()
        self.fault.set_text("")
        self.fall.set_text("")
        self.proposed = proposed = pattern is not None and bool(pattern.expression)
        self.box.classes(add="proposed" if proposed else "", remove="" if proposed else "proposed")
        self.hint.set_text("This expression fits the remaining error. Test it, or write another." if proposed else "")
        self.proposal = pattern.expression if pattern is not None and proposed else ""
        self.text.set_value(self.proposal)
        self.name.set_value(self._free_name(pattern.name if pattern is not None and proposed else OWN_NAME))

    def _free_name(self, name: str) -> str:
        """The name, with a number if an added effect has it."""
        names = self.page.session.names if self.page.session is not None else ()
        numbered = (name, *(f"{name}-{k}" for k in range(2, len(names) + 2)))
        return next(free for free in numbered if free not in names)

    async def tries(self) -> None:
        """Fit the expression and show its curve and the error, or the place of a mistake."""
        self.turn += 1
        turn, text, session = self.turn, str(self.text.value or "").strip(), self.page.session
        self.step = None
        self.add.disable()
        self.fault.set_text("")
        self.fall.set_text("")
        if not text or session is None:
            return
        self.fall.set_text("fitting ...")
        try:
            effect = session.written(str(self.name.value or "").strip(), text)
            step = await off_loop(session.tried, effect)
            unseen = await off_loop(lambda: step.after.held_out_excess)
        except Exception as error:
            if turn == self.turn:
                self.fall.set_text("")
                self.fault.set_text(message(error))
            return
        if turn == self.turn:
            self._preview(step, unseen)

    def _preview(self, step: Step[Any], unseen: float) -> None:
        self.step = step
        error_before, error_after = step.before.pooled_excess, step.after.pooled_excess
        self.fall.set_text(
            f"error {rounded(error_before)} → {rounded(error_after)} × the noise floor; held-out error "
            f"{rounded(step.held_out_before)} → {rounded(unseen)} ×"
        )
        self.page.pictures.consider(step)
        self.add.enable()

    @property
    def written(self) -> bool:
        """Whether a person has written an expression."""
        return str(self.text.value or "").strip() not in ("", self.proposal)

    async def _add(self) -> None:
        if (step := self.step) is not None:
            self.text.set_value("")
            await self.page.add(step)
