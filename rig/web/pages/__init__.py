"""The pages of the workbench: each registers itself for its address; an address without a page shows links to them."""

from __future__ import annotations

from functools import partial

from fastapi import Request
from fastapi.responses import Response
from nicegui import Client, app, ui

from rig.web.desk import Desk
from rig.web.frame import PAGES, frame, static_files
from rig.web.pages import compare, fleet, history, import_file, model, record, run, run_record
from rig.web.parts import state


def register(desk: Desk) -> None:
    """Register all pages."""
    static_files()
    for page in (model, run, record, run_record, compare, history, import_file, fleet):
        page.register(desk)
    _register_unknown(desk)


def _register_unknown(desk: Desk) -> None:
    """Show the frame of all pages at an unknown address, so that a person finds the way back."""

    @app.exception_handler(404)
    def unknown(request: Request, _: Exception) -> Response:
        with (
            Client(ui.page(""), request=request) as client,
            frame(desk, "", "No such page"),
            state("There is no such page", f"The workbench has no page {request.url.path}."),
        ):
            for path, name in PAGES.items():
                ui.button(name, on_click=partial(ui.navigate.to, path)).props("outline")
        return client.build_response(request, 404)
