"""The forms of every result: text, a JSON document, a data frame, a picture, the view of a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from calibrations.frames import data_frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from calibrations.presentation.chart import Picture


class ReportedResult(ABC):
    """A value that a terminal and a notebook show as its report. A dataclass that is one needs `repr=False`."""

    @abstractmethod
    def report(self) -> str:
        """The value as text for people."""

    def __repr__(self) -> str:
        return self.report()

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.report())}</pre>"


class Result(ReportedResult):
    """A result of an analysis."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the result, as the command line prints it with --json."""

    @abstractmethod
    def records(self) -> Sequence[Mapping[str, Any]]:
        """The rows of `to_dataframe`, by column."""

    @abstractmethod
    def plot(self) -> Figure:
        """The picture that shows the result best."""

    @abstractmethod
    def pictures(self) -> Sequence[Picture]:
        """The pictures of the report, which a notebook shows below the text."""

    def to_dataframe(self) -> Any:
        """The result's rows as a pandas.DataFrame. Raises CalibrationError where pandas is not installed."""
        return data_frame(list(self.records()))

    def _repr_html_(self) -> str:
        from calibrations.presentation.page import result_html  # the terminal needs no pictures

        return result_html(self.report(), self.pictures())
