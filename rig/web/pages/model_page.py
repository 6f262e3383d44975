"""What the parts of the page Model ask of the whole: its data, its model, and that the model grows.

The data are rows or a still record. What both have in common is in `rig.analysis.growing`; what is said and drawn of
one alone is behind `Words` and `AnyPictures`, which are given what belongs to their own kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from rig.analysis.growing import Growing, Step
from rig.web.desk import Desk
from rig.web.pages.model_words import Words


class AnyPictures(Protocol):
    """Pictures of a model beside its data."""

    def show(self, compared: Any, trail: Any) -> None:
        """A new fit."""

    def consider(self, step: Any) -> None:
        """Draw what an effect would change; None takes it away."""

    def next_axis(self) -> None:
        """The next channel."""

    def other_unit(self) -> None:
        """Another unit, where there is one."""

    def select(self, points: Sequence[int]) -> None:
        """Mark these points in all pictures."""

    def leave_selected(self) -> None:
        """Ask whether what is selected is to be left out."""


class ModelPage(Protocol):
    """The page, as its parts see it."""

    desk: Desk
    data: str
    model: str
    trail: Growing | None
    told: Words
    pictures: AnyPictures

    def go(self, data: str, model: str) -> None:
        """To another address: other data, or another model."""

    def afresh(self) -> None:
        """Read the data again, which have changed."""

    async def add(self, step: Step) -> None:
        """The model gains an effect."""

    async def undo(self) -> None:
        """The last effect is taken back."""

    def cancel(self) -> None:
        """Wait no longer for what is missing."""

    async def again(self) -> None:
        """Look for what is missing after all."""
