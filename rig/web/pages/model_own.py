"""An effect of one's own: a line of arithmetic, tried as it is written, with its faults pointed at."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from calibrations.presentation.text import rounded
from rig.web.parts import box, message, off_loop, words

if TYPE_CHECKING:
    from calibrations.discovery.patterns import Pattern
    from calibrations.discovery.results import Step
    from rig.web.pages.model import Workbench

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
