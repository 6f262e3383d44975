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
from rig.web.parts import div, notify_error, redraw, words

_CHARTS: WeakKeyDictionary[ui.plotly, Chart] = WeakKeyDictionary()


EMPTY = {"data": [], "layout": {"xaxis": {"visible": False}, "yaxis": {"visible": False},
                                "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)"}}  # fmt: skip


def empty_plot(title: str, classes: str = "plot") -> ui.plotly:
    """A plot without axes, until `draw` draws a chart in it."""
    return ui.plotly(EMPTY).classes(classes).props(f'role=group aria-label="{title}"')


def plot_with_title(title: str, legend: str = "", classes: str = "plot", name: str = "") -> ui.plotly:
    """An empty plot below its title, the menu of its downloads, and its legend. `name`: for screen readers."""
    with div("title"):
        words(title, "grow")
        downloads(lambda: plot, title)
    if legend:
        words(legend, "legend quiet")
    plot = empty_plot(name or title, classes)
    return plot


class AxisAndUnit:
    """Controls that select the channel and the unit of the pictures."""

    axis: ui.toggle | ui.select
    unit: ui.toggle

    def next_axis(self) -> None:
        """Select the next channel."""
        self.axis.set_value((int(self.axis.value or 0) + 1) % len(self.axis.options))

    def other_unit(self) -> None:
        """Switch between V and g, if the scale factor is known."""
        if len(self.unit.options) > 1:
            self.unit.set_value(not self.unit.value)


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
        notify_error(error)
        return
    ui.download.content(content, f"{re.sub(r'[^a-z0-9]+', '-', name.lower()).strip('-')}.{form}")
