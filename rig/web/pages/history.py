"""History: a sensor's calibrations over its life, how they drift, whether they are in control, when the next is due."""

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
    judged,
    latest,
    limits_of,
    when,
)
from rig.services.load import effects_of
from rig.web.desk import Desk, models, runs
from rig.web.frame import Key, frame
from rig.web.pages.history_results import (
    Asked,
    Beside,
    Closest,
    LifePictures,
    asked,
    calibrations_table,
    quantities_table,
    standing,
)
from rig.web.parts import LINKED, box, div, failed, message, off_loop, state, waiting, words

# Whose life is to be shown: all sensors of the record.

COLUMNS: list[dict[str, object]] = [
    {"name": "sensor", "label": "sensor", "field": "sensor", "align": "left", "sortable": True},
    {"name": "count", "label": "runs to calibrate it by", "field": "count", "align": "left", "sortable": True},
    {"name": "first", "label": "first", "field": "first", "align": "left", "sortable": True},
    {"name": "last", "label": "last", "field": "last", "align": "left", "sortable": True},
]
PAGE = 25
NONE = (
    "A sensor's life is its calibrations: sweeps and other runs of poses, positions or turns. It goes by its serial "
    "number, which the bench file names (sensor: {serial: ...}), a table in a line `# serial: 17` above its header, "
    "beside `# date: 2025-03-01`."
)


def listed(known: Mapping[str, list[Run]]) -> None:
    """A line for each sensor, which leads to its life."""
    if not known:
        with state("No sensor is calibrated yet", NONE):
            ui.button("Measure", icon="play_arrow", on_click=lambda: ui.navigate.to("/run?procedure=sweep"))
        return

    def opened(event: events.GenericEventArguments) -> None:
        ui.navigate.to(Asked(event.args[1]["sensor"]).address)

    with box("stack"):
        words("Whose life?", "title")
        search = ui.input("Search: serial number or name").props("dense clearable")
        rows = [_row(sensor, runs) for sensor, runs in known.items()]
        table = ui.table(rows=rows, columns=COLUMNS, row_key="sensor", pagination=PAGE).props("flat dense")
        table.on("rowClick", opened).bind_filter_from(search, "value")
        table.add_slot("body-cell-sensor", LINKED)


def _row(sensor: str, runs: list[Run]) -> dict[str, object]:
    days = sorted(when(run).date().isoformat() for run in runs)
    return {"sensor": sensor, "to": Asked(sensor).address, "count": len(runs), "first": days[0], "last": days[-1]}


LOOK_S = 0.15


def register(desk: Desk) -> None:
    """The page at /history."""

    @ui.page("/history")
    def page(request: Request) -> None:
        with frame(desk, "/history") as keys:
            try:
                wanted, known = asked(request.query_params), calibrating(runs())
            except Exception as error:
                failed("This cannot be shown", message(error))
                return
            if not wanted.sensor:
                listed(known)
                return
            Life(desk, wanted, list(known), keys)


