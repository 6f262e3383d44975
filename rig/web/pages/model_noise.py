"""The pictures of the model page for a still record: Allan deviation, spectrum, ratio, error by model, record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nicegui import ui

from calibrations.noise.comparison import compared_deviations
from calibrations.presentation.chart import single_chart
from calibrations.presentation.charts.noise import (
    ModelCurve,
    allan,
    candidate,
    choose_scale,
    ratio,
    record,
    spectrum,
    steps_chart,
    units,
)
from rig.web.parts import box, div, words
from rig.web.pictures import AxisAndUnit, draw, plot_with_title

if TYPE_CHECKING:
    from calibrations.discovery.findings import Place, Step
    from calibrations.discovery.results import Comparison
    from calibrations.noise.fit import NoiseFit
    from rig.services.session import ModelSession

TITLES = {
    "allan": "Allan deviation and model",
    "spectrum": "Spectrum and model",
    "ratio": "Residual pattern",
    "waterfall": "Mismatch by model",
    "record": "The record",
}
LEGENDS = {
    "allan": "●: measured, with 95 % interval; line: model",
    "spectrum": "●: measured; grey band: 95 % of them by the model",
    "ratio": "the model fails where the interval does not contain 1",
    "waterfall": "bar: fit; ◆ the half of the record not used in the fit; grey: chance alone",
    "record": "",
}


class NoisePictures(AxisAndUnit):
    """Pictures of a noise model and its record, one axis at a time."""

    def __init__(self) -> None:
        self.compared: Comparison[NoiseFit] | None = None
        self.session: ModelSession[NoiseFit] | None = None
        self.step: Step[NoiseFit] | None = None
        with div("pictures"):
            with box("controls row-of"):
                self.axis = ui.toggle({0: "x"}, value=0, on_change=self.draw).props("dense no-caps")
                self.unit = ui.toggle({False: "V"}, value=False, on_change=self.draw).props("dense no-caps")
                self.considered = ui.button(icon="close", on_click=lambda: self.consider(None)).props("flat dense")
                self.considered.set_visibility(False)
                words("Drag a box in a picture to zoom in; double-click to zoom out.", "told quiet small")
            self.plots: dict[str, ui.plotly] = {}
            for name, title in TITLES.items():
                with box("picture wide" if name == "record" else "picture"):
                    self.plots[name] = plot_with_title(title, LEGENDS[name])

    def show(self, compared: Comparison[NoiseFit], session: ModelSession[NoiseFit]) -> None:
        """Show a new fit."""
        self.compared, self.session, self.step = compared, session, None
        axes = dict(enumerate(compared.fit.still.axes))
        self.axis.set_options(axes, value=min(int(self.axis.value or 0), len(axes) - 1))
        offered = units(compared.fit.still)
        self.unit.set_options(offered, value=bool(self.unit.value) and True in offered)
        self.unit.set_visibility(len(offered) > 1)
        self.considered.set_visibility(False)
        self.draw()

    def consider(self, step: Step[NoiseFit] | None, look: bool = False) -> None:  # noqa: ARG002 one axis
        """Also draw the model with one more effect; None removes it."""
        self.step = step
        self.considered.set_visibility(step is not None)
        self.considered.set_text("" if step is None else f"with {step.name}")
        self.draw()

    def draw(self) -> None:
        """Draw all pictures again."""
        if self.compared is None or self.session is None:
            return
        c, still = int(self.axis.value or 0), self.compared.fit.still
        channel = self.compared.fit.channels[c]
        curve = compared_deviations(self.compared.fit)[channel.channel.axis]
        units = choose_scale(still, channel.channel.axis, bool(self.unit.value))
        models = [ModelCurve(channel, "model")]
        if self.step is not None:
            models.append(candidate(self.step.after.channels[c], self.step.name))
        panels = {
            "allan": allan(curve, units, models),
            "spectrum": spectrum(channel, units, models),
            "ratio": ratio(curve),
            "record": record(channel.channel, units),
        }
        for name, panel in panels.items():
            draw(self.plots[name], single_chart(panel), f"{name} {channel.channel.axis} {units.unit}")
        draw(self.plots["waterfall"], steps_chart(self.session.start, self.session.steps), "waterfall", False)

    def show_place(self, place: Place) -> None:
        """Show the output that fails there."""
        if self.compared is not None:
            axes = list(self.compared.fit.still.axes)
            if place.axis in axes:
                self.axis.set_value(axes.index(place.axis))

    def select(self, points: Sequence[int]) -> None:
        """No effect: averaging times are not poses."""

    def leave_selected(self) -> None:
        """No effect: averaging times cannot be excluded."""
