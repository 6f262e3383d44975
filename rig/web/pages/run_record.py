"""Page of one run: results, excluded poses, values over time, notes, export and report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from nicegui import ui

from calibrations.presentation.interactive import figure
from calibrations.text import join_words
from procedures.settings import setting_label, setting_text
from rig.bench.result_names import label
from rig.errors import RecordError
from rig.record import Event, Record, Run
from rig.record.tables import units_of
from rig.services.charts import Course, RunTime, course_chart, kind_label, kind_of
from rig.services.event_words import events_in_words
from rig.services.exclusion import exclude, find_numbered_run
from rig.services.export import export
from rig.services.history import calibration_counts, type_of
from rig.services.next_steps import page_steps, result_rows
from rig.services.page_words import page_step
from rig.services.request import Request
from rig.web.address import ModelState
from rig.web.calculations import Visit, off_loop
from rig.web.desk import Desk
from rig.web.frame import frame
from rig.web.pages.history_results import HistoryRequest
from rig.web.pages.run_report import RunReport, download_report
from rig.web.parts import (
    afresh,
    box,
    button,
    dialog_with_name,
    div,
    facts,
    for_page,
    message,
    notify_error,
    show_error,
    step_row,
    table,
    words,
)
from rig.web.pictures import downloads, empty_plot, remember

MOST_NAMED = 8

# Poses that a person excludes from every analysis, with a reason, and includes again.


def left_out(data: str) -> dict[int, str]:
    """Reasons of excluded poses by number; empty for a file and for samples."""
    run = find_numbered_run(data)
    if run is None:
        return {}
    with Record.to_find(run) as record:
        return record.excluded(run)


def ask(data: str, numbers: Sequence[int], on_done: Callable[[], None]) -> None:
    """Ask for a reason, exclude the poses, and call `on_done`."""
    pose_list = join_words([str(number) for number in numbers[:MOST_NAMED]])
    rest_text = f" and {len(numbers) - MOST_NAMED} more" if len(numbers) > MOST_NAMED else ""
    with dialog_with_name("Exclude poses") as dialog, ui.card().style("min-width: 420px"):
        words(
            f"Exclude pose {pose_list}{rest_text}" if len(numbers) == 1 else f"Exclude poses {pose_list}{rest_text}",
            "title",
        )
        words("The record keeps the poses and the reason; you can include them again.", "quiet small")
        reason = ui.input("Reason").props("autofocus").classes("grow")
        fault_line = words("", "fault")

        async def leave() -> None:
            if reason_text := str(reason.value or "").strip():
                dialog.close()
                await change(data, numbers, reason_text, on_done)
            else:
                fault_line.set_text("Give a reason; later readers of the record need it.")

        reason.on("keydown.enter", leave)
        with div("row-of"):
            ui.button("Exclude", on_click=leave)
            ui.button("Cancel", on_click=dialog.close).props("flat")
    dialog.open()


def list_excluded(data: str, on_done: Callable[[], None]) -> None:
    """The excluded poses with their reasons, each with a button to include it again."""
    for number, reason in left_out(data).items():
        with div("row-of"):
            words(f"pose {number}: {reason}", "small grow")
            include = partial(change, data, [number], None, on_done)
            ui.button("Include again", icon="undo", on_click=include).props("dense flat")


async def change(data: str, numbers: Sequence[int], reason: str | None, on_done: Callable[[], None]) -> None:
    """Exclude poses, or include them again."""
    try:
        await off_loop(_change, data, numbers, reason)
    except Exception as error:
        notify_error(error)
        return
    on_done()


def _change(data: str, numbers: Sequence[int], reason: str | None) -> None:
    run = find_numbered_run(data)
    if run is None:
        raise RecordError(f"{data} is not a table of poses in the record; in a file, add a column `excluded`")
    with Record.to_find(run) as record:
        exclude(record, run, numbers, reason)


# The measurements of a run over time, in a bounded number of points.


class OverTime:
    """Follows a run in the record; a long run has no more points than a short one."""

    def __init__(self) -> None:
        self.run, self.last = "", -1
        self.courses: dict[str, Course] = {}
        self.chosen = False  # a person has selected the kind of pose
        with div("row-of") as self.head:
            self.kind = ui.select([], label="of", on_change=self.draw).props("dense options-dense")
            self.name = ui.select([], label="over time", on_change=self.draw).props("dense options-dense")
            downloads(lambda: self.plot, "Run over time")
        self.kind.on("update:model-value", self._choose)
        for select in (self.kind, self.name):
            select.style("min-width: 150px")
        self.head.set_visibility(False)
        with div(
            ""
        ) as self.place:  # with the page: a script that loads later would be missing after a loss of the connection
            self.plot = empty_plot("the run over time", "live-plot")
        self.place.set_visibility(False)
        self.time = RunTime()
        self.units: dict[str, str] = {}

    async def follow(self, run: str) -> None:
        """Add the new dwells of `run`."""
        if run != self.run:
            if self.run:  # the picture shows another run
                self.place.set_visibility(False)
            self.run, self.last, self.courses, self.chosen = run, -1, {}, False
            self.head.set_visibility(False)
        if not run:
            return
        new, time, units = await off_loop(_new_dwells, run, self.last)
        if not new or run != self.run:
            return
        self.time, self.units = time, units
        for number, dwell in new:
            self.courses.setdefault(kind_of(dwell), Course()).add(dwell)
            self.last = number
        self._offer()
        self.draw()

    def _choose(self) -> None:
        self.chosen = True

    def _offer(self) -> None:
        """Offer the kinds of poses and the quantities; the most frequent kind, until a person selects one."""
        kinds = {kind: kind_label(kind) for kind in self.courses}
        most = max(self.courses, key=lambda kind: len(self.courses[kind].parts))
        value = self.kind.value if self.chosen and self.kind.value in kinds else most
        if (list(kinds), value) != (list(self.kind.options), self.kind.value):
            self.kind.set_options(kinds, value=value)
        names = self.courses[str(self.kind.value or "")].names
        if names != list(self.name.options):
            self.name.set_options(names, value=self.name.value if self.name.value in names else names[0])
        self.kind.set_visibility(len(kinds) > 1)
        self.head.set_visibility(True)

    def draw(self) -> None:
        """Draw the picture again."""
        course = self.courses.get(str(self.kind.value or ""))
        if course is None or self.name.value not in course.names:
            return
        name = str(self.name.value)
        chart = course_chart(course, name, self.time, self.units)
        remember(self.plot, chart)
        self.plot.update_figure(figure(chart, name))
        self.show()

    def show(self) -> None:
        """Show the picture, or its place before the first dwell is there."""
        self.place.set_visibility(True)


def _new_dwells(run: str, after_number: int) -> tuple[list[tuple[int, Any]], RunTime, dict[str, str]]:
    """New dwells with their numbers, the time axis, and the units of channels that are not in V."""
    with Record.to_read() as record:
        dwells = record.dwells(run, after_number)
        if not dwells:
            return dwells, RunTime(), {}
        run_row = record.run(run)
        return dwells, RunTime.of(record, run_row), units_of(run_row, dwells[0][1].means)


# The page of one run: settings, results, notes, export and report.

LOOKS = {"pass": "good", "fail": "bad", "marginal": "doubt"}
FORMATS = {"csv": ("CSV", "csv"), "event-model": ("Bluesky events", "jsonl")}  # label, and ending of the file
SHOWN = 200  # characters of a setting
MESSAGE = "message"


def register(desk: Desk) -> None:
    """The page at /record/RUN."""

    @ui.page("/record/{run}")
    def page(run: str) -> None:
        with frame(desk, "/record", f"Run {run}"):
            try:
                with Record.to_find(run) as record:
                    recorded_run, excluded = record.run(run), record.excluded(run)
                    run_counts = calibration_counts(recorded_run, record.runs())
            except Exception as error:
                show_error("There is no such run", error)
                ui.link("All runs", "/record")
                return
            if run != recorded_run.run:  # such as `last`, which is another run tomorrow
                ui.timer(0.0, partial(ui.navigate.history.replace, f"/record/{recorded_run.run}"), once=True)
            OneRun(desk, recorded_run, excluded, run_counts)


class OneRun:
    """The page of one run."""

    def __init__(self, desk: Desk, run: Run, excluded: dict[int, str], run_counts: Mapping[str, int]) -> None:
        self.desk, self.run, self.visit = desk, run, Visit()
        self._head()
        headline = div("")
        with div("two"):
            with div("stack"):
                with box("stack"):
                    words("Results", "title")
                    _results(run)
                    for step in page_steps(run, excluded):
                        step_row(step, "quiet small")
                    for sensor, count in run_counts.items():
                        address = HistoryRequest(sensor).address
                        named = " ".join(filter(None, (type_of(sensor, run), sensor)))
                        ui.link(f"{count} calibration runs of the sensor {named}: history", address).classes("small")
                with box("stack"):
                    words("Settings", "title")
                    for part in _circumstances(run):
                        facts({name: shortened(name, value) for name, value in part.items() if value})
            with div("stack"):
                if run.bench and run.rows:
                    self._lay_out_over_time()
                if excluded:
                    with box("stack"):
                        words("Excluded poses", "title")
                        list_excluded(run.run, ui.navigate.reload)
                with box("stack"):
                    self._notes()
        if run.state == "complete" and run.rows:
            RunReport(desk, run, headline)

    def _lay_out_over_time(self) -> None:
        with box("stack"):
            words("Over time", "title")
            over_time = OverTime()
            over_time.show()
        ui.timer(0.0, partial(over_time.follow, self.run.run), once=True)

    def _head(self) -> None:
        run = self.run
        with box("row-of"):
            words(run.run, "title")
            words(run.state, f"chip {'good' if run.state == 'complete' else 'doubt'}")
            words(f"{run.extent}, {run.created[:19].replace('T', ' ')} UTC", "quiet grow")
            for data in run.data if run.rows else ():
                title = f"Model of {data.rpartition('/')[2]}" if "/" in data else "Model"
                button(title, "insights", partial(ui.navigate.to, ModelState(data).address), "dense")
                button("Report", "description", partial(self._report, data))
            for kind, (label, _) in FORMATS.items() if run.rows else ():
                button(label, "download", partial(self._export, kind))

    def _notes(self) -> None:
        words("Events and notes", "title")
        self.events = div("stack")
        with div("row-of"):
            note = ui.input("Note").props("dense").classes("grow")

            def keep() -> None:
                if not (text := str(note.value or "").strip()):
                    ui.notify("Write a note first.", type="warning")
                    return
                try:
                    with Record.to_read() as record:
                        record.note(self.run.run, "note", text)
                except RecordError as error:  # for example the lab's record with a role that may only read
                    ui.notify(message(error), type="negative")
                    return
                note.set_value("")
                self._show_events()

            note.on("keydown.enter", keep)
            ui.button("Save", on_click=keep).props("dense outline")
        self._show_events()

    def _show_events(self) -> None:
        with Record.to_read() as record:
            events = events_in_words(record, self.run.run)
        with afresh(self.events):
            if events:
                with div("events"):
                    table(("time (UTC)", "event", "what"), [_event(event) for event in events])
            else:
                words("No events.", "quiet small")

    async def _export(self, kind: str) -> None:
        """Download the run in a format."""
        try:
            with TemporaryDirectory() as folder:
                path = Path(folder) / f"{self.run.run}.{FORMATS[kind][1]}"
                await off_loop(export, self.run.run, kind, path)
                ui.download.content(path.read_bytes(), path.name)
        except Exception as error:
            notify_error(error)

    async def _report(self, data: str) -> None:
        request = Request(data, None, self.desk.bench_file)
        session = partial(self.desk.beginning, data)
        await download_report(self.desk, request, self.visit, f"{data.replace('/', '-')}.html", session)


def _results(run: Run) -> None:
    if not run.results:
        if run.state == "complete":  # else a step says so
            words("The results are in the report below." if run.rows else "There are no results.", "quiet")
        return
    with ui.element("table").classes("plain-table results"):
        for row in result_rows(run.results):
            with ui.element("tr"):
                for cell in (label(run.procedure, row.name), for_page(row.value), row.limit):
                    with ui.element("td"):
                        words(cell)
                with ui.element("td"):
                    if row.verdict:
                        words(row.verdict, f"chip {LOOKS[row.verdict]}")
                with ui.element("td").classes("meaning quiet small"):
                    words(row.name)  # as a limit of the bench file names it


def shortened(name: str, value: str) -> str:
    """The beginning of a long setting; the message of a run is complete, because its end has the remedy."""
    return value if name == MESSAGE or len(value) <= SHOWN else f"{value[:SHOWN]} ..."


def _circumstances(run: Run) -> tuple[dict[str, str], ...]:
    """The run and its settings, the instruments, the constants of sensor and rig."""
    message = {MESSAGE: for_page(page_step(run.message).text)} if run.message else {}
    settings = {setting_label(name): setting_text(value) for name, value in run.settings.items()}
    constants = {setting_label(name): setting_text(value) for name, value in run.constants.items()}
    return {"procedure": run.procedure, "bench or file": run.source, **message, **settings}, run.instruments, constants


def _event(event: Event) -> tuple[str, str, str]:
    return event.at[:19].replace("T", " "), event.what, for_page(event.text)
