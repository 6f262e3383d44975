"""The run that is under way: where it is, what it measures, what it asks; pause, go on, stop.

All of it is read anew from the process's status and the record, so a page that is opened later shows the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any
from urllib.parse import urlencode

from nicegui import ui

from rig.drawings import Attitude, page
from rig.runs.background import control
from rig.runs.background.status import Asked, Status
from rig.web.frame import steer
from rig.web.pages.run_record import OverTime
from rig.web.parts import box, div, failed, for_page, off_loop, words

LOOK_S = 0.4
PHASES = {
    "starting": ("starting", "plain"),
    "running": ("running", "good"),
    "asking": ("asks you", "doubt"),
    "paused": ("paused", "doubt"),
}
SEATS = {
    "page": "",
    "terminal": "It was begun in a terminal: Pause brings it to rest, and the terminal asks how it goes on.",
    "nobody": "It was begun in a terminal, unattended: a pause would end it. Stop brings it to rest; resume it later.",
}
ENDS = {"complete": "good", "stopped": "doubt", "failed": "bad"}


class Live:
    """Looks at the status as long as the page is open."""

    def __init__(self) -> None:
        self.status: Status | None = None
        with box("stack live") as self.box:
            with div("row-of"):
                self.title = words("", "title")
                self.phase = words("", "chip")
                self.to_record = ui.link("", "/record").classes("small grow")
                self.buttons()
            self.now = words("", "quiet")
            self.bar = ui.linear_progress(0.0, show_value=False).props("aria-label=progress instant-feedback")
            self.count = words("", "small number")
            self.hint = words("", "quiet small")
            self.alarm = div("")
            self.question = div("")
            with div("values"):
                self.values = div("")
                self.attitude = div("attitude").on("click", self._enlarge)
            self.over_time = OverTime()
        ui.timer(LOOK_S, self.look)

    def buttons(self) -> None:
        """What can be done to it; what makes no sense now is not shown."""
        self.pause = ui.button("Pause", icon="pause", on_click=lambda: steer(control.pause)).props("outline dense")
        self.resume = ui.button("Go on", icon="play_arrow", on_click=lambda: self.wish("resume")).props("dense")
        self.repeat = ui.button("Repeat the last pose", icon="replay", on_click=lambda: self.wish("repeat"))
        self.repeat.props("outline dense")
        self.stop = ui.button("Stop", icon="stop", color="negative", on_click=lambda: steer(control.stop))
        self.stop.props("unelevated dense")
        self.again = ui.button("Resume", icon="play_arrow", on_click=self.go_on).props("outline dense")
        self.see = ui.button("See the model", icon="insights", on_click=self._see).props("dense")

    def wish(self, what: str) -> None:
        """How a paused run goes on."""
        steer(lambda status: control.answer(status, what))

    def pause_or_go_on(self) -> None:
        """One key for both."""
        if self.status is not None and self.status.phase == "paused":
            self.wish("resume")
        elif self.status is not None and self.status.phase == "running":
            steer(control.pause)

    def _enlarge(self) -> None:
        """The drawing, as large as the window."""
        if self.status is not None and self.status.attitude:
            with ui.dialog() as dialog, ui.card().classes("enlarged attitude").on("click", dialog.close):
                ui.html(_drawn(self.status.attitude), sanitize=False)
            dialog.open()

    def _see(self) -> None:
        """What the run measured, beside a model."""
        if self.status is not None:
            ui.navigate.to(f"/?{urlencode({'data': self.status.run})}")

    async def go_on(self) -> None:
        """Resume a run that has ended before its time."""
        if (status := self.status) is not None and status.run:
            await off_loop(control.go_on, status.run, status.procedure, None, False)

    async def look(self) -> None:
        """Show how it stands; only what has changed is sent."""
        status = control.latest()
        self.box.set_visibility(status is not None)
        if status is None:
            return
        if status != self.status:
            before, self.status = self.status, status
            self._show(status, before)
        await self.over_time.follow(status.run)

    def _show(self, status: Status, before: Status | None) -> None:
        word, look = PHASES.get(status.phase, (status.state or "ended", ENDS.get(status.state, "plain")))
        going = status.phase != "ended"
        self.title.set_text(f"{status.procedure} on {status.bench}")
        self.phase.set_text(word)
        self.phase.classes(remove="good bad doubt plain", add=look)
        self.now.set_text(status.now if going else "")
        self.bar.set_value(status.done / status.total if status.total else 0.0)
        poses = f"{status.done} of {status.total} poses" if status.total else ""
        self.count.set_text("; ".join(filter(None, (poses, status.left if going else ""))))
        self._links(status)
        paused = status.phase == "paused" and status.seat == "page"
        self.pause.set_visibility(status.phase == "running" and status.seat != "nobody")
        self.resume.set_visibility(paused)
        self.repeat.set_visibility(paused)
        self.hint.set_text(SEATS[status.seat] if going else "")
        self.stop.set_visibility(going)
        self.see.set_visibility(status.state == "complete")
        self.again.set_visibility(not going and status.state == "stopped" and bool(status.run))
        if before is None or (before.error, before.moving) != (status.error, status.moving):
            self._alarm(status)
        if before is None or before.asked != status.asked:
            self._ask(status.asked if status.phase == "asking" else None, status.seat == "page")
        if before is None or before.values != status.values:
            self._values(status)

    def _links(self, status: Status) -> None:
        self.to_record.set_text(status.run)
        self.to_record.props(f'href="/record/{status.run}"' if status.run else 'href="/record"')

    def _alarm(self, status: Status) -> None:
        self.alarm.clear()
        with self.alarm:
            if status.moving:
                failed("Not at rest", "\n".join(status.moving))
            if status.error:
                failed("Why it stands still" if status.phase == "paused" else "How it ended", _ended(status))

    def _ask(self, asked: Asked | None, here: bool) -> None:
        self.question.clear()
        if asked is None:
            return
        with self.question, box("question"):
            words(asked.text, "title")
            if asked.attitude is not None:
                with div("attitude"):
                    ui.html(_drawn(asked.attitude), sanitize=False)
            if asked.refused:
                words(asked.refused, "fault")
            if here:
                self._answers(asked)
            else:
                words("Answer it in the terminal that the run was begun in.", "quiet")

    def _answers(self, asked: Asked) -> None:
        """A button for each answer, or a field."""
        with div("row-of"):
            for choice in asked.choices:
                ui.button(choice, on_click=partial(self._answer, choice))
            if not asked.choices:
                typed = ui.input(asked.accepts, value=asked.proposed).props("dense autofocus")
                typed.on("keydown.enter", lambda: self._answer(str(typed.value)))
                ui.button("Answer", on_click=lambda: self._answer(str(typed.value)))

    def _answer(self, text: str) -> None:
        steer(lambda status: control.answer(status, text))

    def _values(self, status: Status) -> None:
        """The last values, each between its limits."""
        self.values.clear()
        with self.values, ui.element("table").classes("plain-table"):
            for value in status.values:
                with ui.element("tr"):
                    for cell in (value["name"], for_page(value["shown"]), _limits(value), for_page(value["remark"])):
                        with ui.element("td"):
                            words(cell)
                    with ui.element("td"):
                        if value["near"]:
                            words(value["near"], "chip bad")
        self.attitude.clear()
        if status.attitude:
            with self.attitude:
                ui.html(_drawn(status.attitude), sanitize=False)


def _ended(status: Status) -> str:
    """Why; of a run that a person stopped on a page, what can be done on a page."""
    if status.state == "stopped" and status.error.startswith("stopped by SIGTERM"):
        return "Stopped by a person. Resume goes on where it was."
    return status.error


def _limits(value: Mapping[str, Any]) -> str:
    """The lowest and the highest that is allowed, in the value's own unit."""
    if value["limits"] is None:
        return ""
    low, high = value["limits"]
    return for_page(f"{low:g} to {high:g} {value['shown'].rpartition(' ')[2]}")


def _drawn(attitude: Mapping[str, Any]) -> str:
    return page(Attitude(**attitude))
