"""Progress of a search for missing effects, and its cancellation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from calibrations.effects import Effect


class Cancelled(BaseException):
    """The search was cancelled: nobody waits for its result.

    It is not an Exception, so that it is not reported as a fault of a user's effect.
    """


class CountedEffects(Mapping[str, Effect]):
    """The effects of a search, with its progress: a search reads all of them once a round.

    `round` is the number of the present round, `at` the index of the effect in it. `doing` says what the search does
    after the round. `cancelled` ends the search.
    """

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = effects
        self.round, self.at, self.now, self.doing = 0, 0, "", ""
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
        self.doing = ""
        for number, name in enumerate(self._effects):
            self.at, self.now = number, name
            yield name
        self.at = len(self)

    @property
    def share(self) -> float:
        """Progress of the present round, 0 to 1."""
        return self.at / len(self)

    @property
    def text(self) -> str:
        """The progress in words."""
        if not self.round:
            return self.doing or "Fitting the model"
        if self.at == len(self):
            return f"Round {self.round}: {self.doing or 'comparing the results'}"
        return f"Round {self.round}, effect {self.at + 1} of {len(self)}: {self.now}"