class Life:
    """One sensor's life by one model; its runs are calibrated once, whatever is then asked of them."""

    def __init__(self, desk: Desk, wanted: Asked, sensors: list[str], keys: dict[str, Key]) -> None:
        self.desk, self.asked, self.sensors, self.keys = desk, wanted, sensors, keys
        self.found: History | None = None
        self.limits: Mapping[str, Limit] = {}
        self.under_way = "Reading the record"
        self._head()
        self.body = div("stack")
        ui.timer(0.0, self.open, once=True)

    def _head(self) -> None:
        """Whose life, by which model; of which quantity, and what it may change by."""
        wanted = self.asked
        with box("chosen"):
            ui.select(
                list(dict.fromkeys([*self.sensors, wanted.sensor])), label="Sensor",
                value=wanted.sensor, with_input=True, on_change=lambda e: self._go(Asked(e.value, self.asked.model)),
            ).props("dense options-dense")  # fmt: skip
            ui.select(
                {name: title for name, title in models(wanted.model).items() if name},
                label="Model", value=wanted.model,
                on_change=lambda e: self._go(Asked(self.asked.sensor, e.value)),
            ).props("dense options-dense")  # fmt: skip
            self.quantity = ui.select([], label="Quantity", on_change=self._other_quantity).props("dense options-dense")
            self.limit = ui.number("Greatest change", min=0, on_change=self._other_limit).props("dense debounce=300")
            self.baseline = ui.number(
                "Baseline of the charts",
                value=wanted.baseline,
                min=FEWEST_RUNS,
                precision=0,
                on_change=self._other_baseline,
            ).props("dense debounce=300")
        self.fields = (self.quantity, self.limit, self.baseline)
        for each in self.fields:
            each.disable()

    def _go(self, wanted: Asked) -> None:
        if wanted.sensor and (wanted.sensor, wanted.model) != (self.asked.sensor, self.asked.model):
            ui.navigate.to(wanted.address)

    async def open(self) -> None:
        """Calibrate every run of the sensor, off the loop."""
        with self.body, box("stack"):
            hint = waiting(self.under_way)
            ui.timer(LOOK_S, lambda: hint.set_text(self.under_way))
            for height in ("230px", "180px"):
                ui.skeleton(height=height)
        try:
            self.found = await off_loop(self._read)
        except Exception as error:
            self.body.clear()
            with self.body:
                failed(f"No life of {self.asked.sensor} can be shown", message(error))
            return
        self._lay_out(self.found)
        self._offer(self.found)
        self.show()

    def _read(self) -> History:
        def tell(text: str) -> None:
            self.under_way = text

        self.limits = limits_of(self.desk.bench_file)
        model = read_model(self.asked.model, effects_of(self.desk.bench_file))
        with Record.to_read() as record:
            return history(record, self.asked.sensor, model, self.limits, self.asked.baseline, tell)

    def _last_of(self, sensor: str) -> Calibration:
        """Of another sensor."""
        model = read_model(self.asked.model, effects_of(self.desk.bench_file))
        with Record.to_read() as record:
            return latest(record, sensor, model)

    def _lay_out(self, found: History) -> None:
        self.body.clear()
        with self.body:
            self.standing = div("")
            self.pictures = LifePictures(self.asked.model)
            with div("two beside"):
                self.closest = Closest(self.asked, self._other_day)
                Beside(found, self.sensors, self.asked.model, self._last_of)
            self.tables = div("stack")
            if found.passed_over:
                with ui.expansion(f"{len(found.passed_over)} passed over").props("dense").classes("box"):
                    for data, why in found.passed_over.items():
                        words(f"{data}: {why}", "small")
        self.keys["q"] = Key("the next quantity", self._next_quantity)
        self.keys["d"] = Key("the calibration closest to a day", self.closest.focus)

    def _offer(self, found: History) -> None:
        """The quantities that there are; the one that was asked for, or the first."""
        names = [q.name for q in found.quantities]
        self.asked = replace(self.asked, quantity=self.asked.quantity if self.asked.quantity in names else names[0])
        self.quantity.set_options(names, value=self.asked.quantity)
        for each in self.fields:
            each.enable()

    def show(self) -> None:
        """What is asked now, of the calibrations as they are."""
        assert self.found is not None  # noqa: S101 nothing can be asked before
        found = judged(self.found, {**self.limits, **self.asked.limits}, self.asked.baseline)
        q = next(each for each in found.quantities if each.name == self.asked.quantity)
        self._label(q)
        self.pictures.show(q)
        self.closest.show(found)
        for place in (self.standing, self.tables):
            place.clear()
        with self.standing:
            standing(found, q)
        with self.tables:
            quantities_table(found)
            calibrations_table(found, self.asked.model)

    def _label(self, q: Quantity) -> None:
        """The field of the limit is that of the quantity that is shown."""
        self.limit.label = f"Greatest change of {q.name} ({q.unit})"
        self.limit.set_value(self.asked.limits.get(q.name))

    def _now(self, wanted: Asked) -> None:
        """Something else is asked of the same calibrations."""
        if wanted != self.asked and self.found is not None:
            self.asked = wanted
            ui.navigate.history.replace(wanted.address)
            self.show()

    def _other_quantity(self) -> None:
        if self.quantity.value:
            self._now(replace(self.asked, quantity=self.quantity.value))

    def _other_limit(self) -> None:
        others = {name: each for name, each in self.asked.limits.items() if name != self.asked.quantity}
        own = {self.asked.quantity: float(self.limit.value)} if self.limit.value else {}
        self._now(replace(self.asked, limits=others | own))

    def _other_baseline(self) -> None:
        if self.baseline.value and self.baseline.value >= FEWEST_RUNS:
            self._now(replace(self.asked, baseline=int(self.baseline.value)))

    def _other_day(self) -> None:
        if (day := self.closest.day) is not None:
            self._now(replace(self.asked, at=day))

    def _next_quantity(self) -> None:
        names = list(self.quantity.options)
        if names:
            self.quantity.set_value(names[(names.index(self.asked.quantity) + 1) % len(names)])
