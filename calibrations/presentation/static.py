"""Charts drawn by matplotlib: PNG and SVG files, and SVG inside a report. The same chart gives the same bytes."""

from __future__ import annotations

import hashlib
import io
import pickle
import re
from collections import OrderedDict
from collections.abc import Callable, Mapping
from functools import singledispatch
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, ListedColormap, Normalize, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator, NullFormatter

from calibrations.errors import CalibrationError
from calibrations.presentation import chart as c
from calibrations.presentation.smaller_svg import compact
from calibrations.text import tick_text

RC: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 8.0,
    "axes.labelcolor": c.INK,
    "axes.titlecolor": c.INK,
    "axes.edgecolor": c.QUIET,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": c.FAINT,
    "grid.linewidth": 0.7,
    "xtick.color": c.QUIET,
    "ytick.color": c.QUIET,
    "xtick.labelcolor": c.INK,
    "ytick.labelcolor": c.INK,
    "text.color": c.INK,
    "text.parse_math": False,  # names are given by users: a dollar sign is a dollar sign
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
PX = 0.6  # points of a printed marker for one pixel on a screen
LINE = 0.8
DASHES = {"solid": "-", "dash": "--", "dot": ":"}
SYMBOLS = {"circle": "o", "diamond": "D", "triangle-up": "^", "triangle-down": "v", "cross": "+"}
FEW_MARKS, LONG_MARK = 4, 200.0  # marks of an axis with values larger than this multiple of its range
MOST_DRAWN = 64  # elements in memory: those of some reports
MOST_LEVEL = 8  # names on a horizontal axis; more are written aslant
DROPPED_MARKUP = (
    r"<metadata>.*?</metadata>",
    r"<style.*?</style>",
    r' xmlns(:\w+)?="[^"]*"',
    r' (width|height)="[\d.]+pt"',
)
REFERENCE = re.compile(r'(?:(?<=url\()|(?<=href="))#([\w.-]+)')


class PictureError(CalibrationError):
    """A picture cannot be written: its format, or its place."""


class NotebookFigure(Figure):
    """A figure that a notebook shows without pyplot, which otherwise registers the display of figures."""

    def _repr_png_(self) -> bytes:
        return _savefig(self, dpi="figure")


def draw(chart: c.Chart) -> Figure:
    """The chart as a matplotlib figure."""
    rows, columns = len(chart.panels), max(map(len, chart.panels))
    with rc_context(RC):
        figure = NotebookFigure(figsize=(chart.width, sum(chart.heights) + 0.5))
        share: Any = {"sharex": "col" if chart.share_x else False, "sharey": "row" if chart.share_y else False}
        axes = figure.subplots(rows, columns, squeeze=False, height_ratios=chart.heights, **share)
        for k, row in enumerate(chart.panels):
            for j in range(columns):
                if j < len(row):
                    _panel(axes[k, j], row[j], k == rows - 1 or not chart.share_x, j == 0 or not chart.share_y)
                else:
                    axes[k, j].set_visible(False)
        if any(panel.equal for row in chart.panels for panel in row):
            figure.set_layout_engine("compressed")
        if chart.bar is not None:
            _colour_bar(figure, axes, chart.bar)
    return figure


