"""The forms of each result of the library: report, JSON document, pictures, and its view in a notebook."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

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
    from calibrations.presentation.chart import Chart, Picture


@dataclass(frozen=True)
class ResultPresentation:
    """The forms of one result. Text loads no charts, and charts load no matplotlib before they are drawn.

    report    the result as text for people
    to_dict   the JSON document of the result
    chart     the chart that shows the result best
    pictures  the pictures of the report
    """

    report: Callable[[], str]
    to_dict: Callable[[], dict[str, Any]]
    chart: Callable[[], Chart]
    pictures: Callable[[], Sequence[Picture]]

    def plot(self) -> Figure:
        """The chart, drawn by matplotlib."""
        from calibrations.presentation.static import draw

        return draw(self.chart())

    def html(self) -> str:
        """The report with its pictures, for a notebook."""
        from calibrations.presentation.page import result_html

        return result_html(self.report(), self.pictures())


def presentation_of(result: Result) -> Presentation:
    """The forms of a result. Raises TypeError for a class that has none."""
    if isinstance(result, Fit):
        data = dataset(result.table)
        return _fit_presentation(data, result, partial(fit_text, result), partial(fit_document, data, result, None))
    if isinstance(result, Comparison):
        document = partial(comparison_document, result, result.fit.model.name)
        return _fit_presentation(result.data, result.fit, partial(comparison_text, result), document)
    if isinstance(result, Diagnosis):
        document = partial(diagnosis_document, result, result.fit.model.name)
        return _fit_presentation(result.findings.data, result.fit, partial(diagnosis_text, result), document)
    if isinstance(result, Discovery):
        view, document = view_of(result.findings.data), partial(discovery_document, result, None)
        return ResultPresentation(
            partial(_discovery_report, result), document, partial(view.steps_chart, result),
            partial(view.steps_album, result),
        )  # fmt: skip
    return _noise(result)


def _fit_presentation(
    data: Dataset[Any], fit: Any, report: Callable[[], str], document: Callable[[], dict[str, Any]]
) -> ResultPresentation:
    """A result whose pictures are those of one fit."""
    view = view_of(data)
    return ResultPresentation(report, document, partial(view.fit_chart, fit), partial(view.fit_album, fit))


def _discovery_report(result: Discovery[Any]) -> str:
    """The error after each step, the verdict, and the final model."""
    return f"{result.findings.data.description}\n\n{discovery_text(result)}\n\n{result.model.params}"


def _noise(result: Result) -> ResultPresentation:
    """Coefficients, density and Allan deviation of each channel of a still record."""
    from calibrations.noise.analysis import NoiseAnalysis, noise_document  # takes 0.3 s to load; tables need none
    from calibrations.presentation.noise_text import summary

    if not isinstance(result, NoiseAnalysis):
        raise TypeError(f"calibrations.presentation.results has no presentation of a {type(result).__name__}")

    def album() -> Sequence[Picture]:
        from calibrations.presentation.charts.noise import noise_album

        return noise_album(result)

    return ResultPresentation(
        partial(summary, result), partial(noise_document, result), lambda: album()[0].chart, album
    )
