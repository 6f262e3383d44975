"""One visit to a page: an analysis for it ends when the page is closed. A run is a process of its own and goes on."""

from __future__ import annotations

from collections.abc import Mapping

from nicegui import ui

from calibrations.effects import Effect
from rig.services.search import Cancelled, Counted


class Visit:
    """Made while a page is built; ends with the page, after the time in which a lost browser may come back."""

    def __init__(self) -> None:
        self.closed = False
        self.search = Counted({})
        ui.context.client.on_delete(self.close)

    def searched(self, effects: Mapping[str, Effect]) -> Counted:
        """The effects for a search of this visit. Reading them raises Cancelled after the page is closed."""
        self.search = Counted(effects)
        self.search.cancelled = self.closed
        return self.search

    def check(self) -> None:
        """Call between the steps of an analysis. Raises Cancelled after the page is closed."""
        if self.closed:
            raise Cancelled

    def close(self) -> None:
        """End the analyses of this visit."""
        self.closed = self.search.cancelled = True
