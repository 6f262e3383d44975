"""The pictures of the page Compare, of one axis at a time: of two tables, and of two still records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from nicegui import ui

from calibrations.fit import Fit
from calibrations.still.allan import averaged
from calibrations.still.fit import NoiseFit
from rig.analysis.both import again
from rig.web.figures.beside import deviations, difference, residuals
from rig.web.figures.rows import Shown, choices, first_choices, residual_units
from rig.web.figures.sensed import scaled, units
from rig.web.figures.style import Figure
from rig.web.parts import box, div, redraw, words

RESIDUALS, DIFFERENCE = "What the model leaves of both", "Second less first, at the poses that both have"
ALLAN = "Allan deviation of both, and the model fitted to each"


@dataclass(frozen=True)
class Both:
    """What there is to draw: axes, units, titles; `draw` makes the figures of an axis, as what is sensed or not."""

    axes: Sequence[str]
    units: dict[bool, str]
    titles: Sequence[str]
    draw: Callable[[int, bool], Sequence[Figure]]


class Pictures:
    """Draws one axis in one unit."""

    def __init__(self, both: Both) -> None:
        self.both = both
        with box("controls row-of"):
            self.axis = ui.select(dict(enumerate(both.axes)), label="axis", value=0, on_change=self.draw)
            self.axis.props("dense options-dense").style("min-width: 120px")
            self.unit = ui.toggle(both.units, value=next(iter(both.units)), on_change=self.draw).props("dense no-caps")
            self.unit.set_visibility(len(both.units) > 1)
            words("● first, ◇ second. Draw a box in a picture to zoom into it; a double click zooms out.",
                  "told quiet small")  # fmt: skip
        self.plots: list[ui.plotly] = []
        with div("two" if len(both.titles) > 1 else ""):
            for title in both.titles:
                with box("picture"):
                    words(title, "title")
                    plot = ui.plotly({"data": [], "layout": {}}).classes("tall-plot").props(f'aria-label="{title}"')
                    self.plots.append(plot)
        self.draw()

    def draw(self) -> None:
        """All of them anew."""
        figures = self.both.draw(int(self.axis.value or 0), bool(self.unit.value))
        for plot, figure in zip(self.plots, figures, strict=True):
            redraw(plot, figure)

    def next_axis(self) -> None:
        """The next channel."""
        self.axis.set_value((int(self.axis.value or 0) + 1) % len(self.both.axes))

    def other_unit(self) -> None:
        """V to g, or back."""
        if len(self.both.units) > 1:
            self.unit.set_value(not self.unit.value)


def of_both(found: tuple[Fit, Fit] | tuple[NoiseFit, NoiseFit]) -> Both:
    """Those that go with what was fitted."""
    first, second = found
    if isinstance(first, NoiseFit) and isinstance(second, NoiseFit):
        return _of_noise(first, second)
    if isinstance(first, Fit) and isinstance(second, Fit):
        return _of_rows(first, second)
    raise TypeError(found)


def _of_rows(first: Fit, second: Fit) -> Both:
    """Residuals, and where both have the same poses the difference of what was measured there."""
    shared = again(first, second)
    columns, there = choices(first), choices(second)
    x, _ = first_choices([name for name in columns if name in there])

    def draw(c: int, in_sensed: bool) -> Sequence[Figure]:
        one, other = Shown(first, c, in_sensed), Shown(second, c, in_sensed)
        made = [residuals(one, other, columns[x], there[x])]
        return made if shared is None else [*made, difference(one, shared)]

    titles = [RESIDUALS] if shared is None else [RESIDUALS, DIFFERENCE]
    axes = [name for name in first.channels if name in second.channels]
    return Both(axes, residual_units(first), titles, draw)


def _of_noise(first: NoiseFit, second: NoiseFit) -> Both:
    """How both average."""
    axes = [axis for axis in first.still.axes if axis in second.still.axes]
    there = [{each.channel.axis: each for each in found.channels} for found in (first, second)]
    offered = units(first.still) if units(first.still) == units(second.still) else {False: first.still.unit}

    def draw(c: int, in_sensed: bool) -> Sequence[Figure]:
        axis = axes[c]
        curves = [averaged(channels[axis], found.still.allan[axis]) for channels, found in zip(there, (first, second),
                                                                                             strict=True)]  # fmt: skip
        into = (scaled(first.still, axis, in_sensed), scaled(second.still, axis, in_sensed))
        return [deviations(curves[0], curves[1], into)]

    return Both(axes, offered, [ALLAN], draw)
