"""Fleet page: the missing effects of many sensors, errors of rigs, and the sensors that a person must inspect."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from fastapi import Request
from nicegui import ui

from calibrations.model.file import dump_model, read_model
from calibrations.text import capital
from rig.fleet.members import Member, fleet_of
from rig.record import Record
from rig.web.calculations import Visit, off_loop
from rig.web.desk import Desk, models
from rig.web.frame import frame
from rig.web.pages.run_report import frame_html
from rig.web.parts import box, button, div, shown, state, words

WHY = (
    "A fleet is the last complete run of every sensor in the record, or the tables of a folder or of an index with the "
    "columns sensor, batch, rig and file."
)
Tell = Callable[[str, int, int], None]


def register(desk: Desk) -> None:
    """The page at /fleet; its source and model may be part of the address."""

    @ui.page("/fleet")
    def page(request: Request) -> None:
        with frame(desk, "/history", "Fleet"):
            FleetPage(desk, request.query_params.get("source", ""), request.query_params.get("model", "linear"))


class FleetPage:
    """Source and model, and the two analyses of `rig fleet`: their reports appear in the page."""

    def __init__(self, desk: Desk, source: str, model: str) -> None:
        self.desk, self.visit = desk, Visit()
        self.done = ""
        with box("chosen"):
            self.source = ui.input("Folder or index", placeholder="empty: the record", value=source)
            self.source.classes("data").props("dense")
            self.model = ui.select(models(model, None), label="Model", value=model).props("dense options-dense")
            self.buttons = [
                button("Find missing effects", "search", partial(self.show, discovery_page)),
                button("Calibrate", "straighten", partial(self.show, calibrated)),
            ]
        self.place = div("stack")
        with self.place, state("Many sensors at once", WHY):
            pass

    async def show(self, analyse: Callable[..., str]) -> None:
        """Analyse the fleet, and show the report."""
        for choice in self.buttons:
            choice.disable()
        self.done = "Reading the sensors"
        source, model = str(self.source.value or "").strip(), str(self.model.value)
        work = off_loop(analyse, [source] if source else [], model, self.desk.bench_file, self._show_progress)
        text = await shown(self.place, lambda: self.done, "This fleet cannot be analysed", work)
        if self.visit.closed:
            return
        for choice in self.buttons:
            choice.enable()
        if text is None:
            return
        with self.place, box("stack report"):
            with div("row-of"):
                words("Report", "title grow")
                button("Download", "download", lambda: ui.download.content(text, "fleet.html"))
            ui.html(frame_html("Report on the fleet", text), sanitize=False)

    def _show_progress(self, step: str, count: int, total: int) -> None:
        self.visit.check()
        self.done = progress_text(step, count, total)


def progress_text(step: str, count: int, total: int) -> str:
    """The present step of an analysis: between its last answer and the next step, the answers are evaluated."""
    doing = f"{count} of {total} sensors" if count < total else "evaluating the answers"
    return f"{capital(step)}: {doing}"


def discovery_page(sources: list[str], model: str, bench_file: Any, notify: Tell) -> str:
    """The report of `rig fleet discover`."""
    from rig.fleet.discover import discover_fleet
    from rig.fleet.documents import population_page
    from rig.fleet.worker import Question, effects_of, own_files

    effect_files = own_files(bench_file)
    start = Question("look", dump_model(read_model(model, effects_of(effect_files))), own=effect_files)
    return _fleet_page(
        sources, notify, lambda fleet, members: population_page(discover_fleet(fleet, members, start), model)
    )


def calibrated(sources: list[str], model: str, bench_file: Any, notify: Tell) -> str:
    """The report of `rig fleet calibrate`."""
    from rig.fleet.calibrate import calibrate_fleet, read_guide
    from rig.fleet.documents import calibration_page
    from rig.fleet.worker import own_files

    def page(fleet: Any, members: list[Member]) -> str:
        guide = read_guide(model, {member.batch for member in members}, own_files(bench_file))
        return calibration_page(calibrate_fleet(fleet, members, guide), model)

    return _fleet_page(sources, notify, page)


def _fleet_page(sources: list[str], notify: Tell, page: Callable[[Any, list[Member]], str]) -> str:
    """The page that the workers' answers make. Raises RigError, FleetError."""
    from rig.fleet.cluster import connect_workers
    from rig.fleet.questions import Fleet

    members = fleet_of(sources)
    with Record() as record, connect_workers(None, None) as client:
        return page(Fleet(client, record, notify), members)
