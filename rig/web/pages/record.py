"""Record page: a table of all runs with a search; selection of two for a comparison."""

from __future__ import annotations

from collections.abc import Container
from functools import partial
from urllib.parse import urlencode

from nicegui import events, ui

from rig.record import Run
from rig.services.history import calibrating, members
from rig.services.tables import SEPARATOR
from rig.web.address import ModelState
from rig.web.desk import Desk, runs
from rig.web.frame import frame
from rig.web.pages.history_results import HistoryRequest
from rig.web.parts import LINKED, box, button, div, show_error, sortable, state, words

COLUMNS = sortable(
    {
        "name": "run", "procedure": "procedure", "state": "state", "extent": "content", "created": "start (UTC)",
        "sensor": "sensor", "source": "bench or file",
    },
    fixed=("extent",),
)  # fmt: skip
PAGE = 25
EXPANDED_ROW = """<q-td :props="props">
  <a :href="`/record/${props.value.split('/')[0]}`" @click.stop>{{ props.value }}</a>
</q-td>"""
MARK_ALL = '<q-checkbox v-model="props.selected" dense aria-label="Select all runs" />'
MARK = '<q-checkbox v-model="props.selected" dense :aria-label="`Select ${props.row.name}`" />'


def register(desk: Desk) -> None:
    """The page at /record."""

    @ui.page("/record")
    def page() -> None:
        with frame(desk, "/record"):
            try:
                all_runs = runs()
            except Exception as error:
                show_error("The record cannot be read", error)
                return
            if all_runs:
                Runs(all_runs)
            else:
                advice = "It stores every run of the rig with all samples, and your own files that you import."
                with state("The record is empty", advice):
                    ui.button("Measure", icon="play_arrow", on_click=lambda: ui.navigate.to("/run"))
                    button("Import a file", "upload_file", partial(ui.navigate.to, "/import"), "outline")


class Runs:
    """The table: a click opens a run; two selected runs can be compared."""

    def __init__(self, listed: list[Run]) -> None:
        with box("stack"):
            with div("row-of"):
                search = ui.input("Search: run, procedure, sensor, file").props("dense clearable").classes("grow")
                self.hint = words("Select two to compare them, or several of one sensor for one model.", "quiet small")
                button("Import a file", "upload_file", partial(ui.navigate.to, "/import"), "outline")
                self.together = button("One model", "insights", self._model, "outline")
                self.compare = ui.button("Compare", icon="compare_arrows", on_click=self._compare)
            runs_by_sensor = calibrating(listed)
            rows = [row for run in listed for row in _rows(run, runs_by_sensor)]
            self.table = ui.table(
                rows=rows, columns=COLUMNS, row_key="name", selection="multiple", pagination=PAGE,
                on_select=self._update_buttons,
            ).props("flat dense wrap-cells").classes("runs").on("rowClick", self._open)  # fmt: skip
            self.table.props("rows-per-page-label='Runs per page'")
            self.table.add_slot("body-cell-name", EXPANDED_ROW)
            self.table.add_slot("body-cell-sensor", LINKED)
            self.table.add_slot("header-selection", MARK_ALL)
            self.table.add_slot("body-selection", MARK)
            self.table.bind_filter_from(search, "value")
        self.compare.disable()
        self.together.disable()

    def _update_buttons(self) -> None:
        self.compare.set_enabled(len(self.table.selected) == 2)
        self.together.set_enabled(len(self.table.selected) > 1)

    def _selected_names(self) -> list[str]:
        """The selected runs, oldest first."""
        names = {row["name"] for row in self.table.selected}
        return [row["name"] for row in reversed(self.table.rows) if row["name"] in names]

    def _model(self) -> None:
        """Open the model page for the selected runs as one table."""
        ui.navigate.to(ModelState(SEPARATOR.join(self._selected_names())).address)

    def _compare(self) -> None:
        """Compare the selected runs; the older one is the first."""
        first, second = self._selected_names()
        ui.navigate.to(f"/compare?{urlencode({'first': first, 'second': second})}")

    def _open(self, event: events.GenericEventArguments) -> None:
        ui.navigate.to(f"/record/{event.args[1]['name'].partition('/')[0]}")


def _rows(run: Run, calibrated: Container[str]) -> list[dict[str, str]]:
    """A row for a run, or for each sensor of a batch; a calibrated sensor has a link to its history."""
    run_cells = {"procedure": run.procedure, "state": run.state, "extent": run.extent, "source": run.source}
    run_cells["created"] = run.created[:19].replace("T", " ")
    sensors = {member: sensor for sensor, member in members(run).items()}
    names = run.batch or ("",)
    return [
        {
            "name": f"{run.run}/{name}" if name else run.run,
            "sensor": _sensor_name(run.bench["sensors"][name] if name else run.constants),
            "to": HistoryRequest(sensors[name]).address if sensors.get(name) in calibrated else "",
            **run_cells,
        }
        for name in names
    ]


def _sensor_name(description: object) -> str:
    """Name and serial number of a sensor, if known."""
    entries = dict(description) if isinstance(description, dict) else {}
    return " ".join(str(entries[key]) for key in ("sensor", "name", "serial") if entries.get(key))
