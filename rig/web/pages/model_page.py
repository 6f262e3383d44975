"""What the parts of the page Model ask of the whole: its data, its model, and that the model grows."""

from __future__ import annotations

from typing import Protocol

from calibrations.discover import Added
from rig.analysis.trail import Trail
from rig.web.desk import Desk
from rig.web.pages.model_pictures import Pictures


class ModelPage(Protocol):
    """The page, as its parts see it."""

    desk: Desk
    data: str
    model: str
    trail: Trail | None
    pictures: Pictures

    def go(self, data: str, model: str) -> None:
        """To another address: other data, or another model."""

    async def add(self, step: Added) -> None:
        """The model gains an effect."""

    async def undo(self) -> None:
        """The last effect is taken back."""
