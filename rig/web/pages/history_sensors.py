"""Whose life is to be shown: all sensors of the record."""

from __future__ import annotations

from collections.abc import Mapping

from nicegui import events, ui

from rig.analysis.history import when
from rig.record import Run
from rig.web.pages.history_asked import Asked
from rig.web.parts import LINKED, box, state, words

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
