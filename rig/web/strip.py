"""The run that is under way, in the head of every page: how far it is, pause and stop."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from rig.apart import steering
from rig.apart.status import Status
from rig.errors import RigError
from rig.web.told import message

LOOK_S = 0.5
PHASES = {"starting": "starts", "running": "runs", "asking": "asks you", "paused": "is paused"}


class Strip:
    """Looks at the status twice a second; shows nothing where nothing is under way."""

    def __init__(self) -> None:
        with ui.element("div").classes("under-way").props("role=status") as self.box:
            self.link = ui.link("", "/run")
            self.pause = ui.button("Pause", icon="pause", on_click=lambda: steer(steering.pause)).props("outline dense")
            self.stop = ui.button("Stop", icon="stop", color="negative", on_click=lambda: steer(steering.stop))
            self.stop.props("unelevated dense")
        ui.timer(LOOK_S, self.look)
        self.look()

    def look(self) -> None:
        """Show how it stands now."""
        status = steering.latest()
        going = status is not None and status.phase != "ended"
        self.box.set_visibility(going)
        if status is not None and going:
            count = f" {status.done}/{status.total}" if status.total else ""
            self.link.set_text(f"{status.procedure}{count} {PHASES[status.phase]}")
            self.pause.set_visibility(status.phase == "running" and status.seat != "nobody")


def steer(how: Callable[[Status], None]) -> None:
    """Do something to the run that is under way, and say where that is not possible."""
    status = steering.latest()
    if status is None:
        return
    try:
        how(status)
    except RigError as error:
        ui.notify(message(error), type="warning")
