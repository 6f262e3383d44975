"""What the page of a sensor's life says: how it stands, which calibration is closest to a day, and the tables."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

from nicegui import ui

from calibrations.evaluations.stability import YEAR_DAYS
from calibrations.numerals import measured, minus, plain
from rig.analysis.history import Calibration, History, Quantity, closest, stale
from rig.analysis.history_words import but_stale, chart_verdict, near, next_due, significance, summary
from rig.analysis.provenance import today
from rig.errors import RigError
from rig.web.figures.prefixed import spelt
from rig.web.pages.history_asked import Asked, day
from rig.web.pages.history_pictures import model_of
from rig.web.parts import Link, box, div, table, words
from rig.web.told import for_page

LIMIT_IS_GIVEN = "the greatest change, in its field above"
OUT = "out of control"


def standing(found: History, q: Quantity) -> None:
    """When the next calibration is due, what is out of control, and the numbers of the quantity that is shown."""
    out = [each.name for each in found.quantities if each.chart is not None and each.chart.verdict == OUT]
    overdue = found.due is not None and str(found.due) < today()
    good = found.due is not None and not out and not overdue
    with box(f"verdict {'bad' if out or overdue else 'good' if good else ''}").props("role=status aria-live=polite"):
        with div("grow standing"):
            with div("row-of"):
                words(for_page(next_due(found, LIMIT_IS_GIVEN)), "headline")
                if overdue:
                    words("overdue", "chip bad")
            words(for_page(f"{summary(found)}."), "quiet small")
            if out:
                words(f"{OUT.capitalize()}: {', '.join(out)}.", "small")
        with div("row-of numbers"):
            for what, value in (("drift a year", _drift(q)), ("control charts", chart_verdict(q) or "—")):
                with div("figure"):
                    words(value, "value")
                    words(f"{what}, {q.name}", "quiet small")


class Closest:
    """The calibration closest to a day, and whether it is stale then."""

    def __init__(self, wanted: Asked, changed: Callable[[], None]) -> None:
        self.model = wanted.model
        with box("stack"):
            words("Closest to a day", "title")
            self.input = ui.date_input("Day", value=str(wanted.at), on_change=changed).props("dense debounce=300")
            self.told = div("stack").props("role=status")

    @property
    def day(self) -> date | None:
        """None while it is being written."""
        try:
            return day(str(self.input.value))
        except RigError:
            return None

    def focus(self) -> None:
        """Write a day."""
        self.input.run_method("focus")

    def show(self, found: History) -> None:
        """By the limits as they are."""
        self.told.clear()
        if self.day is None:
            return
        calibration, age_days = closest(found.calibrations, self.day)
        why = stale(found, calibration, age_days)
        with self.told:
            words(near(calibration, age_days, self.day), "small")
            if why is not None:
                with box("note"):
                    words(for_page(but_stale(why)), "small")
            ui.link("Its model", model_of(calibration.data, self.model)).classes("small")


def quantities_table(found: History) -> None:
    """Every quantity: its last value, drift, scatter, charts, limits, due date."""
    head = ("quantity", "last", "drift a year", "scatter", "control charts", "allowed", "due")
    with box("stack wide-table"):
        words("All quantities", "title")
        table(head, [_row(q) for q in found.quantities])


def calibrations_table(found: History, model: str) -> None:
    """Every calibration: its run, which leads to its model, its rig, its values."""
    titles = [f"{q.name} ({spelt(q.unit)})" if q.unit != "1" else q.name for q in found.quantities]
    with box("stack wide-table"):
        words("All calibrations", "title")
        table(("date", "run", "rig", *titles, ""), [_calibration(each, found, model) for each in found.calibrations])


def _row(q: Quantity) -> tuple[str, ...]:
    unit = spelt(q.unit)
    allowed = "—" if q.allowed is None else minus(f"{q.allowed[0]:.6g} to {q.allowed[1]:.6g} {unit}")
    scatter = "—" if q.line is None else f"{plain(q.line.scatter, 2)} {unit}"
    last = f"{measured(q.last.value, q.last.std)} {unit}"
    return q.name, last, _drift(q), scatter, chart_verdict(q) or "—", allowed, str(q.due or "—")


def _drift(q: Quantity) -> str:
    if q.line is None:
        return "—"
    slope = measured(YEAR_DAYS * q.line.slope, YEAR_DAYS * q.line.slope_std)
    return f"{slope} {spelt(q.unit)}{significance(q.line)}"


def _calibration(each: Calibration, found: History, model: str) -> tuple[str | Link, ...]:
    values = (each.values.get(q.name) for q in found.quantities)
    shown = ("—" if value is None else measured(value.value, value.std) for value in values)
    return each.day, Link(each.data, model_of(each.data, model)), each.rig, *shown, each.expired or ""
