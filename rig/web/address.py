"""The state of the model page in its address: data, model, added effects, selected poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from urllib.parse import urlencode

from starlette.datastructures import QueryParams

MOST_SELECTED = 100_000


@dataclass(frozen=True)
class ModelState:
    """`added`: None if the address does not say. `selected`: the selected points, in order.

    `noise`: the file of a noise model of the sensor, "" for the noise of the data's own samples.
    """

    data: str = ""
    model: str = ""
    added: tuple[str, ...] | None = None
    selected: tuple[int, ...] = ()
    noise: str = ""

    @property
    def address(self) -> str:
        """The address, without empty fields. An empty `add` means no added effect."""
        added_effects = list(self.added) or [""] if self.added is not None else []
        fields = [("data", self.data), ("model", self.model), ("select", ranges(self.selected)), ("noise", self.noise)]
        query = urlencode(
            [*((name, value) for name, value in fields if value), *(("add", text) for text in added_effects)]
        )
        return f"/?{query}" if query else "/"


def parse_state(query: QueryParams) -> ModelState:
    """The state in an address. An unreadable selection is empty."""
    added_effects = tuple(text for text in query.getlist("add") if text) if "add" in query else None
    selected = numbers(query.get("select", ""))
    return ModelState(query.get("data", ""), query.get("model", ""), added_effects, selected, query.get("noise", ""))


def ranges(selected: Sequence[int]) -> str:
    """`0-36,40`: numbers in order as text."""
    runs = [list(run) for _, run in groupby(enumerate(selected), lambda pair: pair[1] - pair[0])]
    return ",".join(f"{run[0][1]}-{run[-1][1]}" if len(run) > 1 else str(run[0][1]) for run in runs)


def numbers(text: str) -> tuple[int, ...]:
    """The numbers in a text of `ranges`; empty for another text."""
    selection: set[int] = set()
    for part in filter(None, text.split(",")):
        low, _, high = part.partition("-")
        if not low.isdecimal() or not (high or low).isdecimal() or int(high or low) > MOST_SELECTED:
            return ()
        selection |= set(range(int(low), int(high or low) + 1))
    return tuple(sorted(selection))
