"""What a run has measured so far, over time: a picture that grows with the run, and does not grow for ever."""

from __future__ import annotations

from typing import Any

from nicegui import ui

from rig.analysis.course import Course, kind_of
from rig.record import Record
from rig.web.figures.series import series
from rig.web.parts import div, off_loop


class OverTime:
    """Follows a run in the record; thinned, so that a night is no larger than an hour."""

    def __init__(self) -> None:
        self.run, self.last = "", -1
        self.courses: dict[str, Course] = {}
        self.chosen = False  # a person has said of which kind
        with div("row-of"):
            self.kind = ui.select([], label="of", on_change=self.draw).props("dense options-dense")
            self.name = ui.select([], label="over time", on_change=self.draw).props("dense options-dense")
        self.kind.on("update:model-value", self._choose)
        for select in (self.kind, self.name):
            select.style("min-width: 150px").set_visibility(False)
        self.place = div("")
        self.plot: ui.plotly | None = None

    async def follow(self, run: str) -> None:
        """Take in what is new of `run`."""
        if run != self.run:
            self.run, self.last, self.courses, self.plot, self.chosen = run, -1, {}, None, False
            self.place.clear()
            self.kind.set_visibility(False)
            self.name.set_visibility(False)
        if not run:
            return
        new = await off_loop(_new, run, self.last)
        if not new or run != self.run:
            return
        for number, dwell in new:
            self.courses.setdefault(kind_of(dwell), Course()).add(dwell)
            self.last = number
        self._offer()
        self.draw()

    def _choose(self) -> None:
        self.chosen = True

    def _offer(self) -> None:
        """The kinds of poses and the quantities that there are; those with most until a person chooses."""
        kinds = {kind: kind or "poses" for kind in self.courses}
        most = max(self.courses, key=lambda kind: len(self.courses[kind].parts))
        value = self.kind.value if self.chosen and self.kind.value in kinds else most
        if (list(kinds), value) != (list(self.kind.options), self.kind.value):
            self.kind.set_options(kinds, value=value)
        names = self.courses[str(self.kind.value or "")].names
        if names != list(self.name.options):
            self.name.set_options(names, value=self.name.value if self.name.value in names else names[0])
        self.kind.set_visibility(len(kinds) > 1)
        self.name.set_visibility(True)

    def draw(self) -> None:
        """The picture anew."""
        course = self.courses.get(str(self.kind.value or ""))
        if course is None or self.name.value not in course.names:
            return
        self.lay_out().update_figure(series(course, str(self.name.value)))

    def lay_out(self) -> ui.plotly:
        """The picture's place, where it was not made yet: the browser can fetch what draws it meanwhile."""
        if self.plot is None:
            with self.place:
                self.plot = ui.plotly({"data": [], "layout": {}}).classes("live-plot")
                self.plot.props('aria-label="the run over time"')
        return self.plot


def _new(run: str, after: int) -> list[tuple[int, Any]]:
    with Record.to_read() as record:
        return record.dwells(run, after)
