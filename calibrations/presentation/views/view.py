"""The interface of a view for any kind of data: figures, tables of text, charts and albums."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Generic

from calibrations.criteria import SIGNIFICANT
from calibrations.discovery.findings import Candidate, F
from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.discovery.summary import probability_text

if TYPE_CHECKING:
    from calibrations.presentation.chart import Chart, Picture
    from calibrations.text import Cells

ONLY_ONE = "if only one is missing"  # head of the column of probabilities


class View(ABC, Generic[F]):
    """The results of one kind of data as text and pictures."""

    @abstractmethod
    def figures(self, fit: F) -> dict[str, str]:
        """The three numbers to remember of a fit, by their names."""

    @abstractmethod
    def facts(self, candidate: Candidate, diagnosis: Diagnosis[F]) -> dict[str, str]:
        """The effect of a candidate on the error, by name."""

    @abstractmethod
    def error_table(self, fit: F) -> Cells:
        """The error of each channel, as text."""

    def comparison_table(self, comparison: Comparison[F]) -> Cells | None:  # noqa: ARG002
        """Further numbers of a comparison, as text; None without any."""
        return None

    @abstractmethod
    def step_table(self, discovery: Discovery[F]) -> Cells:
        """The error after each step, as text."""

    @abstractmethod
    def candidate_table(self, diagnosis: Diagnosis[F], candidates: Sequence[Candidate]) -> Cells:
        """The held-out error and the probability of each candidate, as text."""

    @abstractmethod
    def fit_chart(self, fit: F) -> Chart:
        """A chart of a fit and its data."""

    @abstractmethod
    def steps_chart(self, discovery: Discovery[F]) -> Chart:
        """The error after each step."""

    @abstractmethod
    def fit_album(self, fit: F) -> list[Picture]:
        """The pictures of a fit and its data, with captions."""

    @abstractmethod
    def steps_album(self, discovery: Discovery[F]) -> list[Picture]:
        """The pictures of a discovery, with captions."""


def candidate_cells(
    diagnosis: Diagnosis[Any], candidates: Sequence[Candidate], error: str, probability: str, gains: bool = False
) -> Cells:
    """A row for each candidate. `error` and `probability` are heads of columns; `gains`: with the log-likelihoods.

    Only a significant candidate has a probability: for the others chance is the better explanation. It is relative to
    the other candidates: of two effects that are both missing, the one that explains less has a small one.
    """
    rows = [
        (
            c.name,
            f"{diagnosis.held_out_before:.3g} -> {c.held_out_after:.3g}",
            *((f"{c.gain / 2:.4g}" if c.gain > 1e-6 else "0",) if gains else ()),
            "yes" if c.p_value < SIGNIFICANT else "no",
            probability_text(c) or "-",
            ", ".join(c.indistinguishable_from) or "-",
        )
        for c in candidates
    ]
    gain_head = ("log-likelihood",) if gains else ()
    return ("candidate", error, *gain_head, "significant", probability, "cannot be separated from"), rows
