"""Compare page: results of two runs or two sensors, and one model fitted to both, in tables and pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from nicegui import ui

from calibrations.fitting.fit import Fit
from calibrations.noise.comparison import compared_deviations
from calibrations.noise.fit import NoiseFit
from calibrations.presentation.chart import Chart
from calibrations.presentation.charts.noise import choose_scale, units
from calibrations.presentation.interactive import height_px
from calibrations.presentation.residual import ChannelResidual, choices, first_choices, residual_units
from calibrations.text import estimate_in_prefix, rounded
from rig.record import Record
from rig.services.charts import deviations, difference, differences, residuals
from rig.services.request import Request
from rig.services.search import Cancelled
from rig.services.two_runs import Pair, fit_both, match_poses, parameters_of, results_of
from rig.web.calculations import Visit
from rig.web.desk import Desk, models
from rig.web.frame import Key, frame
from rig.web.parts import afresh, box, button, div, show_error, show_remark, state, table, waiting, wide_table, words
from rig.web.pictures import AxisAndUnit, draw, plot_with_title

# Pictures of one axis: for two tables, or for two still records.

RESIDUALS, DIFFERENCE = "Residuals of both", "Difference second − first at common poses"
ALLAN = "Allan deviation of both, and the model fitted to each"


@dataclass(frozen=True)
class Comparison:
    """Axes, units and titles of the pictures; `draw` makes the charts of an axis in one of the units."""

    axes: Sequence[str]
    units: dict[bool, str]
    titles: Sequence[str]
    draw: Callable[[int, bool], Sequence[Chart]]


class Pictures(AxisAndUnit):
    """The pictures of one axis in one unit."""

    def __init__(self, comparison: Comparison) -> None:
        self.comparison = comparison
        with box("controls row-of"):
            self.axis = ui.select(dict(enumerate(comparison.axes)), label="axis", value=0, on_change=self.draw)
            self.axis.props("dense options-dense").style("min-width: 120px")
            self.unit = ui.toggle(comparison.units, value=next(iter(comparison.units)), on_change=self.draw).props(
                "dense no-caps"
            )
            self.unit.set_visibility(len(comparison.units) > 1)
            words("● first, ◇ second. Drag a box in a picture to zoom in; double-click to zoom out.",
                  "told quiet small")  # fmt: skip
        self.plots: list[ui.plotly] = []
        with div("two" if len(comparison.titles) > 1 else ""):
            for title in comparison.titles:
                with box("picture"):
                    self.plots.append(plot_with_title(title, classes="tall-plot"))
        self.draw()

    def draw(self) -> None:
        """Draw all pictures again."""
        charts = self.comparison.draw(int(self.axis.value or 0), bool(self.unit.value))
        for plot, chart in zip(self.plots, charts, strict=True):
            draw(plot, chart, f"{self.axis.value} {self.unit.value}")


def _fit_comparison(first: Fit, second: Fit) -> Comparison:
    """Residuals, and the difference of the measurements at common poses."""
    shared = match_poses(first, second)
    columns, second_choices = choices(first), choices(second)
    x, _ = first_choices([name for name in columns if name in second_choices], first.table)

    def draw(c: int, in_sensed: bool) -> Sequence[Chart]:
        first_channel, second_channel = ChannelResidual(first, c, in_sensed), ChannelResidual(second, c, in_sensed)
        charts = [residuals(first_channel, second_channel, columns[x], second_choices[x])]
        return charts if shared is None else [*charts, difference(first_channel, shared)]

    titles = [RESIDUALS] if shared is None else [RESIDUALS, DIFFERENCE]
    axes = [name for name in first.channels if name in second.channels]
    return Comparison(axes, residual_units(first), titles, draw)


def _noise_comparison(first: NoiseFit, second: NoiseFit) -> Comparison:
    """Allan deviations of both records."""
    axes = [axis for axis in first.still.axes if axis in second.still.axes]
    curves = [compared_deviations(fit) for fit in (first, second)]
    offered = units(first.still) if units(first.still) == units(second.still) else {False: first.still.unit}

    def draw(c: int, in_sensed: bool) -> Sequence[Chart]:
        axis = axes[c]
        units = (choose_scale(first.still, axis, in_sensed), choose_scale(second.still, axis, in_sensed))
        return [deviations([by_axis[axis] for by_axis in curves], units)]

    return Comparison(axes, offered, [ALLAN], draw)


PICTURES: dict[str, Callable[[Any, Any], Comparison]] = {
    "rows": _fit_comparison,
    "samples": _noise_comparison,
}  # by form of data


HEAD = ("", "first ●", "second ◇", "second − first", "in std uncertainties")


def register(desk: Desk) -> None:
    """The page at /compare."""

    @ui.page("/compare")
    def page(first: str = "", second: str = "", model: str = "") -> None:
        with frame(desk, "/record", f"Compare {first} and {second}" if first and second else "Compare") as keys:
            if not first or not second:
                with state("Two runs are needed", "Select them on the page Record, then Compare."):
                    button("Record", "list", lambda: ui.navigate.to("/record"))
                return
            _head(first, second, model)
            fitted = div("stack")
            with box("stack"):
                _results(first, second)

        visit = Visit()

        async def fit() -> None:
            with fitted, box("row-of"):
                waiting("Fitting one model to both")
                button("Cancel", "close", visit.cancel, "dense flat")
            notes: list[str] = []
            one, other = (Request(data, model or None, desk.bench_file) for data in (first, second))
            try:
                data, *fits = await visit.work(fit_both, one, other, notes.append)
            except Cancelled:
                with afresh(fitted), state("The comparison was cancelled"):
                    ui.button("Compare again", icon="refresh", on_click=ui.navigate.reload)
                return
            except Exception as error:
                with afresh(fitted):
                    show_error("Cannot fit one model to both", error)
                return
            with afresh(fitted):
                _parameters(fits[0].model.name, parameters_of(*fits))
                pictures = Pictures(PICTURES[data.form](*fits))
                for note in dict.fromkeys(notes):
                    show_remark(note)
            keys["x"] = Key("next axis", pictures.next_axis)
            keys["g"] = Key("switch between V and g", pictures.other_unit)

        ui.timer(0.0, fit, once=True)


def _head(first: str, second: str, model: str) -> None:
    """The two runs, the model, and a button that swaps the runs."""

    def to(first_data: str, second_data: str, model_name: str) -> None:
        query = {"first": first_data, "second": second_data, **({"model": model_name} if model_name else {})}
        ui.navigate.to(f"/compare?{urlencode(query)}")

    with box("row-of chosen"):
        with div("grow"):
            for mark, name, run in (("●", "first", first), ("◇", "second", second)):
                with div("row-of"):
                    words(f"{mark} {name}", f"k {name}")
                    ui.link(run, f"/record/{run.partition('/')[0]}").classes("title")
        ui.select(models(model), label="Model", value=model, on_change=lambda e: to(first, second, e.value)).props(
            "dense options-dense"
        )
        ui.button("Swap", icon="swap_vert", on_click=lambda: to(second, first, model)).props("dense outline")


def _results(first: str, second: str) -> None:
    """The results of the runs."""
    words("Results", "title")
    names = [data.partition("/") for data in (first, second)]
    try:
        with Record.to_find(names[0][0]) as record:
            first_run, second_run = (record.run(run) for run, _, _ in names)
        pairs = results_of(first_run, second_run, (names[0][2], names[1][2]))
    except Exception as error:
        show_error("Cannot compare the results", error)
        return
    if pairs:
        with wide_table():
            table(HEAD, [_row(pair) for pair in pairs])
    else:
        words("These runs have no results in common.", "quiet")


def _parameters(model: str, pairs: list[Pair]) -> None:
    """The parameters of the model, as a picture and in numbers."""
    chart = differences(pairs)
    title = f"Differences of the parameters of {model}"
    with div("two beside"):
        with box("picture"):
            plot = plot_with_title(
                title, "Second minus first, with ± two standard uncertainties; ◆ differs by more.", ""
            )
            draw(plot.style(f"height: {height_px(chart)}px; width: 100%"), chart, "differences", False)
        with box("stack"):
            words(f"Parameters of {model}", "title")
            with wide_table():
                table(HEAD, [_row(pair) for pair in pairs])


def _row(pair: Pair) -> tuple[str, ...]:
    times = "unknown" if pair.deviations is None else rounded(pair.deviations, 2)
    return (
        pair.name,
        estimate_in_prefix(pair.first, pair.first_std, pair.unit),
        estimate_in_prefix(pair.second, pair.second_std, pair.unit),
        estimate_in_prefix(pair.difference, pair.std, pair.unit),
        f"{times}{'  ← differs' if pair.differ else ''}",
    )
