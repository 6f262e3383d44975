"""The present run: progress, values and questions; pause, continue, stop.

The page reads the status of the process and the record again, so a page that is opened later shows the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from nicegui import ui

from calibrations.text import capital
from procedures.catalogue import find
from procedures.session import Guidance
from procedures.settings import parse
from rig.bench import Bench
from rig.drawings import Attitude, orientation_drawing, page, strip
from rig.planning.plan import Plan, plan
from rig.record import Record, Run
from rig.runs.background import control
from rig.runs.background.status import NOT_BEGUN, OpenQuestion, Status
from rig.runs.signals import ON_A_PAGE, SIGNAL_SOURCES
from rig.web.address import ModelState
from rig.web.calculations import off_loop
from rig.web.frame import control_run
from rig.web.pages.run_begin import BeginDialog, before_resume
from rig.web.pages.run_record import OverTime
from rig.web.parts import afresh, box, button, dialog_with_name, div, for_page, notify_error, show_error, table, words

LOOK_S = 0.4
PHASES = {
    "starting": ("starting", "plain"),
    "running": ("running", "good"),
    "asking": ("asks you", "doubt"),
    "paused": ("paused", "doubt"),
}
SEATS = {
    "page": "",
    "terminal": "This run was started in a terminal. Pause stops the motion; the terminal then asks how to continue.",
    "nobody": "This run is unattended and cannot pause. Stop ends it; you can resume it later.",
}
GOES_ON = "Resume continues at the same pose."
STOPPED_EARLY = "Stopped before the run began."
RESUME = re.compile(r"`rig resume[^`]*`")  # a button of this page does it
TONE = """(() => {
  const sound = new AudioContext(), tone = sound.createOscillator();
  tone.frequency.value = 880;
  tone.connect(sound.destination);
  tone.onended = () => sound.close();
  tone.start();
  tone.stop(sound.currentTime + 0.2);
})()"""
ENDS = {"complete": "good", "stopped": "doubt", "failed": "bad"}


class Live:
    """Reads and shows the status while the page is open."""

    def __init__(self, on_look: Callable[[bool], None]) -> None:
        self.status: Status | None = None
        self.on_look = on_look  # with whether a run is in progress
        self.present = False  # the run was in progress while this page was open
        with box("stack live") as self.box:
            with div("row-of"):
                self.title = words("", "title")
                self.phase = words("", "chip big-state")
                self.share = words("", "big-share number")
                self.to_record = ui.link("", "/record").classes("small grow")
                with div("row-of actions"):
                    self.buttons()
            self.now = words("", "now")
            self.bar = ui.linear_progress(0.0, show_value=False).props("aria-label=progress instant-feedback")
            self.count = words("", "small number")
            self.hint = words("", "quiet small")
            self.alarm = div("stack")
            self.question = div("")
            with div("stack") as self.details:
                self.tiles = div("tiles").props('role=group aria-label="Live values and their limits"')
                self.attitude = div("attitude").on("click", self._enlarge)
                self.hand = div("stack attitude").on("click", self._enlarge)
                self.values = div("")
                self.over_time = OverTime()
        self.box.set_visibility(False)  # until the first look: no button of a run that is not there
        ui.timer(LOOK_S, self.look)

    def buttons(self) -> None:
        """Buttons; those without effect in the present state are hidden."""
        self.pause = button("Pause", "pause", lambda: control_run(control.pause))
        self.resume = button("Continue", "play_arrow", lambda: self.decide("resume"), "dense")
        self.repeat = button("Repeat the last pose", "replay", lambda: self.decide("repeat"))
        self.stop = ui.button("Stop", icon="stop", color="negative", on_click=lambda: control_run(control.stop))
        self.stop.props("unelevated dense").classes("stops")
        self.resume_button = button("Resume", "play_arrow", self.go_on)
        self.see = button("Open the model", "insights", self._see, "dense")

    def decide(self, decision: str) -> None:
        """Send a decision, or an answer to the question that is shown: the run may ask the next one already."""
        if (shown := self.status) is not None:
            control_run(lambda _: control.answer(shown, decision))

    def pause_run(self) -> None:
        """Pause a running run. No key continues it: a key must not move anything."""
        if self.status is not None and self.status.phase == "running":
            control_run(control.pause)

    def _enlarge(self) -> None:
        """Show the drawing in the whole window."""
        status = self.status
        if status is not None and (status.attitude or status.guidance):
            with (
                dialog_with_name("The next position" if status.guidance else "The present pose") as dialog,
                ui.card().classes("enlarged attitude").on("click", dialog.close),
            ):
                drawing = _hand_drawing(status.guidance) if status.guidance else page(Attitude(**status.attitude))
                ui.html(drawing, sanitize=False)
            dialog.open()

    def _see(self) -> None:
        """Open the model page for the data of the run; without poses the page of the run, which has its results."""
        if (status := self.status) is not None:
            ui.navigate.to(ModelState(status.run).address if status.done else f"/record/{status.run}")

    async def go_on(self) -> None:
        """Open the checks before an incomplete run resumes."""
        if (status := self.status) is None or not status.run:
            return
        try:
            run, bench, planned = await off_loop(_interrupted, status.run)
        except Exception as error:
            notify_error(error)
            return

        async def begin(_sensor: Mapping[str, str], _answers: Mapping[str, str]) -> None:
            await off_loop(control.go_on, status.run, status.procedure, None, status.attended)
            await self.look()

        attitude = None if status.guidance else Attitude(**status.attitude) if status.attitude else Attitude()
        BeginDialog(before_resume(run, planned, bench, attitude), begin)

    async def look(self) -> None:
        """Show the present status; only changes are sent."""
        status = control.latest()
        self.box.set_visibility(status is not None)
        self.on_look(status is not None and status.phase != "ended")
        if status is None:
            return
        if status != self.status:
            previous, self.status = self.status, status
            self._show(status, previous)
        if self.present:
            await self.over_time.follow(status.run)

    def _show(self, status: Status, previous: Status | None) -> None:
        word, look = PHASES.get(status.phase, (status.state or "ended", ENDS.get(status.state, "plain")))
        active = status.phase != "ended"
        self.present = self.present or active
        self.details.set_visibility(self.present)
        self.title.set_text(f"{status.procedure} on {status.bench}")
        self.phase.set_text(word)
        self.phase.classes(remove="good bad doubt plain", add=look)
        self.now.set_text(status.now if active else "")
        self.share.set_text(f"{100 * status.done // status.total} %" if status.total else "")
        self.bar.set_value(status.done / status.total if status.total else 0.0)
        self.bar.set_visibility(active or bool(status.total))
        self.count.set_text(progress_words(status))
        self._links(status)
        paused = status.phase == "paused" and status.seat == "page"
        self.pause.set_visibility(status.phase == "running" and status.seat != "nobody")
        self.resume.set_visibility(paused)
        self.repeat.set_visibility(paused)
        self.hint.set_text(SEATS[status.seat] if active else "")
        self.stop.set_visibility(active)
        self.see.set_visibility(status.state == "complete")
        self.see.set_text("Open the model" if status.done else "Open the results")
        self.resume_button.set_visibility(not active and status.state in ("stopped", "failed") and bool(status.run))
        if _differ(previous, status, "error", "moving", "phase"):
            self._alarm(status)
        if _differ(previous, status, "asked"):
            self._show_question(status.asked if status.phase == "asking" else None, status.seat == "page")
        if _differ(previous, status, "values"):
            self._values(status)
        if _differ(previous, status, "guidance"):
            self._guide(status.guidance, previous.guidance if previous is not None else None)

    def _links(self, status: Status) -> None:
        self.to_record.set_text(status.run)
        self.to_record.props(f'href="/record/{status.run}"' if status.run else 'href="/record"')

    def _alarm(self, status: Status) -> None:
        with afresh(self.alarm):
            if status.moving:
                show_error("Not at rest", "\n".join(status.moving))
            if stop_text := stop_words(status):
                words(stop_text, "quiet")
            elif status.phase == "paused" and status.error:
                show_error("Reason for the pause", RESUME.sub("Continue", status.error))
            elif status.error:
                show_error("Reason for the end", RESUME.sub("Resume", status.error))

    def _show_question(self, question: OpenQuestion | None, can_answer: bool) -> None:
        self.question.clear()
        if question is None:
            return
        with self.question, box("question"):
            words(question.text, "title")
            if question.attitude is not None:
                with div("attitude"):
                    ui.html(_drawing(question.attitude), sanitize=False)
            if question.refused:
                words(for_page(question.refused), "fault")
            if can_answer:
                self._answers(question)
            else:
                words("Answer this question in the terminal of the run.", "quiet")

    def _answers(self, question: OpenQuestion) -> None:
        """A button for each choice, or a field."""
        with div("row-of"):
            for choice in question.choices:
                ui.button(choice, on_click=partial(self.decide, choice))
            if not question.choices:
                typed = ui.input(for_page(question.accepts), value=question.typed or question.proposed).props(
                    "dense autofocus"
                )
                typed.on("keydown.enter", lambda: self.decide(str(typed.value)))
                ui.button("Answer", on_click=lambda: self.decide(str(typed.value)))

    def _values(self, status: Status) -> None:
        """The last values: large with their limits, the others in a table."""
        with afresh(self.tiles):
            for value in status.values:
                if value["limits"] is not None:
                    _tile(value)
        small_values = [value for value in status.values if value["limits"] is None]
        with afresh(self.values):
            table((), [(value["name"], for_page(value["shown"]), for_page(value["remark"])) for value in small_values])
        self.attitude.clear()
        if status.attitude:
            with self.attitude:
                ui.html(_drawing(status.attitude), sanitize=False)

    def _guide(self, guidance: Mapping[str, Any], previous: Mapping[str, Any] | None) -> None:
        """Show the next orientation. A sound and a tick mark a position that was taken: the person looks elsewhere."""
        taken_count = len(guidance.get("taken", ()))
        with afresh(self.hand):
            if not guidance:
                return
            ui.html(_hand_drawing(guidance), sanitize=False)
            if taken_count:
                words(f"✓ position {taken_count} taken", "chip good big-state").props("role=status")
        if previous is not None and taken_count > len(previous.get("taken", ())):
            ui.run_javascript(TONE)


def _interrupted(name: str) -> tuple[Run, Bench, Plan]:
    """An incomplete run, its bench, and the plan of the whole run. Raises RecordError and what `plan` raises."""
    with Record.to_find(name, local_only=True) as record:
        run = record.run(name)
    bench = Bench.model_validate(run.bench)
    procedure = find(run.procedure, bench.folders.procedures)
    return run, bench, plan(bench, procedure, parse(procedure, run.settings))


def _hand_drawing(guidance: Mapping[str, Any]) -> str:
    return orientation_drawing(Guidance(**guidance))


def _differ(previous: Status | None, present: Status, *names: str) -> bool:
    """Whether one of these values has changed; True without a previous status."""
    return previous is None or any(getattr(previous, name) != getattr(present, name) for name in names)


def _tile(value: Mapping[str, Any]) -> None:
    """One value, to be read from two metres: number, limits, and where it is between them."""
    low, high = value["limits"]
    percent = 100 * min(max((value["reading"] - low) / (high - low), 0.0), 1.0) if high > low else 50.0
    number, _, unit = for_page(value["shown"]).partition(" ")
    with div("tile bad" if value["near"] else "tile"):
        words(value["name"], "quiet small")
        with div("row-of"):
            words(number, "value number")
            words(unit, "unit")
        with div("between"):
            div("").style(f"left: {percent:.1f}%")
        words(for_page(f"{low:g} to {high:g} {value['shown'].rpartition(' ')[2]}"), "small quiet number")
        words(value["near"] or for_page(value["remark"]), "small")


def progress_words(status: Status) -> str:
    """How many poses there are, and how long the rest takes; of a complete run its measurements."""
    poses = f"{status.done} of {status.total} poses" if status.total else ""
    return "; ".join(filter(None, (status.extent or poses, status.left if status.phase != "ended" else "")))


def stop_words(status: Status) -> str:
    """The words for a run that was stopped by a signal, which is no error; "" for another run."""
    if status.state != "stopped":
        return ""
    if not status.run and status.error.endswith(NOT_BEGUN):
        return STOPPED_EARLY
    source = next((words for words in (ON_A_PAGE, *SIGNAL_SOURCES.values()) if status.error.startswith(words)), "")
    return f"{capital(source)}. {GOES_ON}" if source else ""


def _drawing(attitude: Mapping[str, Any]) -> str:
    return strip(Attitude(**attitude))