def svg(chart: c.Chart) -> bytes:
    """The chart as an SVG document. Text stays text; the fallback font has the same width."""
    page, figure = io.BytesIO(), draw(chart)
    figure.set_dpi(RC["savefig.dpi"])  # of pictures inside of it, such as the bar of a colour scale
    with rc_context(RC):  # `savefig` gives the same bytes, but draws the figure twice
        canvas: Any = FigureCanvasSVG(figure)  # it has no types
        canvas.print_svg(page, metadata={"Date": None, "Creator": None})
    text = page.getvalue().decode()
    return compact(text.replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")).encode()


def png(chart: c.Chart) -> bytes:
    """The chart as a PNG, 150 dots an inch."""
    return _savefig(draw(chart), metadata={"Software": None})


def inline(chart: c.Chart, name: str, words: str) -> str:
    """The chart as an SVG element for a page: it loads nothing, and those ids that it uses begin with `name`.

    `words` describe it for screen readers. A chart of the same content is drawn once.
    """
    content = pickle.dumps((chart, name, words))
    if (text := drawn(content)) is None:
        remember(content, text := _draw_inline(chart, name, words))
    return text


# Elements in memory, by the pickled arguments of `inline`: the digest of these, and the element.
_DRAWN: OrderedDict[bytes, str] = OrderedDict()


def drawn(content: bytes) -> str | None:
    """The element of these pickled arguments of `inline`, if it is in memory."""
    return _DRAWN.get(hashlib.sha256(content).digest())


def remember(content: bytes, text: str) -> None:
    """Keep an element in memory, in place of the oldest one if there are many."""
    _DRAWN[hashlib.sha256(content).digest()] = text
    while len(_DRAWN) > MOST_DRAWN:
        _DRAWN.popitem(last=False)


def _draw_inline(chart: c.Chart, name: str, words: str) -> str:
    text = svg(chart).decode()
    text = text[text.index("<svg") :].strip()
    for pattern in DROPPED_MARKUP:
        text = re.sub(pattern, "", text, flags=re.DOTALL)
    used = {target: f"{name}-{k}" for k, target in enumerate(dict.fromkeys(REFERENCE.findall(text)))}
    text = re.sub(r' id="([^"]*)"', lambda match: f' id="{used[match[1]]}"' if match[1] in used else "", text)
    text = REFERENCE.sub(lambda match: f"#{used[match[1]]}", text).replace("xlink:href", "href")
    return text.replace("<svg", f'<svg role="img" aria-label="{escape(words)}"', 1)


def save(chart: c.Chart, path: Path) -> None:
    """Write the chart to `path`, whole or not at all, in the format of its ending.

    Raises PictureError for another ending than .png and .svg, or where the file cannot be written.
    """
    formats: dict[str, Callable[[c.Chart], bytes]] = {".png": png, ".svg": svg}
    make = formats.get(path.suffix.lower())
    if make is None:
        raise PictureError(f'{path}: pictures end in .png or .svg, not in "{path.suffix}"; rename it')
    draft = path.with_name(f".{path.name}.part")
    try:
        draft.write_bytes(make(chart))
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise PictureError(f"{path}: the picture cannot be written: {error.strerror}") from None


def save_all(charts: Mapping[str, c.Chart], folder: Path, form: str) -> list[Path]:
    """Write charts by name into `folder`, which is made if needed; returns their paths. Raises PictureError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PictureError(f"{folder}: the folder cannot be made: {error.strerror}") from None
    paths = {folder / f"{name}.{form}": chart for name, chart in charts.items()}
    for path, chart in paths.items():
        save(chart, path)
    return list(paths)


def _savefig(figure: Figure, **layout: Any) -> bytes:
    page = io.BytesIO()
    with rc_context(RC):
        figure.savefig(page, format="png", **layout)
    return page.getvalue()


def _panel(ax: Axes, panel: c.Panel, last: bool, first: bool) -> None:
    for series in panel.series:
        _series(series, ax)
    _axis(ax, panel.x, "x", last)
    _axis(ax, panel.y, "y", first)
    ax.set_title(panel.title)
    if panel.remark:
        ax.set_title(panel.remark, loc="right", fontweight="normal", fontsize=9)
    if panel.equal:
        ax.set_aspect("equal")
    if panel.legend == "outside":
        ax.figure.legend(loc="outside upper left", ncols=7, handlelength=1.4)
    elif panel.legend:
        ax.legend(loc=panel.legend, ncols=2 if panel.legend != "best" else 1)
    if panel.second is not None:
        _second(ax, panel.second)


def _axis(ax: Axes, axis: c.Axis, direction: c.Along, labelled: bool) -> None:
    side = ax.xaxis if direction == "x" else ax.yaxis
    if axis.log:
        (ax.set_xscale if direction == "x" else ax.set_yscale)("log")
    if axis.names:
        side.set_ticks(range(len(axis.names)), axis.names)
        ax.grid(visible=False, axis=direction)
        if direction == "x" and len(axis.names) > MOST_LEVEL:
            ax.tick_params(axis="x", rotation=30)
    elif axis.ticks == "quarters":
        side.set_major_locator(MultipleLocator(90))
    elif axis.ticks == "integers":
        side.set_major_locator(MaxNLocator(integer=True))
    elif axis.ticks == "dates":
        ax.xaxis_date()
    elif direction == "x" and not axis.log and _long_marks(*ax.get_xlim()):
        side.set_major_locator(MaxNLocator(FEW_MARKS))
    limits: Any = (axis.low, axis.high)
    if limits != (None, None):
        (ax.set_xlim if direction == "x" else ax.set_ylim)(*limits)
    if axis.reverse:
        (ax.invert_xaxis if direction == "x" else ax.invert_yaxis)()
    if axis.log:
        _mark_powers(ax, direction)
    if labelled and axis.label:
        (ax.set_xlabel if direction == "x" else ax.set_ylabel)(axis.label)


def _long_marks(low: float, high: float) -> bool:
    """Whether the marks of this range have many digits, and would touch each other."""
    return high > low and max(abs(low), abs(high)) > LONG_MARK * (high - low)


def _mark_powers(ax: Axes, direction: c.Along) -> None:
    """Marks of a logarithmic axis in plain text: powers of ten, and 2 and 5 if there are few powers."""
    side, (low, high) = (ax.xaxis, ax.get_xlim()) if direction == "x" else (ax.yaxis, ax.get_ylim())
    side.set_major_formatter(FuncFormatter(lambda value, _: tick_text(value)))
    few_decades = abs(np.log10(high / low)) < c.FEW_DECADES
    side.set_minor_formatter(FuncFormatter(_two_five_text) if few_decades else NullFormatter())


def _two_five_text(value: float, _: int | None = None) -> str:
    return tick_text(value) if f"{value:.0e}"[0] in "25" else ""


def _second(ax: Axes, second: c.Second) -> None:
    def converted(value: c.Array) -> c.Array:
        return (value - second.zero) / second.scale

    def back(value: c.Array) -> c.Array:
        return value * second.scale + second.zero

    second_axis = ax.secondary_yaxis("right", functions=(converted, back))  # type: ignore[arg-type] # stubs want any array-like
    second_axis.set_ylabel(second.label)
    second_axis.spines["right"].set_visible(True)


def _map(scale: c.Scale) -> tuple[Colormap, Normalize]:
    if scale.names:
        colours = (c.BLUE, c.VERMILION, c.GREEN)[: len(scale.names)]
        return ListedColormap(colours), Normalize(-0.5, len(scale.names) - 0.5)
    colours = c.SIGNED_COLOURS if scale.signed else c.VALUES
    return LinearSegmentedColormap.from_list("values", colours), Normalize(scale.low, scale.high)


def _colour_bar(figure: Figure, axes: Any, scale: c.Scale) -> None:
    colours, norm = _map(scale)
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes, label=scale.label, aspect=40, pad=0.01)
    if scale.names:
        bar.set_ticks(range(len(scale.names)), labels=list(scale.names))


@singledispatch
def _series(series: c.Series, ax: Axes) -> None:  # noqa: ARG001 the arguments of all kinds
    raise TypeError(series)


@_series.register
def _points(s: c.Points, ax: Axes) -> None:
    x, y = np.asarray(s.x), np.asarray(s.y)
    edges = _edges(s, len(x))
    if s.low is not None and s.high is not None:
        ax.vlines(x, s.low, s.high, colors=edges if s.values is None else c.QUIET, lw=LINE, zorder=1.8)
    if s.reach is not None:
        ax.hlines(y, x - s.reach, x + s.reach, colors=edges, lw=LINE, zorder=1.8)
    symbols = np.array([s.symbol] * len(x) if isinstance(s.symbol, str) else list(s.symbol))
    label = s.label
    for symbol in dict.fromkeys(symbols.tolist()):
        rows = np.flatnonzero(symbols == symbol)
        shape, hollow = symbol.removesuffix("-open"), symbol.endswith("-open")
        point_colours = edges[rows]
        colours: dict[str, Any] = {"facecolors": "none" if hollow else point_colours}
        if shape != "cross":  # a cross has no edge, and matplotlib warns of one
            colours["edgecolors"] = point_colours
        ax.scatter(x[rows], y[rows], s=(PX * s.size) ** 2, marker=SYMBOLS[shape], **colours,
                   linewidths=LINE, zorder=2, label=label or None)  # fmt: skip
        label = ""


def _edges(s: c.Points, n: int) -> Any:
    """The colour of each point, shape (n, 4)."""
    if s.values is not None and s.scale is not None:
        colours, norm = _map(s.scale)
        return colours(norm(np.asarray(s.values, float)))
    return to_rgba_array([s.colour] * n if isinstance(s.colour, str) else list(s.colour))


@_series.register
def _line(s: c.Line, ax: Axes) -> None:
    halo = [Stroke(linewidth=s.width + 2, foreground="white"), Normal()] if s.halo else None
    ax.plot(s.x, s.y, DASHES[s.dash], color=s.colour, lw=LINE * s.width, label=s.label or None, path_effects=halo,
            marker="o" if s.markers else None, ms=3.0, zorder=4 if s.halo else 1.5)  # fmt: skip


@_series.register
def _band(s: c.Band, ax: Axes) -> None:
    ax.fill_between(s.x, s.low, s.high, color=s.colour, alpha=s.opacity, lw=0, label=s.label or None, zorder=0.5,
                    step="mid" if s.steps else None)  # fmt: skip


@_series.register
def _span(s: c.Span, ax: Axes) -> None:
    (ax.axhspan if s.along == "y" else ax.axvspan)(s.low, s.high, color=s.colour, alpha=s.opacity, lw=0, zorder=0.4)


@_series.register
def _rule(s: c.Rule, ax: Axes) -> None:
    place: Any = ax.axhline if s.along == "y" else ax.axvline
    place(s.at, color=s.colour, lw=LINE * s.width, ls=DASHES[s.dash], label=s.label or None, zorder=0.6)


@_series.register
def _bars(s: c.Bars, ax: Axes) -> None:
    places = np.arange(len(s.ends))
    ax.barh(places, np.asarray(s.ends) - s.base, 0.6, s.base, color=list(s.colours), zorder=1, label=s.label or None)
    starts = s.ends if s.starts is None else s.starts
    for k, (start, text, inside) in enumerate(zip(starts, s.texts, s.inside, strict=True)):
        place, offset_px = (s.base, 6) if inside else (start, 12)
        ax.annotate(text, (place, k), (offset_px, 0), textcoords="offset points", va="center", zorder=3,
                    color="white" if inside else c.INK)  # fmt: skip


@_series.register
def _cells(s: c.Cells, ax: Axes) -> None:
    colours = LinearSegmentedColormap.from_list("signed", c.SIGNED_COLOURS)
    ax.imshow(s.values, cmap=colours, vmin=-1, vmax=1, aspect="auto")
    for (row, column), value in np.ndenumerate(np.asarray(s.values)):
        dark = "white" if value > 0.5 else c.INK
        ax.text(column, row, s.texts[row][column], ha="center", va="center", color=dark)
    ax.tick_params(length=0)


@_series.register
def _note(s: c.Note, ax: Axes) -> None:
    places: Any = tuple("axes fraction" if along in s.shares else "data" for along in "xy")
    offset_px = {"left": 4, "center": 0, "right": -4}[s.horizontal]
    up = {"bottom": 3, "middle": 0, "top": -3}[s.vertical]
    ax.annotate(s.text, (s.x, s.y), (offset_px, up), xycoords=places, textcoords="offset points", ha=s.horizontal,
                va="center" if s.vertical == "middle" else s.vertical, color=s.colour, fontsize=8.5,
                rotation=90 if s.upright else 0, zorder=5)  # fmt: skip
