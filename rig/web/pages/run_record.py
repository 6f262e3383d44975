"""One run of the record: how it was made, what it measured, what people noted; export and report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlencode

from nicegui import ui

from calibrations.numerals import bound, measured, unit
from rig.analysis.next_steps import next_steps
from rig.analysis.reported import reported
from rig.analysis.request import Request
from rig.analysis.sensors import lives
from rig.errors import RecordError
from rig.export import export
from rig.record import Event, Record, Run
from rig.web.desk import Desk
from rig.web.frame import frame
from rig.web.pages import left_out
from rig.web.pages.history_asked import Asked
from rig.web.pages.over_time import OverTime
from rig.web.pages.settings_words import label, written
from rig.web.parts import box, div, facts, failed, off_loop, table, words
from rig.web.told import message

LOOKS = {"pass": "good", "fail": "bad", "marginal": "doubt"}
FORMATS = {"csv": "csv", "event-model": "jsonl"}
SHOWN = 200  # characters of a setting


def register(desk: Desk) -> None:
    """The page at /record/RUN."""

    @ui.page("/record/{run}")
    def page(run: str) -> None:
        with frame(desk, "/record"):
            try:
                with Record.to_find(run) as record:
                    found, excluded = record.run(run), record.excluded(run)
                    known = lives(found, record.runs())
            except Exception as error:
                failed("No such run", message(error))
                ui.link("All runs", "/record")
                return
            OneRun(desk, found, excluded, known)


class OneRun:
    """All that is known of it."""

    def __init__(self, desk: Desk, run: Run, excluded: dict[int, str], known: Mapping[str, int]) -> None:
        self.desk, self.run = desk, run
        self._head()
        with div("two"):
            with div("stack"):
                with box("stack"):
                    words("Results", "title")
                    _results(run)
                    for line in next_steps(run, excluded):
                        words(line, "quiet small")
                    for sensor, count in known.items():
                        ui.link(f"{count} runs of the sensor {sensor}: its life", Asked(sensor).address).classes(
                            "small"
                        )
                with box("stack"):
                    words("How it was made", "title")
                    facts({name: value[:SHOWN] for name, value in _made(run).items() if value})
            with div("stack"):
                with box("stack"):
                    words("Over time", "title")
                    self.over_time = OverTime()
                    if run.bench:
                        self.over_time.lay_out()
                if excluded:
                    with box("stack"):
                        words("Poses that are left out", "title")
                        left_out.listed(run.run, ui.navigate.reload)
                with box("stack"):
                    self._notes()
        ui.timer(0.0, lambda: self.over_time.follow(run.run), once=True)

    def _head(self) -> None:
        run = self.run
        with box("row-of"):
            words(run.run, "title")
            words(run.state, f"chip {'good' if run.state == 'complete' else 'doubt'}")
            words(f"{run.extent}, {run.created[:19].replace('T', ' ')} UTC", "quiet grow")
            for data in [f"{run.run}/{sensor}" for sensor in run.bench.get("sensors", {})] or [run.run]:
                to = f"/?{urlencode({'data': data})}"
                ui.button(f"Model of {data.rpartition('/')[2]}" if "/" in data else "Model", icon="insights",
                          on_click=lambda to=to: ui.navigate.to(to)).props("dense")  # fmt: skip
                ui.button("Report", icon="description", on_click=lambda data=data: self._report(data)).props(
                    "dense outline"
                )
            for kind in FORMATS:
                ui.button(kind, icon="download", on_click=lambda kind=kind: self._export(kind)).props("dense outline")

    def _notes(self) -> None:
        words("What happened, and notes", "title")
        self.events = div("stack")
        with div("row-of"):
            note = ui.input("A note").props("dense").classes("grow")

            def keep() -> None:
                if text := str(note.value or "").strip():
                    try:
                        with Record.to_read() as record:
                            record.note(self.run.run, "note", text)
                    except RecordError as error:  # such as the lab's, which this role may only read
                        ui.notify(message(error), type="negative")
                        return
                    note.set_value("")
                    self._show_events()

            note.on("keydown.enter", keep)
            ui.button("Keep", on_click=keep).props("dense outline")
        self._show_events()

    def _show_events(self) -> None:
        with Record.to_read() as record:
            found = record.events(self.run.run)
        self.events.clear()
        with self.events:
            if found:
                table(("when (UTC)", "what", ""), [_event(event) for event in found])
            else:
                words("Nothing was noted.", "quiet small")

    async def _export(self, kind: str) -> None:
        """A file of the browser's."""
        try:
            with TemporaryDirectory() as folder:
                path = Path(folder) / f"{self.run.run}.{FORMATS[kind]}"
                await off_loop(export, self.run.run, kind, path)
                ui.download.content(path.read_bytes(), path.name)
        except Exception as error:
            ui.notify(message(error), type="negative", multi_line=True)

    async def _report(self, data: str) -> None:
        hint = ui.notification("Making the report", spinner=True, timeout=None)
        try:
            notes: list[str] = []
            _, make = await off_loop(reported, Request(data, None, self.desk.bench_file), notes.append)
            ui.download.content(await off_loop(make), f"{data.replace('/', '-')}.html")
        except Exception as error:
            ui.notify(message(error), type="negative", multi_line=True, timeout=0, close_button="Close")
        finally:
            hint.dismiss()


def _results(run: Run) -> None:
    if not run.results:
        words("Its procedure gives none by itself." if run.state == "complete" else "It is not complete.", "quiet")
        return
    with ui.element("table").classes("plain-table"):
        for name, result in run.results.items():
            limit = "" if result["limit"] is None else bound(result["value"], result["limit"])
            value = f"{measured(result['value'], result['std'])} {unit(result['unit'])}"
            with ui.element("tr"):
                for cell in (name, value, limit):
                    with ui.element("td"):
                        words(cell)
                with ui.element("td"):
                    if result["verdict"]:
                        words(result["verdict"], f"chip {LOOKS[result['verdict']]}")


def _made(run: Run) -> dict[str, str]:
    said = {role: " ".join(str(part) for part in each.values() if part) for role, each in run.identities.items()}
    why = {"message": run.message} if run.message else {}
    settings = {label(name): written(value) for name, value in run.settings.items()}
    known = {label(name): written(value) for name, value in run.constants.items()}
    return {"procedure": run.procedure, "bench or file": run.source, **why, **settings, **said, **known}


def _event(event: Event) -> tuple[str, str, str]:
    return event.at[:19].replace("T", " "), event.what, event.text
