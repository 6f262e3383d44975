"""The forms of each result of the library: report, JSON document, pictures, and its view in a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.documents import comparison_document, diagnosis_document, discovery_document, fit_document
from calibrations.fitting.fit import Fit
from calibrations.loop import dataset
from calibrations.presentation.answers import comparison_text, diagnosis_text, discovery_text, fit_text
from calibrations.presentation.views import view_of
from calibrations.result import Presentation, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from calibrations.discovery.dataset import Dataset
    from calibrations.noise.analysis import NoiseAnalysis
    from calibrations.presentation.chart import Chart, Picture

R = TypeVar("R", bound=Result)


def presentation_of(result: Result) -> Presentation:
    """The forms of a result. Raises TypeError for a class that has none."""
    if isinstance(result, Fit):
        return FitPresentation(result)
    if isinstance(result, Comparison):
        return ComparisonPresentation(result)
    if isinstance(result, Diagnosis):
        return DiagnosisPresentation(result)
    if isinstance(result, Discovery):
        return DiscoveryPresentation(result)
    from calibrations.noise.analysis import NoiseAnalysis  # the noise engine takes 0.3 s to load; tables need none

    if isinstance(result, NoiseAnalysis):
        return NoisePresentation(result)
    raise TypeError(f"calibrations.presentation.results has no presentation of a {type(result).__name__}")


@dataclass(frozen=True)
class ResultPresentation(ABC, Generic[R]):
    """The forms of one result. Text loads no charts, and charts load no matplotlib before they are drawn."""

    result: R

    @abstractmethod
    def report(self) -> str:
        """The result as text for people."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the result."""

    @abstractmethod
    def chart(self) -> Chart:
        """The chart that shows the result best."""

    @abstractmethod
    def pictures(self) -> Sequence[Picture]:
        """The pictures of the report."""

    def plot(self) -> Figure:
        """The chart, drawn by matplotlib."""
        from calibrations.presentation.static import draw

        return draw(self.chart())

    def html(self) -> str:
        """The report with its pictures, for a notebook."""
        from calibrations.presentation.page import result_html

        return result_html(self.report(), self.pictures())


class FittedPresentation(ResultPresentation[R]):
    """The forms of a result whose pictures are those of one fit."""

    @property
    @abstractmethod
    def fitted(self) -> tuple[Dataset[Any], Any]:
        """The data and the fit that the pictures show."""

    def chart(self) -> Chart:
        """The residual, or the Allan deviations."""
        data, fit = self.fitted
        return view_of(data).fit_chart(fit)

    def pictures(self) -> Sequence[Picture]:
        """Measurement and model, the residual, and its pattern."""
        data, fit = self.fitted
        return view_of(data).fit_album(fit)


class FitPresentation(FittedPresentation[Fit]):
    """A model fitted to a table."""

    def report(self) -> str:
        """The parameters with their uncertainties, and the error of each channel with the noise floor."""
        return fit_text(self.result)

    def to_dict(self) -> dict[str, Any]:
        """`rig.fit/1`."""
        return fit_document(dataset(self.result.table), self.result, None)

    @property
    def fitted(self) -> tuple[Dataset[Any], Any]:
        """The data, and the fit."""
        return dataset(self.result.table), self.result


class ComparisonPresentation(FittedPresentation[Comparison[Any]]):
    """A model against data."""

    def report(self) -> str:
        """The error of each channel, and the places where the model fails."""
        return comparison_text(self.result)

    def to_dict(self) -> dict[str, Any]:
        """`rig.comparison/1`."""
        return comparison_document(self.result, self.result.fit.model.name)

    @property
    def fitted(self) -> tuple[Dataset[Any], Any]:
        """The data, and the fit of the model."""
        return self.result.data, self.result.fit


class DiagnosisPresentation(FittedPresentation[Diagnosis[Any]]):
    """The effects that a model misses."""

    def report(self) -> str:
        """The verdict on the given model, its candidates, and the best of them."""
        return diagnosis_text(self.result)

    def to_dict(self) -> dict[str, Any]:
        """`rig.diagnosis/1`."""
        return diagnosis_document(self.result, self.result.fit.model.name)

    @property
    def fitted(self) -> tuple[Dataset[Any], Any]:
        """The data, and the fit of the given model."""
        return self.result.findings.data, self.result.fit


class DiscoveryPresentation(ResultPresentation[Discovery[Any]]):
    """The effects that were missing, and the final model."""

    def report(self) -> str:
        """The error after each step, the verdict, and the final model."""
        result = self.result
        return f"{result.findings.data.description}\n\n{discovery_text(result)}\n\n{result.model.params}"

    def to_dict(self) -> dict[str, Any]:
        """`rig.discovery/1`."""
        return discovery_document(self.result, None)

    def chart(self) -> Chart:
        """Error by model."""
        return view_of(self.result.findings.data).steps_chart(self.result)

    def pictures(self) -> Sequence[Picture]:
        """Error by model, and the signal of each effect."""
        return view_of(self.result.findings.data).steps_album(self.result)


class NoisePresentation(ResultPresentation[Any]):
    """The noise of a still record."""

    result: NoiseAnalysis

    def report(self) -> str:
        """Coefficients, density and Allan deviation of each channel."""
        from calibrations.presentation.noise_text import summary

        return summary(self.result)

    def to_dict(self) -> dict[str, Any]:
        """`rig.noise/1`."""
        from calibrations.noise.analysis import noise_document

        return noise_document(self.result)

    def chart(self) -> Chart:
        """The Allan deviation of the first channel."""
        return self.pictures()[0].chart

    def pictures(self) -> Sequence[Picture]:
        """Allan deviation and spectrum of each channel."""
        from calibrations.presentation.charts.noise import noise_album

        return noise_album(self.result)
