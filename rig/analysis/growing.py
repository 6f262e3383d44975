"""What a model that grows on rows (`trail`) and one that grows on a still record (`trail_still`) have in common.

A comparison, a diagnosis, a candidate or a step of one kind is of no use to the other. Whoever handles both reads what
is said here, and gives each back to where it came from: only there, arguments are `Any`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, Self

from calibrations.effect import Effect
from calibrations.experiment import Experiment
from calibrations.model import Model


class Fitted(Protocol):
    """A model beside its data."""

    @property
    def model(self) -> Model:
        """With its values."""

    @property
    def pooled_excess(self) -> float:
        """Error over what noise alone leaves."""


class Step(Protocol):
    """One effect added."""

    @property
    def name(self) -> str:
        """Of the effect."""

    @property
    def after(self) -> Fitted:
        """The fit with it."""


class Candidate(Protocol):
    """An effect that may be missing."""

    @property
    def name(self) -> str:
        """Of the effect."""

    @property
    def effect(self) -> Effect:
        """The effect."""

    @property
    def p_value(self) -> float:
        """Of seeing so much by chance."""

    @property
    def probability(self) -> float:
        """That it is this one, among the candidates."""

    @property
    def held_out_after(self) -> float:
        """Error with it on data that the fit did not see."""

    @property
    def indistinguishable_from(self) -> tuple[str, ...]:
        """What these data cannot tell from it."""


class Diagnosis(Protocol):
    """What a model misses."""

    @property
    def verdict(self) -> str:
        """`adequate`, `effect-missing`, `ambiguous` or `unexplained`."""

    @property
    def candidates(self) -> Sequence[Candidate]:
        """Best first."""

    @property
    def held_out_before(self) -> float:
        """Error of the model as it is on data that the fit did not see."""

    @property
    def residual_structure(self) -> str | None:
        """What is left and no effect explains, in words."""

    @property
    def next_experiment(self) -> Experiment | None:
        """What would tell."""


class Growing(Protocol):
    """Data, the model that it began with, and the steps taken from there."""

    @property
    def model(self) -> Model:
        """As it was given."""

    @property
    def end(self) -> Fitted:
        """The fit of the model as it is now."""

    @property
    def steps(self) -> Sequence[Step]:
        """Taken so far."""

    @property
    def effects(self) -> Mapping[str, Effect]:
        """That may be added."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of the data."""

    @property
    def unit(self) -> str:
        """Of the outputs."""

    def among(self, effects: Mapping[str, Effect]) -> Self:
        """The same with other effects to be added."""

    def tried(self, effect: Effect) -> Step:
        """The present model with one effect more. Raises ModelError where that says nothing new."""

    def with_step(self, step: Any) -> Self:
        """One step further."""

    def undone(self) -> Self:
        """One step back."""

    def kept(self) -> Model:
        """The present model as a file keeps it, with where it comes from."""

    def compared(self) -> Any:
        """The present model beside the data."""

    def diagnosed(self) -> Diagnosis:
        """What the present model misses."""

    def with_next(self, result: Any, tell: Callable[[str], None]) -> Diagnosis:
        """The diagnosis with its next experiment planned on the bench; `tell` hears where that is another bench."""
