"""Control charts of the check standards on the history page: is the rig in control?"""

from __future__ import annotations

from functools import partial

from nicegui import events, ui

from calibrations.presentation.chart import Panel
from calibrations.presentation.charts.history import CONTROL_LEGENDS, control_panels
from rig.errors import RecordError
from rig.record import Run
from rig.services.control import HEAD, OUT, PROCEDURE, make_charts, row, signals, worst
from rig.services.history import run_date
from rig.web.pages.history_results import CLICK_HANDLER, without_title
from rig.web.parts import box, button, div, for_page, show_error, table, wide_table, words
from rig.web.pictures import draw, plot_with_title

LOOKS = {OUT: "bad", "in control": "good", "baseline": "plain"}


class CheckStandards:
    """The verdict, the table of all charts, and the charts of one quantity; a click on a point opens its run."""

    def __init__(self, runs: list[Run]) -> None:
        if not any(run.procedure == PROCEDURE for run in runs):
            return
        with box("stack"):
            with div("row-of"):
                words("Check standards", "title")
                verdict = words("", "chip")
                div("grow")
                measure = partial(ui.navigate.to, f"/run?procedure={PROCEDURE}")
                button("Measure the check standard", "play_arrow", measure)
            try:
                self.standards = make_charts(runs)
            except RecordError as error:  # one run so far
                verdict.set_visibility(False)
                show_error("There is no chart yet", error)
                return
            verdict.set_text(worst(self.standards))
            verdict.classes(LOOKS[worst(self.standards)])
            self.days = {run.run: run_date(run).date().isoformat() for run in runs}
            with wide_table():
                table(HEAD, [tuple(map(for_page, row(standard))) for standard in self.standards])
            for line in (line for standard in self.standards for line in signals(standard)):
                words(for_page(line), "small")
            names = {k: f"{standard.sensor}: {standard.quantity}" for k, standard in enumerate(self.standards)}
            self.chosen = ui.select(names, value=0, label="Chart of", on_change=self.draw).props("dense options-dense")
            self.chosen.style("min-width: 240px")
            self.plots: dict[str, ui.plotly] = {}
            with div("pictures three"):
                for title in self._panels():
                    with div("picture"):
                        plot = plot_with_title(title, CONTROL_LEGENDS[title], "live-plot", f"Check standard: {title}")
                        self.plots[title] = plot.on("plotly_click", _open_clicked_run, js_handler=CLICK_HANDLER)
        self.draw()

    def draw(self) -> None:
        """Draw the charts of the chosen quantity."""
        for title, panel in self._panels().items():
            draw(self.plots[title], without_title(panel), f"{title} {self.chosen.value}")

    def _panels(self) -> dict[str, Panel]:
        standard = self.standards[int(self.chosen.value or 0)]
        days = [self.days[run] for run in standard.runs]
        return control_panels(standard.quantity, standard.chart, standard.unit, days, list(standard.runs))


def _open_clicked_run(event: events.GenericEventArguments) -> None:
    ui.navigate.to(f"/record/{event.args}")
