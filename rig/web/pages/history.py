"""History page: the calibrations of a sensor, their drift, their control charts, the date of the next one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from fastapi import Request
from nicegui import events, ui

from calibrations.criteria import FEWEST_RUNS
from calibrations.model.file import read_model
from rig.record import Record, Run
from rig.services.history import (
    Calibration,
    History,
    Limit,
    Quantity,
    calibrating,
    history,
    judge_history,
    latest,
    limits_of,
    run_date,
    type_of,
)
from rig.services.page_words import page_step
from rig.services.request import effects_of
from rig.web.calculations import Visit, off_loop
from rig.web.desk import Desk, models, runs
from rig.web.frame import Key, frame
from rig.web.pages.check_standards import CheckStandards
from rig.web.pages.history_results import (
    ClosestBox,
    CompareBox,
    HistoryPictures,
    HistoryRequest,
    calibrations_table,
    parse_request,
    quantities_table,
    summary_of,
)
from rig.web.parts import LINKED, afresh, box, button, div, for_page, show_error, shown, sortable, state, words

# The list of sensors.

COLUMNS = sortable({"sensor": "sensor", "type": "type", "count": "calibration runs", "first": "first", "last": "last"})
PAGE = 25
NONE = (
    "The history of a sensor consists of its calibrations: sweeps and other runs of poses, positions or rotations. A "
    "sensor is identified by its serial number: in the bench file (sensor: {serial: ...}), or in a table in a line "
    "`# serial: 17` above the header, with its date in a line `# date: 2025-03-01`."
)


def sensor_table(runs_by_sensor: Mapping[str, list[Run]]) -> None:
    """A table of the sensors, with links to their histories."""
    if not runs_by_sensor:
        with state("No sensor has a calibration yet", NONE):
            ui.button("Measure", icon="play_arrow", on_click=lambda: ui.navigate.to("/run?procedure=sweep"))
        return

    def opened(event: events.GenericEventArguments) -> None:
        ui.navigate.to(HistoryRequest(event.args[1]["sensor"]).address)

    with box("stack"):
        with div("row-of"):
            words("Sensors", "title grow")
            button("Fleet", "grid_view", lambda: ui.navigate.to("/fleet"))
        search = ui.input("Search: serial number or name").props("dense clearable")
        rows = [_row(sensor, runs) for sensor, runs in runs_by_sensor.items()]
        table = ui.table(rows=rows, columns=COLUMNS, row_key="sensor", pagination=PAGE).props(
            "flat dense rows-per-page-label='Sensors per page'"
        )
        table.on("rowClick", opened).bind_filter_from(search, "value")
        table.add_slot("body-cell-sensor", LINKED)


def _row(sensor: str, runs: list[Run]) -> dict[str, object]:
    days = sorted(run_date(run).date().isoformat() for run in runs)
    return {
        "sensor": sensor,
        "to": HistoryRequest(sensor).address,
        "type": type_of(sensor, runs[-1]) or "–",
        "count": len(runs),
        "first": days[0],
        "last": days[-1],
    }


def register(desk: Desk) -> None:
    """The page at /history."""

    @ui.page("/history")
    def page(request: Request) -> None:
        sensor = request.query_params.get("sensor", "")
        with frame(desk, "/history", f"History of {sensor}" if sensor else "") as keys:
            try:
                all_runs = runs()
                history_request, runs_by_sensor = parse_request(request.query_params), calibrating(all_runs)
            except Exception as error:
                show_error("Cannot show this page", error)
                return
            if not history_request.sensor:
                sensor_table(runs_by_sensor)
                CheckStandards(all_runs)
                return
            HistoryPage(desk, history_request, list(runs_by_sensor), keys)


class HistoryPage:
    """The history of one sensor with one model; changes of limits or quantity do not calibrate again."""

    def __init__(self, desk: Desk, request: HistoryRequest, sensors: list[str], keys: dict[str, Key]) -> None:
        self.desk, self.request, self.sensors, self.keys = desk, request, sensors, keys
        self.visit = Visit()
        self.found: History | None = None
        self.limits: Mapping[str, Limit] = {}
        self.under_way = "Reading the record"
        self._head()
        self.body = div("stack")
        ui.timer(0.0, self.open, once=True)

    def _head(self) -> None:
        """Sensor, model, quantity, limit and baseline."""
        request = self.request
        with box("chosen"):
            ui.select(
                list(dict.fromkeys([*self.sensors, request.sensor])), label="Sensor",
                value=request.sensor, with_input=True,
                on_change=lambda e: self._go(HistoryRequest(e.value, self.request.model)),
            ).props("dense options-dense")  # fmt: skip
            ui.select(
                models(request.model, None), label="Model", value=request.model,
                on_change=lambda e: self._go(HistoryRequest(self.request.sensor, e.value)),
            ).props("dense options-dense")  # fmt: skip
            self.quantity = ui.select([], label="Quantity", on_change=self._change_quantity).props(
                "dense options-dense"
            )
            self.limit = ui.number("Largest change", min=0, on_change=self._change_limit).props("dense debounce=300")
            self.limit.style("min-width: 230px")  # its label has the name and the unit of the quantity
            self.baseline = ui.number(
                "Chart baseline (calibrations)",
                value=request.baseline,
                min=FEWEST_RUNS,
                precision=0,
                on_change=self._change_baseline,
            ).props("dense debounce=300")
        self.fields = (self.quantity, self.limit, self.baseline)
        for field in self.fields:
            field.disable()

    def _go(self, request: HistoryRequest) -> None:
        if request.sensor and (request.sensor, request.model) != (self.request.sensor, self.request.model):
            ui.navigate.to(request.address)

    async def open(self) -> None:
        """Calibrate every run of the sensor in a thread."""
        title = f"Cannot show the history of {self.request.sensor}"
        self.found = await shown(self.body, lambda: self.under_way, title, off_loop(self._read))
        if self.found is not None:
            self._lay_out(self.found)
            self._offer(self.found)
            self.show()

    def _read(self) -> History:
        def notify(text: str) -> None:
            self.visit.check()
            self.under_way = text

        self.limits = limits_of(self.desk.bench_file)
        model = read_model(self.request.model, effects_of(self.desk.bench_file))
        with Record.to_read() as record:
            return history(record, self.request.sensor, model, self.limits, self.request.baseline, notify)

    def _last_of(self, sensor: str) -> Calibration:
        """The last calibration of another sensor."""
        model = read_model(self.request.model, effects_of(self.desk.bench_file))
        with Record.to_read() as record:
            return latest(record, sensor, model)

    def _lay_out(self, history: History) -> None:
        with self.body:
            self.summary_box = div("")
            self.pictures = HistoryPictures(self.request.model)
            with div("two beside"):
                self.closest = ClosestBox(self.request, self._change_day)
                CompareBox(history, self.sensors, self.request.model, self._last_of)
            self.tables = div("stack")
            if history.passed_over:
                count = len(history.passed_over)
                with ui.expansion(f"{count} run{'s' * (count > 1)} not used").props("dense").classes("box"):
                    for data, reason in history.passed_over.items():
                        words(for_page(page_step(f"{data}: {reason}").text), "small")
        self.keys["q"] = Key("next quantity", self._next_quantity)
        self.keys["d"] = Key("calibration closest to a day", self.closest.focus)

    def _offer(self, history: History) -> None:
        """Offer the quantities; select the requested one, or the first."""
        names = [q.name for q in history.quantities]
        self.request = replace(
            self.request, quantity=self.request.quantity if self.request.quantity in names else names[0]
        )
        self.quantity.set_options(names, value=self.request.quantity)
        for field in self.fields:
            field.enable()

    def show(self) -> None:
        """Show the calibrations with the present limits and quantity."""
        assert self.found is not None  # noqa: S101 the fields are disabled before
        history = judge_history(self.found, {**self.limits, **self.request.limits}, self.request.baseline)
        q = next(quantity for quantity in history.quantities if quantity.name == self.request.quantity)
        self._label(q)
        self.pictures.show(q)
        self.closest.show(history)
        with afresh(self.summary_box):
            summary_of(history, q)
        with afresh(self.tables):
            quantities_table(history)
            calibrations_table(history, self.request.model)

    def _label(self, q: Quantity) -> None:
        """Label the field of the limit with the shown quantity."""
        self.limit.label = f"Largest change of {q.name} ({q.unit})"
        self.limit.set_value(self.request.limits.get(q.name))

    def _apply(self, request: HistoryRequest) -> None:
        """Apply a changed request to the same calibrations."""
        if request != self.request and self.found is not None:
            self.request = request
            ui.navigate.history.replace(request.address)
            self.show()

    def _change_quantity(self) -> None:
        if self.quantity.value:
            self._apply(replace(self.request, quantity=self.quantity.value))

    def _change_limit(self) -> None:
        other_limits = {name: limit for name, limit in self.request.limits.items() if name != self.request.quantity}
        own_limit = {self.request.quantity: float(self.limit.value)} if self.limit.value else {}
        self._apply(replace(self.request, limits=other_limits | own_limit))

    def _change_baseline(self) -> None:
        if self.baseline.value and self.baseline.value >= FEWEST_RUNS:
            self._apply(replace(self.request, baseline=int(self.baseline.value)))

    def _change_day(self) -> None:
        if (day := self.closest.day) is not None:
            self._apply(replace(self.request, at=day))

    def _next_quantity(self) -> None:
        names = list(self.quantity.options)
        if names:
            self.quantity.set_value(names[(names.index(self.request.quantity) + 1) % len(names)])
