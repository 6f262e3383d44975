"""The four pictures of the page Model of a still record: Allan deviation, spectrum, where they fail, the fall."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nicegui import ui

from calibrations.pictures.still import levels
from rig.web.figures.averaging import allan, ratio
from rig.web.figures.spectrum import spectrum
from rig.web.figures.waterfall import Measure, waterfall
from rig.web.parts import box, div, words

if TYPE_CHECKING:
    from calibrations.still.channel_fit import ChannelFit
    from calibrations.still.compare import Comparison
    from calibrations.still.discover import Added
    from rig.analysis.trail_still import StillTrail

TITLES = {
    "allan": "Allan deviation beside the model",
    "spectrum": "Spectrum beside the model",
    "ratio": "Where it fails",
    "waterfall": "The falling error; ◆ on the other half of the record",
}
MEASURE = Measure("mismatch of the spectrum / chance", "chance", "the record", "the other half")


class NoisePictures:
    """Draws a noise model beside its record, one axis at a time."""

    def __init__(self) -> None:
        self.compared: Comparison | None = None
        self.trail: StillTrail | None = None
        self.step: Added | None = None
        with div("pictures"):
            with box("controls row-of"):
                self.axis = ui.toggle({0: "x"}, value=0, on_change=self.draw).props("dense no-caps")
                self.considered = ui.button(icon="close", on_click=lambda: self.consider(None)).props("flat dense")
                self.considered.set_visibility(False)
                words("Draw a box in a picture to zoom into it; a double click zooms out.", "told quiet small")
            self.plots: dict[str, ui.plotly] = {}
            for name, title in TITLES.items():
                with box("picture"):
                    words(title, "title")
                    plot = ui.plotly({"data": [], "layout": {}}).classes("plot")
                    self.plots[name] = plot.props(f'aria-label="{title}"')

    def show(self, compared: Comparison, trail: StillTrail) -> None:
        """A new fit."""
        self.compared, self.trail, self.step = compared, trail, None
        axes = dict(enumerate(compared.fit.still.axes))
        self.axis.set_options(axes, value=min(int(self.axis.value or 0), len(axes) - 1))
        self.considered.set_visibility(False)
        self.draw()

    def consider(self, step: Added | None) -> None:
        """Draw what the model would be with an effect; None takes it away."""
        self.step = step
        self.considered.set_visibility(step is not None)
        self.considered.set_text("" if step is None else f"with {step.name}")
        self.draw()

    def draw(self) -> None:
        """All pictures anew."""
        if self.compared is None or self.trail is None:
            return
        c, unit = int(self.axis.value or 0), self.compared.fit.still.unit
        found, curve = self.compared.fit.channels[c], self.compared.averaged[c]
        candidate: ChannelFit | None = None if self.step is None else self.step.after.channels[c]
        self.plots["allan"].update_figure(allan(found, curve, unit, candidate))
        self.plots["spectrum"].update_figure(spectrum(found, unit, candidate))
        self.plots["ratio"].update_figure(ratio(curve, found.channel.axis))
        self.plots["waterfall"].update_figure(waterfall(levels(self.trail.start, self.trail.steps), MEASURE))

    def next_axis(self) -> None:
        """The next channel."""
        if self.compared is not None:
            self.axis.set_value((int(self.axis.value or 0) + 1) % len(self.compared.fit.channels))

    def other_unit(self) -> None:
        """A still record has one unit."""

    def select(self, points: Sequence[int]) -> None:
        """Averaging times have no poses to be selected."""

    def leave_selected(self) -> None:
        """Nor left out."""
