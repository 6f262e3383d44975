"""The interface of measured data in the loop: the operations that differ between kinds of data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Generic

from calibrations.discovery.findings import Candidate, F, Findings, Place, Step
from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.discovery.verdict import Finding, Judgement, Verdict
from calibrations.effects import Effect
from calibrations.errors import ModelError
from calibrations.model import Model

if TYPE_CHECKING:
    from calibrations.discovery.curves import PlaceCurve
    from calibrations.discovery.enough import Enough
    from calibrations.discovery.summary import SummaryRow
    from calibrations.model.correlations import Correlations


class Dataset(ABC, Generic[F]):
    """Data of one kind. A subclass implements fit, search, judgement and description."""

    form: str  # "rows" or "samples": the kind of pictures
    floor: str  # unit of errors, in words
    complete: str  # a comparison without a failing place, in words

    @property
    @abstractmethod
    def default_model(self) -> str:
        """The shipped model for this content."""

    @property
    @abstractmethod
    def unseen(self) -> str:
        """Data that a fit did not use, in words."""

    @property
    @abstractmethod
    def source(self) -> str:
        """File or run."""

    @property
    @abstractmethod
    def content(self) -> str:
        """The kind of data, as models are defined for it."""

    @property
    @abstractmethod
    def n(self) -> int:
        """Rows, or samples of a channel."""

    @property
    @abstractmethod
    def unit(self) -> str:
        """Unit of the outputs."""

    @property
    @abstractmethod
    def axes(self) -> tuple[str, ...]:
        """Axes that were measured."""

    @property
    @abstractmethod
    def description(self) -> str:
        """Size and source in words, such as `518 rows of sweep.csv`."""

    @property
    def note(self) -> str:
        """A remark on the comparison, if there is another one; "" if not."""
        return ""

    @property
    def left_out(self) -> tuple[str, ...]:
        """Places of the signal chain in which no search looks for a cause."""
        return ()

    def without(self, places: Sequence[str]) -> Dataset[F]:
        """The same data for a search that leaves out these places of the signal chain. Raises ModelError."""
        if not places:
            return self
        raise ModelError(
            f"{self.source}: the search in a still record has no places of the signal chain to leave out; "
            "remove --without"
        )

    @abstractmethod
    def fit(self, model: Model) -> F:
        """The model with its parameters estimated. Raises ModelError, DataError, TooFewRows."""

    @abstractmethod
    def evaluate(self, model: Model) -> F | None:
        """The model with the values that it has; None where it has none."""

    @abstractmethod
    def places(self, fit: F) -> tuple[Place, ...]:
        """Places where a model fails, worst first."""

    @abstractmethod
    def search(self, model: Model, effects: Mapping[str, Effect]) -> Findings[F]:
        """All effects that a model misses."""

    @abstractmethod
    def addition(self, effect: Effect, model: Model, effects: Mapping[str, Effect]) -> Findings[F]:
        """One chosen effect added to a model, both fitted."""

    @abstractmethod
    def step(self, effect: Effect, base: F) -> Step[F]:
        """One chosen effect added to a fit."""

    @abstractmethod
    def search_on(self, start: F, origin: F, effects: Mapping[str, Effect]) -> Findings[F]:
        """All effects that a fitted model misses; shares are relative to the error of `origin`."""

    @abstractmethod
    def candidates(self, base: F, plan: Findings[F], effects: Mapping[str, Effect]) -> tuple[Candidate, ...]:
        """Every effect alone on top of a fit that belongs to a search, the next one of `plan` first."""

    def fit_without_outliers(self, model: Model) -> tuple[Dataset[F], F]:
        """(the data without gross outliers, the model fitted to them)."""
        return self, self.fit(model)

    def follow_plan(self, plan: Findings[F], k: int, effects: Mapping[str, Effect]) -> Findings[F]:
        """The remaining findings of a search after its first `k` steps."""
        start = plan.steps[k - 1].after
        taken = plan.names[:k]
        followed = (*plan.followed, *(name for name in taken if plan.causes and name not in plan.causes))
        remaining = replace(plan, added=(*plan.added, *taken), followed=followed, steps=plan.steps[k:])
        return replace(
            remaining,
            start=start,
            baseline=start,
            candidates=self.candidates(start, remaining, effects),
            undetermined=(self.undetermined(start), plan.undetermined[1]),
        )

    def rejection(self, fit: F) -> Finding | None:
        """The reason not to use the data or the values of a fit; None if they can be used."""
        return None

    def covered(self, fit: F) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each influence for which a fit is valid; {} if none was measured."""
        return {}

    def correlations(self, fit: F) -> Correlations | None:
        """The correlations of the parameters of a fit; None if they are unknown."""
        return None

    def undetermined(self, fit: F) -> str | None:
        """Why the data do not determine a model, in words."""
        return None

    def untestable(self, fit: F, effects: Mapping[str, Effect]) -> str | None:
        """The effects that these data cannot show, in words; None if they show all."""
        return None

    def expression(self, name: str, text: str) -> Effect:
        """An effect that the user wrote. Raises ModelError, ExpressionError with the place in the text."""
        raise ModelError(
            f"{name}: an expression cannot be added to a noise model, and {self.source} is a still record; use "
            "poses, positions or rates"
        )

    @property
    def foreseeable(self) -> bool:
        """Whether the program can compute the expected data of an experiment."""
        return False

    @abstractmethod
    def errors_document(self, fit: F) -> dict[str, Any]:
        """Errors and noise by axis, for the JSON documents."""

    def comparison_fields(self, result: Comparison[F]) -> dict[str, Any]:
        """Further fields of a comparison's document."""
        return {}

    def step_fields(self, step: Step[F]) -> dict[str, Any]:
        """Further fields of a step's document."""
        return {}

    def candidate_fields(self, candidate: Candidate) -> dict[str, Any]:
        """Further fields of a candidate's document."""
        return {}

    def step_shares(self, discovery: Discovery[F]) -> list[float | None]:
        """By step, its share of the variance beyond the noise; [] where a search has no shares."""
        return []

    def summary(self, discovery: Discovery[F]) -> list[SummaryRow]:
        """A line for each place that acts, and for each further effect; [] where a search has no places."""
        return []

    def place_curves(self, findings: Findings[F]) -> dict[str, PlaceCurve]:
        """By name, the curve of each place that acts; {} where a search has no places."""
        return {}

    def in_one_floor(self, start: F, steps: tuple[Step[F], ...]) -> tuple[F, tuple[Step[F], ...]]:
        """The same with all errors in the noise floor of the last model, where each model has its own."""
        return start, steps

    @abstractmethod
    def require_allowed(self, effect: Effect) -> None:
        """Raises ModelError where the effect is not defined for these data."""

    def remarks(self, fit: F) -> list[str]:
        """Sentences on an error that cannot be right."""
        return []

    def cautions(self, fit: F) -> list[str]:
        """Why a fit of these data may mislead."""
        return []

    def doubts(self, fit: F) -> list[str]:
        """Doubts about the input of a fit."""
        return []

    def is_noise_known(self, fit: F) -> bool:
        """Whether the noise is known independently of the residual."""
        return True

    def fails_by_scatter_only(self, fit: F) -> bool:
        """Whether a model fails nowhere if the scatter from row to row counts as noise."""
        return False

    def compare(self, model: Model, effects: Mapping[str, Effect] | None = None) -> Comparison[F]:
        """The model against the data, fitted first if it has no values.

        If only the residual measures the noise, or the rows scatter more than their samples, the method searches for
        `effects`: only a search can separate noise from an effect then.
        """
        compared = self.compare_fit(self.evaluate(model) or self.fit(model))
        if effects is None or compared.rejection is not None or not self._needs_search(compared):
            return compared
        judgement = self.diagnose(model, effects).judgement
        if compared.fails and judgement.verdict is not Verdict.ADEQUATE:
            return compared
        return replace(compared, fails=(), given=judgement)

    def judge(self, fit: F) -> Judgement | None:
        """The judgement on a fitted model before any search: it is incomplete. None where only a search can decide.

        A model that fails nowhere is not judged: an effect may be significant without a place that fails.
        """
        compared = self.compare_fit(fit)
        undecided = compared.rejection is not None or not self.is_noise_known(fit) or self._needs_search(compared)
        if undecided or not compared.fails:
            return None
        return Judgement(
            model=fit.model.name,
            left=compared.fails[0].text,
            share_left=1.0,
            error=fit.pooled_excess,
            floor=self.floor,
            searched=False,
        )

    def compare_fit(self, fit: F) -> Comparison[F]:
        """The comparison of a fitted model, without a search."""
        return Comparison(self, fit, self.places(fit), self.rejection(fit))

    def _needs_search(self, compared: Comparison[F]) -> bool:
        """Whether only a search can separate noise from an effect."""
        if compared.fails:
            return self.fails_by_scatter_only(compared.fit)
        return not self.is_noise_known(compared.fit)

    def diagnose(self, model: Model, effects: Mapping[str, Effect]) -> Diagnosis[F]:
        """The effects that the model misses."""
        return Diagnosis.of(self.search(model, effects))

    def discover(self, model: Model, effects: Mapping[str, Effect], enough: Enough | None = None) -> Discovery[F]:
        """The model with all effects that it misses, or those that make the error small enough. Raises ModelError."""
        findings = self.search(model, effects)
        return Discovery.of(findings if enough is None else self.until(findings, enough))

    def until(self, findings: Findings[F], enough: Enough) -> Findings[F]:
        """The findings up to the first model whose error on unseen data is small enough. Raises ModelError."""
        raise ModelError(f"{self.source}: the search in a still record has no limit for the error; remove --enough")

    def add(self, effect: Effect, model: Model, effects: Mapping[str, Effect]) -> Discovery[F]:
        """The model with one effect more. Raises ModelError where it has the effect, or cannot have it."""
        if model.holds(effect.name):
            raise ModelError(f"{model.name}: {effect.name} is already in the model; it has {', '.join(model.effects)}")
        self.require_allowed(effect)
        return Discovery.of(self.addition(effect, model, effects))
