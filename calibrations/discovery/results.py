"""The answers of the loop, the same for every kind of data.

    Comparison  a model against data, and the places where it fails
    Diagnosis   the findings as an answer on the given model
    Discovery   the findings as an answer on the final model

The class `Dataset` has the operations that differ between kinds of data; views have the pictures that differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic

from calibrations.discovery.findings import Candidate, F, Findings, Place, Step
from calibrations.discovery.verdict import Finding, Judgement, Verdict, counted
from calibrations.model import Model
from calibrations.result import Result

if TYPE_CHECKING:
    from calibrations.design.experiment import Experiment
    from calibrations.discovery.dataset import Dataset
    from calibrations.discovery.patterns import Pattern


@dataclass(frozen=True, repr=False)
class Comparison(Result, Generic[F]):
    """A model against data: its fit, and the places where it fails, worst first.

    If the residual is the only measure of the noise, no place fails, and a search for effects judges the model.
    """

    data: Dataset[F]
    fit: F
    fails: tuple[Place, ...]
    rejection: Finding | None = None  # why the data cannot be used
    given: Judgement | None = None  # by a search for effects, where the residual is the only measure of the noise

    @property
    def adequate(self) -> bool:
        """Whether the model fails nowhere, on data that can be used, and a search finds no effect missing."""
        missing = self.given is not None and self.given.verdict is not Verdict.ADEQUATE
        return not self.fails and self.rejection is None and not missing

    def records(self) -> list[dict[str, Any]]:
        """A row a place where the model fails."""
        return [vars(place) for place in self.fails]


@dataclass(frozen=True, repr=False)
class _Answer(Result, Generic[F]):
    """The common part of diagnosis and discovery. A bench may plan `next_experiment` later."""

    findings: Findings[F]
    next_experiment: Experiment | None

    @property
    def alternatives(self) -> Mapping[str, tuple[str, ...]]:
        """By effect, those that the data cannot separate from it."""
        return self.findings.alternatives

    @property
    def reason(self) -> str | None:
        """Why the data cannot decide, in words."""
        return self.findings.reason

    @property
    def residual_structure(self) -> str | None:
        """Unexplained part of the residual, in words."""
        return self.findings.left

    @property
    def pattern(self) -> Pattern | None:
        """Unexplained part of the residual, as an expression."""
        return self.findings.pattern

    @property
    def outliers(self) -> tuple[int, ...]:
        """Numbers of the rows that were left out."""
        return self.findings.outliers


@dataclass(frozen=True, repr=False)
class Diagnosis(_Answer[F]):
    """The effects that the given model misses."""

    @classmethod
    def of(cls, findings: Findings[F]) -> Diagnosis[F]:
        """The findings as an answer on the given model."""
        needs_experiment = findings.given.verdict is not Verdict.EFFECT_MISSING
        return cls(findings, findings.experiment(findings.names) if needs_experiment else None)

    def records(self) -> list[dict[str, Any]]:
        """A row a candidate."""
        return list(self.to_dict()["candidates"])

    @property
    def judgement(self) -> Judgement:
        """The judgement on the given model."""
        return self.findings.given

    @property
    def verdict(self) -> Verdict:
        """The verdict on the given model."""
        return self.judgement.verdict

    @property
    def fit(self) -> F:
        """The given model, fitted."""
        return self.findings.start

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Every effect alone on top of the model, the next step first."""
        return self.findings.candidates

    @property
    def missing(self) -> tuple[str, ...]:
        """The effects that the model misses, in the order in which a discovery adds them."""
        return self.findings.names

    @property
    def missing_count(self) -> str:
        """How many effects the model misses, and how many of them only for the exact form of the others."""
        refinements = len(self.findings.refinements) if self.findings.causes else 0
        return counted(len(self.missing) - refinements, refinements)

    @property
    def excess_before(self) -> float:
        """Error of the given model over the noise floor."""
        return self.findings.baseline.pooled_excess

    @property
    def held_out_before(self) -> float:
        """Error of the given model on unseen data."""
        return self.findings.baseline.held_out_excess

    @property
    def caution(self) -> str | None:
        """Rows that were set aside, and why the data do not determine the given model."""
        return "; ".join(filter(None, (self.findings.set_aside, self.findings.undetermined[0]))) or None


@dataclass(frozen=True, repr=False)
class Discovery(_Answer[F]):
    """The effects that were missing, in the order added, and the final model."""

    @classmethod
    def of(cls, findings: Findings[F]) -> Discovery[F]:
        """The findings as an answer on the final model."""
        return cls(findings, findings.experiment(findings.causes))

    @property
    def model(self) -> Model:
        """The final model, with its values."""
        return self.end.model

    def records(self) -> list[dict[str, Any]]:
        """A row a step."""
        return list(self.to_dict()["steps"])

    @property
    def judgement(self) -> Judgement:
        """The judgement on the final model."""
        return self.findings.final

    @property
    def verdict(self) -> Verdict:
        """The verdict on the final model."""
        return self.judgement.verdict

    @property
    def outcome(self) -> Verdict:
        """The verdict for a label: `effect-missing` where the effects that were added complete the model."""
        complete = self.verdict is Verdict.ADEQUATE
        return Verdict.EFFECT_MISSING if complete and self.steps else self.verdict

    @property
    def start(self) -> F:
        """The given model, fitted."""
        return self.findings.start

    @property
    def steps(self) -> tuple[Step[F], ...]:
        """The effects added."""
        return self.findings.steps

    @property
    def end(self) -> F:
        """The final model, fitted."""
        return self.findings.end

    @property
    def causes(self) -> tuple[str, ...]:
        """The effects named as causes."""
        return self.findings.causes

    @property
    def refinements(self) -> tuple[str, ...]:
        """The effects added for the form of a cause."""
        return self.findings.refinements

    @property
    def undecided(self) -> bool:
        """Whether more data would decide; a small residual may only be a matter of form."""
        return self.verdict is Verdict.AMBIGUOUS and self.residual_structure is None

    @property
    def caution(self) -> str | None:
        """Rows that were set aside, and why the data do not determine the final model."""
        return "; ".join(filter(None, (self.findings.set_aside, self.findings.undetermined[1]))) or None
