"""Pictures of pages: drawn by Plotly, and downloaded as the report draws them, as SVG or PNG."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Literal
from weakref import WeakKeyDictionary

from nicegui import ui

from calibrations.presentation.chart import Chart
from calibrations.presentation.interactive import figure
from rig.web.calculations import off_loop
from rig.web.parts import message, redraw

_CHARTS: WeakKeyDictionary[ui.plotly, Chart] = WeakKeyDictionary()


EMPTY = {"data": [], "layout": {"xaxis": {"visible": False}, "yaxis": {"visible": False},
                                "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)"}}  # fmt: skip


def empty_plot(title: str, classes: str = "plot") -> ui.plotly:
    """A plot without axes, until `draw` draws a chart in it."""
    return ui.plotly(EMPTY).classes(classes).props(f'role=group aria-label="{title}"')


def draw(plot: ui.plotly, chart: Chart, keep: str, drag: Literal["select", "zoom", False] = "zoom") -> None:
    """Draw a chart in a plot; `keep` names what keeps its zoom."""
    remember(plot, chart)
    redraw(plot, figure(chart, keep, drag))


def remember(plot: ui.plotly, chart: Chart) -> None:
    """The chart that a download of this plot draws."""
    _CHARTS[plot] = chart


def downloads(plot: Callable[[], ui.plotly | None], name: str) -> None:
    """A button with a menu: the picture as SVG or PNG. `plot` is asked at the click: it may be made later."""
    with ui.button(icon="download").props(f'flat round dense size=sm aria-label="Download: {name}"'):
        ui.tooltip("Download this picture")
        with ui.menu():
            for form in ("svg", "png"):
                ui.menu_item(form.upper(), on_click=partial(_download, plot, name, form))


async def _download(plot: Callable[[], ui.plotly | None], name: str, form: str) -> None:
    from calibrations.presentation import static

    picture = plot()
    chart = _CHARTS.get(picture) if picture is not None else None
    if chart is None:
        ui.notify("This picture is not drawn yet.", type="warning")
        return
    try:
        content = await off_loop({"svg": static.svg, "png": static.png}[form], chart)
    except Exception as error:
        ui.notify(message(error), type="negative", multi_line=True)
        return
    ui.download.content(content, f"{re.sub(r'[^a-z0-9]+', '-', name.lower()).strip('-')}.{form}")
