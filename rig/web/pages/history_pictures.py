"""The pictures of a sensor's life: one quantity over time, and its control charts. A click on a point opens its run."""

from __future__ import annotations

from urllib.parse import urlencode

from nicegui import events, ui

from rig.analysis.history import Quantity
from rig.web.figures.chart import EWMA, INDIVIDUALS, RANGES, charts
from rig.web.figures.life import life
from rig.web.parts import box, div, redraw, words

LIFE = "Its life"
CLICKED = "(e) => { const k = e && e.points && e.points[0].customdata; if (k) emit(k) }"
FEW = "Control charts show from two calibrations on, a drift from three: measure this sensor again."


def model_of(data: str, model: str) -> str:
    """The address of a run on the page Model."""
    return f"/?{urlencode({'data': data, 'model': model})}"


class LifePictures:
    """Draws one quantity. `model` is that of the life, to which a point leads."""

    def __init__(self, model: str) -> None:
        self.model = model
        with div("pictures three"):
            with box("picture wide"):
                self.title = words(LIFE, "title")
                self.life = self._plot(LIFE)
                self.told = words("", "quiet small")
            self.few = box("wide state")
            with self.few:
                words(FEW, "quiet")
            self.boxes = []
            self.charts: dict[str, ui.plotly] = {}
            for title in (INDIVIDUALS, EWMA, RANGES):
                with box("picture") as place:
                    words(title, "title")
                    self.charts[title] = self._plot(title)
                self.boxes.append(place)

    def show(self, q: Quantity) -> None:
        """All of them anew."""
        redraw(self.life, life(q))
        self.told.set_text(_legend(q))
        self.few.set_visibility(q.chart is None)
        for place in self.boxes:
            place.set_visibility(q.chart is not None)
        if q.chart is not None:
            for title, figure in charts(q, q.chart).items():
                redraw(self.charts[title], figure)

    def _plot(self, title: str) -> ui.plotly:
        plot = ui.plotly({"data": [], "layout": {}}).classes("plot").props(f'aria-label="{title}"')
        plot.on("plotly_click", self._clicked, js_handler=CLICKED)
        return plot

    def _clicked(self, event: events.GenericEventArguments) -> None:
        ui.navigate.to(model_of(str(event.args), self.model))


def _legend(q: Quantity) -> str:
    """What the signs mean that are there."""
    signs = ["● a calibration, with two standard uncertainties each way"]
    if q.chart is not None and q.chart.signals:
        signs.append("◆ one beyond the limits of a chart")
    if q.line is None:
        signs.append("a drift shows from three calibrations on, at different times")
    else:
        signs.append("line and band: the drift, and the 95 % interval of the value then")
    if q.allowed is not None:
        signs.append("broken lines: what is allowed")
    return f"{'; '.join(signs)}. A click on a point opens its model."
