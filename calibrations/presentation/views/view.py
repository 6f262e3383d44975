"""The interface of a view for any kind of data: figures, tables of text, charts and albums."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Generic

from calibrations.discovery.findings import Candidate, F
from calibrations.discovery.results import Comparison, Diagnosis, Discovery

if TYPE_CHECKING:
    from calibrations.presentation.chart import Chart, Picture
    from calibrations.text import Cells


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
        """The candidates, as text."""

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
