"""The page at an address that no other page has."""

from __future__ import annotations

from functools import partial

from fastapi import Request
from fastapi.responses import Response
from nicegui import Client, app, ui

from rig.web.desk import Desk
from rig.web.frame import PAGES, frame
from rig.web.parts import state


def register(desk: Desk) -> None:
    """Show the frame of all pages, so that a person finds the way back."""

    @app.exception_handler(404)
    def not_found(request: Request, _: Exception) -> Response:
        with (
            Client(ui.page(""), request=request) as client,
            frame(desk, "", "No such page"),
            state("There is no such page", f"The workbench has no page {request.url.path}."),
        ):
            for path, name in PAGES.items():
                ui.button(name, on_click=partial(ui.navigate.to, path)).props("outline")
        return client.build_response(request, 404)
