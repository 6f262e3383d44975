"""How far a search through the catalogue is, as seen by the effects that it has asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from calibrations.effect import Effect


class Counted(Mapping[str, Effect]):
    """The same effects, and how often one of them was taken up."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = effects
        self.tried = 0

    def __getitem__(self, name: str) -> Effect:
        self.tried += 1
        return self._effects[name]

    def __len__(self) -> int:
        return len(self._effects)

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    @property
    def told(self) -> str:
        """For people."""
        if not self.tried:
            return "Fitting"
        return f"Trying {len(self)} effects, alone and beside each other: {self.tried} trials"
