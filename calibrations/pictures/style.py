"""The common style: quiet axes, colours that the colour-blind can tell apart, and grids of axes of one look.

Colours: Okabe and Ito's palette for names, viridis without its lightest part for inclinations, blue to vermilion
through white for signed values.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from calibrations.table import Array

INK, QUIET, FAINT, BAND = "#1f2933", "#616e7c", "#e4e7eb", "#d9dee4"
BLUE, VERMILION, GREEN, AMBER = "#0072b2", "#d55e00", "#009e73", "#e69f00"
SIGNED = LinearSegmentedColormap.from_list("signed", ["#00456b", BLUE, "#f7f7f5", VERMILION, "#7a3300"])
INCLINATION = LinearSegmentedColormap.from_list("inclination", colormaps["viridis"](np.linspace(0, 0.88, 64)))
WIDTH = 10.0  # inches: the width of the report's page
MARKER = 3.6

RC: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 8.0,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.edgecolor": QUIET,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": FAINT,
    "grid.linewidth": 0.7,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "text.parse_math": False,  # names are given by users: a dollar sign is a dollar sign
    "lines.linewidth": 1.1,
    "lines.markersize": MARKER,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.facecolor": "white",
    "figure.constrained_layout.use": True,
    "savefig.facecolor": "white",
    "savefig.dpi": 150,
    "svg.fonttype": "none",
    "svg.hashsalt": "rig",
    "path.simplify": False,
}

P = ParamSpec("P")


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """`draw` in the common style."""

    @wraps(draw)
    def inside(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with rc_context(RC):
            return draw(*args, **kwargs)

    return inside


def panels(rows: int, columns: int, height: float, **shared: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure of rows x columns axes, `height` inches a row, and the axes in an array of that shape."""
    figure = Figure(figsize=(WIDTH, height * rows + 0.5))
    return figure, figure.subplots(rows, columns, squeeze=False, **shared)


def floor_band(ax: Axes, floor: float) -> None:
    """The noise floor, as a band of one standard deviation each way around zero."""
    ax.axhspan(-floor, floor, color=BAND, lw=0, zorder=0.5)
    ax.axhline(0.0, color=QUIET, lw=0.7, zorder=0.6)


def quarters(ax: Axes) -> None:
    """Marks at quarters of a turn along a horizontal axis of degrees."""
    ax.xaxis.set_major_locator(MultipleLocator(90))


def beside(ax: Axes, scale: float, zero: float, label: str) -> None:
    """A second vertical axis on the right: the left one's values less `zero`, over `scale`."""

    def there(value: Array) -> Array:
        return (value - zero) / scale

    def back(value: Array) -> Array:
        return value * scale + zero

    second = ax.secondary_yaxis("right", functions=(there, back))  # type: ignore[arg-type] # stubs want any array-like
    second.set_ylabel(label)
    second.spines["right"].set_visible(True)
