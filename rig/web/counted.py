"""How far a search through the catalogue is, as seen by the effects that it asks for; and its end before its time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from calibrations.effect import Effect


class Cancelled(Exception):
    """Nobody waits for the answer any more."""


class Counted(Mapping[str, Effect]):
    """The same effects. A search goes through them in rounds; `round` is the present one, `at` how far it is."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = effects
        self.round, self.at, self.now = 0, 0, ""
        self.cancelled = False

    def __getitem__(self, name: str) -> Effect:
        """Raises Cancelled."""
        if self.cancelled:
            raise Cancelled
        return self._effects[name]

    def __len__(self) -> int:
        return len(self._effects)

    def __iter__(self) -> Iterator[str]:
        self.round += 1
        for at, name in enumerate(self._effects):
            self.at, self.now = at, name
            yield name
        self.at = len(self)

    @property
    def share(self) -> float:
        """Of the present round."""
        return self.at / len(self)

    @property
    def told(self) -> str:
        """For people."""
        if not self.round:
            return "Fitting the model"
        if self.at == len(self):
            return f"Round {self.round}: weighing what was tried"
        return f"Round {self.round}, effect {self.at + 1} of {len(self)}: {self.now}"
