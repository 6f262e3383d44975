"""Two calibrations beside each other: of two days, with another sensor, of two rigs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from urllib.parse import urlencode

from nicegui import ui

from calibrations.numerals import minus, plain
from rig.analysis.history import Calibration, History
from rig.analysis.history_compared import Compared, compare_days, compare_rigs, compare_sensors
from rig.analysis.history_words import agreements
from rig.web.figures.prefixed import spelt
from rig.web.pages.history_asked import day
from rig.web.parts import box, div, failed, off_loop, table, words
from rig.web.told import message

DAYS, SENSOR, RIGS = "two days", "another sensor", "two rigs"
NOTHING = "There is one calibration, on one rig, and no other sensor in the record: nothing to compare with yet."
E_N = "U: expanded uncertainty of the difference (k = 2). They agree where E_n, the difference over U, is at most 1."


class Beside:
    """Asks what to compare with what; `last_of` is the last calibration of another sensor, `model` the one of all."""

    def __init__(
        self, life: History, sensors: Sequence[str], model: str, last_of: Callable[[str], Calibration]
    ) -> None:
        self.life, self.model, self.last_of = life, model, last_of
        self.two: list[ui.date_input] | list[ui.select] = []
        self.others = [sensor for sensor in sensors if sensor != life.sensor]
        self.rigs = list(dict.fromkeys(each.rig for each in life.calibrations))
        possible = {DAYS: len(life.calibrations) > 1, SENSOR: bool(self.others), RIGS: len(self.rigs) > 1}
        kinds = [kind for kind, can in possible.items() if can]
        with box("stack"):
            words("Compare", "title")
            if not kinds:
                words(NOTHING, "quiet small")
                return
            with div("row-of"):
                self.kind = ui.toggle(kinds, value=kinds[0], on_change=self._fields).props("dense no-caps")
                self.fields = div("row-of")
                ui.button("Compare", icon="compare_arrows", on_click=self.compare).props("dense outline")
            self.result = div("stack").props("role=status")
        self._fields()

    def _fields(self) -> None:
        """Those of what is chosen."""
        of = self.life.calibrations
        self.fields.clear()
        self.result.clear()
        with self.fields:
            if self.kind.value == DAYS:
                named = (("One day", of[0]), ("Another", of[-1]))
                self.two = [ui.date_input(name, value=each.day).props("dense") for name, each in named]
            elif self.kind.value == SENSOR:
                self.two = [_select("Sensor", self.others, 0)]
            else:
                self.two = [_select(name, self.rigs, k) for k, name in enumerate(("One rig", "Another"))]

    async def compare(self) -> None:
        """The difference of every quantity that both have."""
        said = [str(each.value) for each in self.two]
        try:
            found = await off_loop(self._compared, said)
        except Exception as error:
            self.result.clear()
            with self.result:
                failed("These cannot be compared", message(error))
            return
        self.result.clear()
        with self.result:
            _show(found, self.model)

    def _compared(self, said: Sequence[str]) -> Compared:
        if self.kind.value == SENSOR:
            return compare_sensors(self.life, said[0], self.last_of(said[0]))
        if self.kind.value == RIGS:
            return compare_rigs(self.life.calibrations, said[0], said[1])
        return compare_days(self.life, day(said[0]), day(said[1]))


def _show(found: Compared, model: str) -> None:
    """What the difference is, in numbers; two runs lead to one model fitted to both, in pictures."""
    apart = [name for name, (_, each) in found.rows.items() if not each.agrees]
    with div("row-of"):
        words("do not agree" if apart else "agree", f"chip {'bad' if apart else 'good'}")
        words(", ".join(apart) or "in every quantity", "small grow")
        if found.data is not None:
            first, second = found.data
            given = urlencode({"first": first, "second": second, "model": model})
            ui.link("One model fitted to both, in pictures", f"/compare?{given}").classes("small")
    head, rows = agreements(found, plain)
    table(head, [(*row[:5], spelt(row[5]), minus(row[6]), row[7]) for row in rows])
    words(E_N, "quiet small")


def _select(name: str, of: Sequence[str], first: int) -> ui.select:
    return ui.select(list(of), label=name, value=of[first]).props("dense options-dense").style("min-width: 130px")
