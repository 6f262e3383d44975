"""The four pictures of the model page: a selection in one appears in all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import events, ui

from calibrations.discovery.places import rows_at
from calibrations.fitting.fit import axis_of
from calibrations.presentation.chart import single_chart
from calibrations.presentation.charts import motion
from calibrations.presentation.charts.contribution import is_function, select_telling_column
from calibrations.presentation.charts.discovery import levels, waterfall
from calibrations.presentation.charts.fit import failure, measurement, model_is_line, residual
from calibrations.presentation.interactive import figure
from calibrations.presentation.residual import ChannelResidual, Column, choices, first_choices, residual_units
from rig.web.parts import box, div, redraw, words
from rig.web.pictures import AxisAndUnit, downloads, draw, empty_plot, remember

if TYPE_CHECKING:
    from calibrations.discovery.findings import Place, Step
    from calibrations.discovery.results import Comparison
    from calibrations.fitting.fit import Fit
    from rig.services.session import ModelSession

BAR_PX, AXIS_PX = 19, 60  # a bar with its text, and the axis below the bars
LONG = 4  # letters in a channel name
LINKED_PICTURES = ("measurement", "residual", "failure")
TITLES = {
    "measurement": "Measurement and model",
    "residual": "Residuals",
    "failure": "Residual pattern",
    "waterfall": "Error by model",
}
FOLLOWED = "followed"  # the column against which the curve of a candidate is drawn
POINTS = (
    "(e) => { if (e && e.points) emit(e.points.map(p => p.customdata).filter(k => k !== undefined && k !== null)) }"
)


class Pictures(AxisAndUnit):
    """Pictures of a fit: axis, unit, column and selected rows."""

    def __init__(
        self, leave_out: Callable[[Sequence[int]], None] | None, selects: Callable[[], None], first: Sequence[int]
    ) -> None:
        """`leave_out` receives the numbers of selected rows; None if they cannot be excluded. `selects` is called after
        a selection. `first` are the points that are selected from the start."""
        self.leave_out, self.selects, self.first = leave_out, selects, first
        self.fit: Fit | None = None
        self.session: ModelSession[Fit] | None = None
        self.step: Step[Fit] | None = None
        self.columns: dict[str, Column] = {}
        self.selected: list[int] = []
        self.plots: dict[str, ui.plotly] = {}
        self.legends: dict[str, ui.label] = {}
        with div("pictures"):
            self._controls()
            for name in TITLES:
                self._picture(name)

    def _controls(self) -> None:
        with box("controls row-of"):
            self.axis = ui.toggle({0: "x"}, value=0, on_change=self.draw)
            self.axis.props("dense no-caps")
            self.unit = ui.toggle({False: "V", True: "g"}, value=False, on_change=self.draw).props("dense no-caps")
            self.x = self._column("against")
            self.colour = self._column("coloured by")
            self.hint = words("", "told quiet small")
            self.clear = ui.button("Clear selection", on_click=lambda: self.select([])).props("flat dense")
            self.leave = ui.button("Exclude", icon="block", on_click=self.leave_selected).props("flat dense")
            for button in (self.clear, self.leave):
                button.set_visibility(False)

    def _column(self, label: str) -> ui.select:
        selector = ui.select({}, label=label, on_change=self.draw).style("min-width: 150px")
        return selector.props("dense options-dense stack-label")  # a label that floats up late covers the value

    def _picture(self, name: str) -> None:
        with box("picture"):
            with div("title"):
                words(TITLES[name])
                ui.element("div").classes("space")
                if name == "residual":
                    self.considered = ui.button(icon="close", on_click=lambda: self.consider(None))
                    self.considered.props("flat dense size=sm icon-right=close").props(remove="icon")
                    self.considered.set_visibility(False)
                downloads(partial(self.plots.get, name), TITLES[name])
            self.legends[name] = words("", "legend quiet")
            plot = self.plots[name] = empty_plot(TITLES[name])
        if name in LINKED_PICTURES:
            plot.on("plotly_selected", self._select_brushed, js_handler=POINTS)
            plot.on("plotly_deselect", lambda: self.select([]), js_handler="() => emit()")

    def show(self, compared: Comparison[Fit], session: ModelSession[Fit]) -> None:
        """Show a new fit; selections stay if possible."""
        fit = compared.fit
        if self.fit is None:
            self.selected = [k for k in self.first if k < fit.table.n]
        elif self.fit.table.n != fit.table.n:
            self.selected = []
        self.fit, self.session, self.step = fit, None, None  # nothing is drawn before all fields are set
        self.columns = choices(fit)
        x, colour = first_choices(list(self.columns), fit.table)
        self._offer(fit.channels)
        self.unit.set_options(residual_units(fit), value=fit.table.type.magnitude or bool(self.unit.value))
        self.unit.set_visibility(len(self.unit.options) > 1)
        for select, first in ((self.x, x), (self.colour, colour)):
            value = select.value if select.value in self.columns else first
            select.set_options({name: column.labels[0] for name, column in self.columns.items()}, value=value)
        self.considered.set_visibility(False)
        self.session = session
        self.draw()

    def _offer(self, channels: Sequence[str]) -> None:
        """Offer the channels: buttons for short names, else a list."""
        value = min(self.c, len(channels) - 1)
        if max(map(len, channels)) > LONG and isinstance(self.axis, ui.toggle):
            with self.axis.parent_slot.parent:  # type: ignore[union-attr] # it has a place
                selector = ui.select({0: ""}, value=0, label="output", on_change=self.draw).props("dense options-dense")
            selector.move(target_index=0)
            self.axis.delete()
            self.axis = selector
        self.axis.set_options(dict(enumerate(channels)), value=value)
        self.axis.set_visibility(len(channels) > 1)

    def consider(self, step: Step[Fit] | None, look: bool = False) -> None:
        """Draw an effect in the residual; None removes it. With `look`, against the column that it follows."""
        if self.fit is None:
            return
        self.step = step
        self.columns.pop(FOLLOWED, None)
        same_column: str | None = None
        if step is not None and look:
            column = select_telling_column(step)
            same_column = next((name for name in self.columns if name == column.name), None)
            if same_column is None:
                self.columns[FOLLOWED] = column
        if step is not None:
            self.considered.set_text(step.name)
        self.considered.set_visibility(step is not None)
        value = self.x.value if self.x.value in self.columns else next(iter(self.columns))
        if step is not None and look:
            value = same_column or FOLLOWED
        session, self.session = self.session, None  # draw once
        self.x.set_options({name: column.labels[self.c] for name, column in self.columns.items()}, value=value)
        self.session = session
        self.draw()

    @property
    def c(self) -> int:
        """The shown channel."""
        return int(self.axis.value or 0)

    @property
    def shown(self) -> ChannelResidual:
        """The drawn rows."""
        assert self.fit is not None  # noqa: S101 nothing is drawn before there is a fit
        return ChannelResidual(self.fit, min(self.c, len(self.fit.channels) - 1), bool(self.unit.value))

    def draw(self) -> None:
        """Draw all pictures again."""
        if self.fit is None or self.session is None or self.x.value not in self.columns:
            return
        session, channel = self.session, self.shown
        colour = self.columns.get(self.colour.value or "", self.columns[self.x.value])
        is_motion = channel.fit.table.type.moving  # samples are drawn, not rows
        abscissa = self.columns[self.x.value if self.x.value != FOLLOWED else next(iter(self.columns))]
        panels = {
            "measurement": motion.measurement(channel) if is_motion else measurement(channel, abscissa, colour),
            "residual": residual(channel, self.columns[self.x.value], colour, self.step),
            "failure": motion.failure(channel) if is_motion else failure(channel),
        }
        self._legends(channel, abscissa)
        for name, panel in panels.items():
            linked = not is_motion or name == "residual"
            keep = f"{panel.x.label} {panel.y.label}"
            picture = figure(single_chart(replace(panel, title="", second=None)), keep, "select" if linked else "zoom")
            if linked and self.selected:
                picture["data"][_dots(picture)]["selectedpoints"] = self.selected
            remember(self.plots[name], single_chart(panel))
            redraw(self.plots[name], picture)
        steps = levels(session)
        for name in ("failure", "waterfall"):  # a row of the grid
            self.plots[name].style(f"min-height: {BAR_PX * len(steps) + AXIS_PX}px")
        draw(self.plots["waterfall"], waterfall(steps), "waterfall", False)
        self._show_hint(channel)

    def _legends(self, channel: ChannelResidual, abscissa: Column) -> None:
        """Explain marks, lines and bands."""
        kind = channel.fit.table.type
        sides = "; filled clockwise, open anticlockwise" if np.any(channel.side) else ""
        model = "line" if model_is_line(channel.fit, abscissa) else "+"
        effect = ""
        if self.step is not None:
            line = is_function(self.step, self.columns[self.x.value], channel.c)
            effect = f"; orange {'line' if line else '+'}: explained by {self.step.name}"
        self.legends["measurement"].set_text(f"●: measured; {model}: model{sides}")
        self.legends["residual"].set_text(f"grey band: ± noise floor{sides}{effect}")
        self.legends["failure"].set_text("orange: measured above the model; blue: below it")
        self.legends["waterfall"].set_text(f"bar: fit; ◆ {kind.rows} not used in the fit; grey: the noise floor")

    def leave_selected(self) -> None:
        """Open the dialog that excludes the selected rows."""
        if self.selected and self.fit is not None and self.leave_out is not None:
            self.leave_out([int(number) for number in self.fit.table.numbered(self.shown.rows[self.selected])])

    def show_place(self, place: Place) -> None:
        """Select the rows of a place where the model fails, on the output that fails there."""
        if self.fit is None:
            return
        axes = [axis_of(channel) for channel in self.fit.channels]
        if place.axis in axes:
            self.axis.set_value(axes.index(place.axis))
        rows = rows_at(self.fit, place)
        self.select(np.flatnonzero(np.isin(self.shown.rows, rows)).tolist())

    def _select_brushed(self, event: events.GenericEventArguments) -> None:
        self.select(event.args if isinstance(event.args, list) else [])

    def select(self, points: Sequence[int]) -> None:
        """Select points in all pictures; an empty list clears the selection."""
        if self.fit is None:
            return
        self.selected = sorted({int(point) for point in points})
        for plot in (self.plots[name] for name in LINKED_PICTURES):
            number = _dots(plot.figure)
            if number is None:
                continue
            plot.figure["data"][number]["selectedpoints"] = self.selected or None
            plot.run_plot_method("restyle", {"selectedpoints": [self.selected or None]}, [number])
            if not self.selected:
                plot.run_plot_method("relayout", {"selections": []})
        self._show_hint(self.shown)
        self.selects()

    def _show_hint(self, channel: ChannelResidual) -> None:
        """Show the selection, a remark on thinned points, or a hint."""
        self.clear.set_visibility(bool(self.selected))
        self.leave.set_visibility(bool(self.selected) and self.leave_out is not None)
        hint = f"Drag a box in a picture to select {channel.fit.table.type.rows} in all pictures."
        self.hint.set_text(channel.summary(self.selected) if self.selected else channel.thinned or hint)


def _dots(figure: dict[str, Any]) -> Any:
    """The index of the trace with selectable points, or None."""
    return next((k for k, trace in enumerate(figure["data"]) if "customdata" in trace), None)
