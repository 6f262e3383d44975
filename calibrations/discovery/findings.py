"""The findings of a search in data of any kind.

FittedModel  a model fitted to data, as the loop needs it
Place        a place where a model fails
Candidate    one effect on top of a model
Step         one effect added
Findings     all that one search found
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar

from calibrations.criteria import LIKELY, NOTEWORTHY
from calibrations.discovery.verdict import Closest, Evidence, Judgement
from calibrations.effects import Effect
from calibrations.free_forms.place_names import PREFIX
from calibrations.model import Model

if TYPE_CHECKING:
    from calibrations.design.experiment import Experiment
    from calibrations.discovery.dataset import Dataset
    from calibrations.discovery.patterns import Pattern
    from calibrations.free_forms.acting_places import ActingPlace


class Measured(Protocol):
    """Data as provenance names them."""

    @property
    def source(self) -> str:
        """File or run."""

    @property
    def digest(self) -> str:
        """SHA-256 of the data."""

    @property
    def n(self) -> int:
        """Rows, or samples of a channel."""

    @property
    def constants(self) -> Mapping[str, str | float]:
        """Known constants of the sensor."""


class FittedModel(Protocol):
    """A model fitted to data of any kind."""

    @property
    def model(self) -> Model:
        """The model with its values."""

    @property
    def pooled_excess(self) -> float:
        """Error over the noise floor, all channels together."""

    @property
    def held_out_excess(self) -> float:
        """Error over the noise floor on data that the fit did not use."""

    @property
    def measured(self) -> Measured:
        """The data that it was fitted to."""

    def share_left(self, start: Self) -> float:
        """Part of the excess variance of `start` that this fit does not explain."""


F = TypeVar("F", bound=FittedModel)


@dataclass(frozen=True)
class Place:
    """A stretch `low`..`high` of a column where one channel's error is `excess` times the noise floor."""

    where: str
    low: float
    high: float
    axis: str
    excess: float
    text: str


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One effect on top of a model. `gain` is twice the gain in log-likelihood; `p_value` is over the whole search."""

    effect: Effect
    gain: float
    p_value: float
    probability: float
    excess_after: float
    held_out_after: float
    indistinguishable_from: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name


@dataclass(frozen=True)
class Step(Generic[F]):
    """One effect added: the fits without and with it.

    `alone`: the log-likelihood that the final model loses without this effect alone; None where it is not computed.
    """

    name: str
    before: F
    after: F
    alone: float | None = None

    @property
    def effect(self) -> Effect:
        """The added effect. The model keeps its effects in the order of the signal chain: it need not be the last."""
        return next(term.effect for term in self.after.model.terms if term.effect.name == self.name)

    @property
    def held_out_before(self) -> float:
        """Error on unseen data without the effect."""
        return self.before.held_out_excess

    @property
    def held_out_after(self) -> float:
        """Error on unseen data with it."""
        return self.after.held_out_excess


@dataclass(frozen=True, kw_only=True)
class Findings(Evidence, Generic[F]):
    """The findings of one search. Diagnosis and discovery are two views of them, so that they cannot disagree.

    data          the data
    start         the given model
    origin        the model that the search began with: an earlier one where a person added effects one by one
    baseline      the given model on data without disturbances
    added         effects that a person added before the given model
    followed      those of them that a search proposed, and not as causes
    steps         the effects that it misses, in the order in which they are added
    tried         the steps of the search, where none is kept
    candidates    every effect alone on top of the baseline; the effect of the first step comes first
    causes        effects of the steps named as causes; the others refine the form of a cause
    places        places of the signal chain that act, the largest first, where the search has found them
    pattern       `left`, as an expression
    undetermined  why the data do not determine the given model, and the final model
    set_aside     rows that the search left out, and why; `outliers` are their numbers
    reason        why the data cannot decide, in words
    disturbances  what is not noise in a still record, as documents
    separations   by effect, the experiment that separates it from its alternatives
    further       the experiment for anything else in doubt
    settled       whether the effects were tested against each other
    """

    data: Dataset[F]
    start: F
    origin: F
    baseline: F
    added: tuple[str, ...] = ()
    followed: tuple[str, ...] = ()
    steps: tuple[Step[F], ...] = ()
    tried: tuple[Step[F], ...] = ()
    candidates: tuple[Candidate, ...] = ()
    causes: tuple[str, ...] = ()
    places: tuple[ActingPlace, ...] = ()
    pattern: Pattern | None = None
    undetermined: tuple[str | None, str | None] = (None, None)
    set_aside: str | None = None
    outliers: tuple[int, ...] = ()
    reason: str | None = None
    disturbances: tuple[Mapping[str, Any], ...] = ()
    separations: Mapping[str, Experiment] = field(default_factory=dict)
    further: Experiment | None = None
    settled: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """The effects of the steps, in order."""
        return tuple(step.name for step in self.steps)

    @property
    def refinements(self) -> tuple[str, ...]:
        """Effects of the steps that are not named as causes."""
        return tuple(name for name in self.names if name not in self.causes)

    @property
    def curves(self) -> tuple[str, ...]:
        """Free forms of the steps at places of unknown cause: what acts there, and not the form of a cause."""
        return tuple(name for name in self.names if name in self._unknown_forms)

    @property
    def _unknown_forms(self) -> frozenset[str]:
        """The free forms at places of unknown cause."""
        return frozenset(f"{PREFIX}{place.name}" for place in self.places if place.unknown)

    @property
    def end(self) -> F:
        """The fit of the final model."""
        return self.steps[-1].after if self.steps else self.baseline

    @cached_property
    def given(self) -> Judgement:
        """The judgement on the given model; on the model before the added effects if no further effect is missing."""
        is_complete = bool(self.added) and not self._missing
        added = sorted((name for name in self.added if name not in self.followed), key=self._order_of_causes)
        judgement = self._judge(self.origin if is_complete else self.start, tuple(added), self.undetermined[0])
        if is_complete:
            refinements = tuple(name for name in self.followed if name not in self._unknown_forms)
        else:
            refinements = tuple(name for name in self.refinements if name in self._missing) if self.causes else ()
        return replace(judgement, missing=self._missing, refinements=refinements, provisional=not self.settled)

    @cached_property
    def final(self) -> Judgement:
        """The judgement on the final model."""
        refinements = tuple(name for name in self.refinements if name not in self.curves)
        return replace(self._judge(self.start, self.causes, self.undetermined[1]), refinements=refinements)

    def _judge(self, fit: F, added: tuple[str, ...], undetermined: str | None) -> Judgement:
        """The judgement on the model of `fit`, with the effects that were added to it."""
        return Judgement(
            model=fit.model.name,
            added=added,
            unknown=tuple(place.name for place in self.places if place.unknown),
            share_left=self.end.share_left(self.origin),
            undetermined=undetermined,
            closest=self._closest,
            error=self.end.pooled_excess,
            floor=self.data.floor,
            **self.shared,
        )

    def _order_of_causes(self, name: str) -> int:
        """Causes in their own order, as in the judgement on the final model; effects that a person chose are first."""
        return self.causes.index(name) if name in self.causes else -1

    @property
    def _missing(self) -> tuple[str, ...]:
        """The effects of the steps. A curve at an unknown place has the name of its place."""
        unknown = any(place.unknown for place in self.places)
        return tuple(name for name in self.names if not (unknown and name.startswith(PREFIX)))

    @property
    def _closest(self) -> Closest | None:
        """The best candidate if no effect is significant, and if chance alone seldom shows as much."""
        best = next(iter(self.candidates), None)
        if self.steps or self.added or best is None or best.held_out_after >= self.baseline.held_out_excess:
            return None
        noteworthy = best.p_value < NOTEWORTHY or best.probability > LIKELY
        return Closest(best.name, best.p_value) if noteworthy else None

    def experiment(self, names: tuple[str, ...]) -> Experiment | None:
        """The experiment for the first of these effects that is in doubt, or for anything else in doubt."""
        return next((self.separations[name] for name in names if name in self.separations), self.further)

    def without_steps(self) -> Self:
        """The findings without named effects: the residual makes all of them doubtful."""
        return replace(self, steps=(), tried=self.steps, causes=(), alternatives={}, separations={}, settled=True)
