"""The forms of every result: text, a JSON document, a data frame, a picture, the view of a notebook.

A result holds values only. `calibrations.presentation` gives it its other forms: it is above all results, so no module
here imports it. `calibrations.face`, which every import of the library loads, registers it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

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


class Presentation(Protocol):
    """The forms of one result. The methods of `Result` describe them."""

    def report(self) -> str: ...

    def to_dict(self) -> dict[str, Any]: ...

    def plot(self) -> Figure: ...

    def pictures(self) -> Sequence[Picture]: ...

    def html(self) -> str: ...


class Result(ReportedResult):
    """A result of an analysis."""

    _presentation: ClassVar[Callable[[Result], Presentation]]

    @staticmethod
    def register_presentation(presentation_of: Callable[[Result], Presentation]) -> None:
        """Give all results their forms."""
        Result._presentation = presentation_of

    @abstractmethod
    def records(self) -> Sequence[Mapping[str, Any]]:
        """The rows of `to_dataframe`, by column."""

    def to_dataframe(self) -> Any:
        """The result's rows as a pandas.DataFrame. Raises CalibrationError where pandas is not installed."""
        return data_frame(list(self.records()))

    def report(self) -> str:
        """The result as text for people."""
        return self._presentation().report()

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the result, as the command line prints it with --json."""
        return self._presentation().to_dict()

    def plot(self) -> Figure:
        """The picture that shows the result best."""
        return self._presentation().plot()

    def pictures(self) -> Sequence[Picture]:
        """The pictures of the report, which a notebook shows below the text."""
        return self._presentation().pictures()

    def _repr_html_(self) -> str:
        return self._presentation().html()
