"""A chart as a neutral value: panels with axes and series. The modules `static` and `interactive` render it.

Coordinates are in the units of the axis labels. Series are drawn in their order. Colours are names of roles below;
text and grid take the colour of the page.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

INK, QUIET, FAINT, BAND = "#1f2933", "#616e7c", "#e4e7eb", "#8a96a3"
BLUE, VERMILION, GREEN, AMBER, PURPLE = "#0072b2", "#d55e00", "#009e73", "#e69f00", "#7b5ea7"  # Okabe and Ito
MEASURED, MODEL, CANDIDATE, GOOD, UNSEEN = BLUE, QUIET, VERMILION, "#007a5a", AMBER
VALUES = ("#414487", "#2a788e", "#22a884", "#7ad151", "#e3c51a")  # viridis, without its ends
SIGNED_COLOURS = ("#00456b", BLUE, "#ece8df", VERMILION, "#7a3300")
FEW_DECADES = 2.5  # of a logarithmic axis: 2 and 5 are marked too

Dash = Literal["solid", "dash", "dot"]
Along = Literal["x", "y"]
Symbol = Literal["circle", "circle-open", "diamond", "diamond-open", "triangle-up", "triangle-down", "cross"]


@dataclass(frozen=True)
class Scale:
    """Colours of points by a value from `low` to `high`; `names` of the values 0, 1, 2 where they are classes."""

    label: str
    low: float
    high: float
    signed: bool = False
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Points:
    """Markers at (x, y), each of shape (n,), with intervals from `low` to `high` along y, or of `reach` along x.

    `values` colours them by a `scale`; `hover` and `keys` (what a click or a selection returns) are one a point.
    """

    x: Array
    y: Array
    label: str = ""
    colour: str | Sequence[str] = MEASURED
    symbol: Symbol | Sequence[Symbol] = "circle"
    size: float = 6.0  # px
    low: Array | None = None
    high: Array | None = None
    reach: Array | None = None
    values: Array | None = None
    scale: Scale | None = None
    hover: Sequence[str] = ()
    keys: Sequence[int] | Sequence[str] | None = None


@dataclass(frozen=True)
class Line:
    """Points joined by a line; NaN is a gap. A `halo` keeps it visible over dots.

    `texts` are for `hover`, one a point.
    """

    x: Array
    y: Array
    label: str = ""
    colour: str = MODEL
    width: float = 1.4
    dash: Dash = "solid"
    halo: bool = False
    hover: str = ""
    markers: bool = False
    texts: Sequence[str] = ()


@dataclass(frozen=True)
class Band:
    """The area between `low` and `high` over x."""

    x: Array
    low: Array
    high: Array
    label: str = ""
    colour: str = BAND
    opacity: float = 0.3
    steps: bool = False


@dataclass(frozen=True)
class Span:
    """The area from `low` to `high` on one axis, through the whole panel."""

    low: float
    high: float
    along: Along = "y"
    colour: str = BAND
    opacity: float = 0.3


@dataclass(frozen=True)
class Rule:
    """A straight line at one value of an axis, through the whole panel."""

    at: float
    along: Along = "y"
    colour: str = QUIET
    width: float = 0.9
    dash: Dash = "solid"
    label: str = ""


@dataclass(frozen=True)
class Bars:
    """Horizontal bars number 0, 1, 2 ... from `base` to `ends`, with a text each, inside the bar or after it.

    `starts`: where texts after a bar begin; without them at its end.
    """

    base: float
    ends: Array
    colours: Sequence[str]
    texts: Sequence[str]
    inside: Sequence[bool]
    label: str = ""
    starts: Array | None = None


@dataclass(frozen=True)
class Cells:
    """A table of shares (rows, columns) from 0 to 1 as colours, with its numbers."""

    values: Array
    texts: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Note:
    """A text at (x, y) of the data; along an axis named in `shares` it is a share of the panel, 0 to 1."""

    text: str
    x: float
    y: float
    shares: str = ""
    horizontal: Literal["left", "center", "right"] = "left"
    vertical: Literal["bottom", "middle", "top"] = "bottom"
    colour: str = INK
    upright: bool = False


Series = Points | Line | Band | Span | Rule | Bars | Cells | Note


@dataclass(frozen=True)
class Axis:
    """Label with unit, scale and limits. `names` label the values 0, 1, 2 ...; dates are days since 1970."""

    label: str = ""
    log: bool = False
    low: float | None = None
    high: float | None = None
    ticks: Literal["", "quarters", "integers", "dates"] = ""
    names: tuple[str, ...] = ()
    reverse: bool = False


@dataclass(frozen=True)
class Second:
    """A second vertical axis: the first one's values less `zero`, over `scale`."""

    scale: float
    zero: float
    label: str


@dataclass(frozen=True)
class Panel:
    """Series on one pair of axes; `remark` is a title on the right, `legend` its place."""

    series: tuple[Series, ...]
    x: Axis = Axis()
    y: Axis = Axis()
    title: str = ""
    remark: str = ""
    legend: Literal["", "upper left", "upper center", "upper right", "best", "outside"] = ""
    second: Second | None = None
    equal: bool = False  # one unit is as long on both axes


@dataclass(frozen=True)
class Chart:
    """Rows of panels, `height` inches a row (or one a row); axes shared by columns or by rows of panels."""

    panels: tuple[tuple[Panel, ...], ...]
    height: float | Sequence[float] = 3.0
    width: float = 10.0
    share_x: bool = False
    share_y: bool = False
    bar: Scale | None = None  # of the colours, to the right of the panels

    @property
    def heights(self) -> list[float]:
        """Inches of each row."""
        return [self.height] * len(self.panels) if isinstance(self.height, int | float) else list(self.height)


@dataclass(frozen=True)
class Picture:
    """A chart, the name of its file without ending, a title and a caption."""

    name: str
    title: str
    caption: str
    chart: Chart = field(repr=False)

    @property
    def words(self) -> str:
        """The picture for screen readers."""
        return f"{self.title}. {self.caption}"


def single_chart(panel: Panel, height: float = 3.8) -> Chart:
    """A chart of one panel."""
    return Chart(((panel,),), height)


def stack_panels(panels: Sequence[Panel], height: float, share_x: bool = True, bar: Scale | None = None) -> Chart:
    """Panels below each other."""
    return Chart(tuple((panel,) for panel in panels), height, share_x=share_x, bar=bar)


def side_by_side(panels: Sequence[Panel], height: float, share_y: bool = False, bar: Scale | None = None) -> Chart:
    """Panels next to each other."""
    return Chart((tuple(panels),), height, share_y=share_y, bar=bar)


def floor_band(floor: float) -> tuple[Span, Rule]:
    """The noise floor: one standard deviation each way around zero."""
    return Span(-floor, floor), Rule(0.0, width=0.7)
