"""The frame of all pages: navigation, the present run, colours, keys."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import app, ui
from nicegui.events import GenericEventArguments, KeyEventArguments

from rig.errors import RigError
from rig.runs.background import control
from rig.runs.background.status import Status
from rig.services.page_words import page_step
from rig.web.desk import Desk, lab_read
from rig.web.parts import button, dialog_with_name, for_page, message

# The present run in the head of every page: progress, pause and stop.

LOOK_S = 0.5
TITLE = "rig workbench"
BRIEF = "rig"  # after the name of a page in the tab of the browser
STOP_KEY = "F8"  # the one key that acts on the rig from every page, also while a person types
PHASES = {"starting": "starts", "running": "runs", "asking": "asks you", "paused": "is paused"}


class Strip:
    """Reads the status twice a second; hidden without a present run.

    The tab of the browser has the title `idle`, and during a run its progress and its question.
    """

    def __init__(self, idle: str) -> None:
        self.idle, self.title = idle, ""
        self.before: Status | None = None
        self.begun = False
        with ui.element("div").classes("under-way").props("role=status") as self.box:
            self.link = ui.link("", "/run")
            self.pause = button("Pause", "pause", lambda: control_run(control.pause))
            self.stop = ui.button("Stop", icon="stop", color="negative", on_click=lambda: control_run(control.stop))
            self.stop.props("unelevated dense").classes("stops")
            with self.stop:
                ui.tooltip(f"Key {STOP_KEY}")
        ui.timer(LOOK_S, self.look)
        self.look()

    def look(self) -> None:
        """Show the present status."""
        status = control.latest()
        if self.begun and status is not None and (text := news(self.before, status)) is not None:
            ui.run_javascript(f"if (window.tellRig) tellRig({json.dumps(text[0])}, {json.dumps(text[1])})")
        self.before, self.begun = status, True
        active = status is not None and status.phase != "ended"
        self.box.set_visibility(active)
        self._title(status if active else None)
        if status is not None and active:
            count = f", {status.done} of {status.total}" if status.total else ""
            self.link.set_text(f"{status.procedure} {PHASES[status.phase]}{count}")
            self.pause.set_visibility(status.phase == "running" and status.seat != "nobody")

    def _title(self, status: Status | None) -> None:
        if status is None:
            title = self.idle
        else:
            share = f"{100 * status.done // status.total} % " if status.total else ""
            attention = "❗ " if status.phase in ("asking", "paused") else ""
            title = f"{attention}{share}{status.procedure} {PHASES[status.phase]}"
        if title != self.title:
            self.title = title
            ui.page_title(title)


def news(previous: Status | None, present: Status) -> tuple[str, str] | None:
    """The text of a notification: the run asks, is paused, or has ended since the last status; None for no news."""
    same_run = previous is not None and previous.key == present.key
    if previous is not None and same_run and previous.phase == present.phase and previous.asked == present.asked:
        return None
    if present.phase == "asking" and present.asked is not None:
        return f"{present.procedure} asks you", present.asked.text
    error = for_page(page_step(present.error).text)  # the commands of a terminal are buttons of the page
    if present.phase == "paused":
        return f"{present.procedure} is paused", error or "Continue it or stop it on the page Run."
    if present.phase == "ended" and same_run:
        return f"{present.procedure}: {present.state or 'ended'}", ": ".join(filter(None, (present.run, error)))
    return None


# Notifications of the browser. Browsers allow them after a click, and on https or on this machine only. All open pages
# show the same news under one tag, so it appears once.
TELL = """<script>
window.tellRig = (title, body) => {
  if (!("Notification" in window) || Notification.permission !== "granted") return;
  const said = new Notification(title, {body, tag: "rig " + title, icon: "data:,"});
  said.onclick = () => { window.focus(); said.close(); };
};
</script>"""
ASK = """async () => emit("Notification" in window ? await Notification.requestPermission() : "none")"""
ANSWERS = {
    "granted": "A notification appears when a run asks or ends.",
    "denied": "The browser blocks notifications of this page. Allow them in the settings of the browser.",
    "default": "Not allowed yet. Click again to be asked.",
    "none": "This browser allows notifications only on https or on the computer of the server.",
}


SCRIPT = '<script src="/static/workbench.js" defer></script>'

# NiceGUI resizes a picture also in the moment in which the page removes it; Plotly then rejects a promise that nobody
# reads, which the console would show as an error.
RESIZE_SCRIPT = """<script>
window.addEventListener("unhandledrejection", event => {
  if (String(event.reason?.message ?? event.reason).startsWith("Resize must be passed")) event.preventDefault();
});
</script>"""


def _bell() -> None:
    """The button that asks the browser to allow notifications."""
    button = ui.button(icon="notifications").props("flat round dense aria-label='Notify me when a run asks or ends'")
    with button:
        ui.tooltip("Notify me when a run asks or ends")

    def answered(event: GenericEventArguments) -> None:
        permission = str(event.args)
        ui.notify(
            ANSWERS.get(permission, ANSWERS["default"]), type="positive" if permission == "granted" else "warning"
        )

    button.on("click", answered, js_handler=ASK)


def control_run(action: Callable[[Status], None]) -> None:
    """Apply an action to the present run; show a message if it is not possible."""
    status = control.latest()
    if status is None:
        return
    try:
        action(status)
    except RigError as error:
        ui.notify(message(error), type="warning")


def stop_run() -> None:
    """Stop the present run."""
    status = control.latest()
    if status is not None and status.phase != "ended":
        control_run(control.stop)
        ui.notify(f"Stopping {status.procedure}", type="warning")


STATIC = Path(__file__).parent / "static"
PAGES = {"/": "Model", "/run": "Run", "/record": "Record", "/history": "History"}
THEMES = {None: ("brightness_auto", "as the browser"), False: ("light_mode", "light"),
          True: ("dark_mode", "dark")}  # fmt: skip
NEXT = {None: False, False: True, True: None}


@dataclass(frozen=True)
class Key:
    """A key of a page: its description and its action."""

    does: str
    act: Callable[[], Any]


def static_files() -> None:
    """Serve the style sheet and the script of all pages."""
    app.add_static_files("/static", STATIC)


@contextmanager
def frame(desk: Desk, path: str, title: str = "") -> Iterator[dict[str, Key]]:
    """The head of a page; the body adds content and keys. `title`: of the tab, by default the name of the page."""
    keys = {
        str(k): Key(f"go to {name}", partial(ui.navigate.to, page_path))
        for k, (page_path, name) in enumerate(PAGES.items(), 1)
    }
    ui.add_head_html(f'<link rel="stylesheet" href="/static/workbench.css">{SCRIPT}{TELL}{RESIZE_SCRIPT}')
    ui.colors(primary="#0067a3", negative="#b3261e")
    with ui.element("header").classes("bar"):
        with ui.element("h1").classes("name"):
            ui.label(TITLE)
        with ui.element("nav").classes("ways"):
            for page_path, name in PAGES.items():
                ui.link(name, page_path).classes("here" if page_path == path else "")
        if (lab := lab_read()) is not None:
            ui.label(f"record: {lab}").classes("quiet small")
        ui.element("div").classes("space")
        Strip(f"{title or PAGES[path]} – {BRIEF}")
        keys[STOP_KEY] = Key("stop the run, also while a field has the focus", stop_run)
        _bell()
        _keys(keys)
        _theme(desk)
    with ui.element("div").classes("stack sheet"):
        yield keys


def _theme(desk: Desk) -> None:
    """The switch between light, dark, and the setting of the browser; the server remembers it."""
    dark = ui.dark_mode(desk.dark)

    def switch() -> None:
        desk.dark = NEXT[desk.dark]
        dark.set_value(desk.dark)
        show()

    def show() -> None:
        icon, words = THEMES[desk.dark]
        button.props(f"icon={icon}")
        tip.set_text(f"Colours: {words}")

    button = ui.button(on_click=switch).props("flat round dense aria-label='Light or dark'")
    with button:
        tip = ui.tooltip("")
    show()


def _keys(keys: Mapping[str, Key]) -> None:
    """Run the actions of keys, and list the keys under `?`."""

    def listed() -> None:
        with dialog_with_name("Keys") as dialog, ui.card():
            ui.label("Keys").classes("title")
            with ui.element("div").classes("facts"):
                for name, key in keys.items():
                    ui.label(name).classes("k number")
                    ui.label(key.does)
        dialog.open()

    def anywhere(event: KeyEventArguments) -> None:
        if event.action.keydown and event.key.name == STOP_KEY:
            stop_run()

    async def pressed(event: KeyEventArguments) -> None:
        if event.key.name == STOP_KEY:
            return
        if not event.action.keydown or event.modifiers.ctrl or event.modifiers.alt or event.modifiers.meta:
            return
        if event.key.name == "?":
            listed()
        elif (key := keys.get(event.key.name)) is not None:
            pending = key.act()
            if pending is not None:
                await pending

    ui.keyboard(on_key=pressed, ignore=["input", "select", "textarea"])
    ui.keyboard(on_key=anywhere, ignore=[])
    with ui.button(icon="keyboard", on_click=listed).props("flat round dense aria-label='Keys'"):
        ui.tooltip("Keys (?)")
