"""Parts of the history page: the request in its address, comparisons, pictures, tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from urllib.parse import urlencode

from nicegui import events, ui
from starlette.datastructures import QueryParams

from calibrations.analyses.stability import YEAR_DAYS
from calibrations.criteria import BASELINE_RUNS, FEWEST_RUNS
from calibrations.presentation.chart import Chart, Panel, single_chart
from calibrations.presentation.charts.history import CONTROL_LEGENDS, control_panels, life
from calibrations.text import estimate_in_prefix, estimate_text, minus, rounded, unit
from rig.errors import RigError
from rig.services.charts import life_of
from rig.services.control import OUT
from rig.services.history import Calibration, History, Quantity, changes, closest, stale
from rig.services.history_comparison import CalibrationComparison, compare_days, compare_rigs, compare_sensors
from rig.services.history_words import (
    agreements,
    but_stale,
    chart_verdict,
    closest_text,
    next_due,
    significance,
    summary,
)
from rig.services.provenance import today
from rig.web.address import ModelState
from rig.web.calculations import off_loop
from rig.web.parts import Link, box, button, div, for_page, shown, table, words
from rig.web.pictures import draw, plot_with_title

MODEL = "linear"


@dataclass(frozen=True)
class HistoryRequest:
    """The request in an address, with the options of `rig history`.

    `sensor` "" means none, `quantity` "" the first one; `limits` are the largest changes; `at` is a day.
    """

    sensor: str = ""
    model: str = MODEL
    quantity: str = ""
    limits: Mapping[str, float] = field(default_factory=dict)
    baseline: int = BASELINE_RUNS
    at: date = field(default_factory=lambda: date.fromisoformat(today()))

    @property
    def address(self) -> str:
        """The address, without default values."""
        options = {
            "sensor": self.sensor,
            "model": self.model if self.model != MODEL else "",
            "quantity": self.quantity,
            "limit": [f"{name}={change:g}" for name, change in self.limits.items()],
            "baseline": str(self.baseline) if self.baseline != BASELINE_RUNS else "",
            "at": str(self.at) if str(self.at) != today() else "",
        }
        query = urlencode({name: value for name, value in options.items() if value}, doseq=True)
        return f"/history?{query}" if query else "/history"


def parse_request(query: QueryParams) -> HistoryRequest:
    """The request of an address. Raises RigError."""
    return HistoryRequest(
        query.get("sensor", ""),
        query.get("model", "") or MODEL,
        query.get("quantity", ""),
        changes(query.getlist("limit")),
        _baseline(query.get("baseline", str(BASELINE_RUNS))),
        day(query.get("at", today())),
    )


def day(text: str) -> date:
    """The date of a text. Raises RigError."""
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise RigError(f"{text!r} is not a date: write it like {today()}") from None


def _baseline(text: str) -> int:
    if not text.isdecimal() or int(text) < FEWEST_RUNS:
        raise RigError(f"baseline={text}: give the number of calibrations for the limits, at least {FEWEST_RUNS}")
    return int(text)


# Comparison of two calibrations: of two days, with another sensor, of two rigs.

DAYS, SENSOR, RIGS = "two days", "another sensor", "two rigs"
NOTHING = "The record has one calibration on one rig and no other sensor, so there is nothing to compare yet."
E_N = "U: expanded uncertainty of the difference (k = 2). They agree if E_n, the difference divided by U, is at most 1."


class CompareBox:
    """Selects and compares two calibrations; `last_of` gives the last calibration of another sensor."""

    def __init__(
        self, life: History, sensors: Sequence[str], model: str, last_of: Callable[[str], Calibration]
    ) -> None:
        self.life, self.model, self.last_of = life, model, last_of
        self.two: list[ui.date_input] | list[ui.select] = []
        self.others = [sensor for sensor in sensors if sensor != life.sensor]
        self.rigs = list(dict.fromkeys(calibration.rig for calibration in life.calibrations))
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
                button("Compare", "compare_arrows", self.compare)
            self.result = div("stack").props("role=status")
        self._fields()

    def _fields(self) -> None:
        """Show the fields of the selected kind of comparison."""
        calibrations = self.life.calibrations
        self.fields.clear()
        self.result.clear()
        with self.fields:
            if self.kind.value == DAYS:
                choices = (("One day", calibrations[0]), ("Another", calibrations[-1]))
                self.two = [ui.date_input(name, value=calibration.day).props("dense") for name, calibration in choices]
            elif self.kind.value == SENSOR:
                self.two = [_select("Sensor", self.others, 0)]
            else:
                self.two = [_select(name, self.rigs, k) for k, name in enumerate(("One rig", "Another"))]

    async def compare(self) -> None:
        """Compare the shared quantities."""
        work = off_loop(self._compare, [str(field.value) for field in self.two])
        compared = await shown(self.result, "Comparing", "Cannot compare these calibrations", work)
        if compared is not None:
            with self.result:
                _show(compared, self.model)

    def _compare(self, days: Sequence[str]) -> CalibrationComparison:
        if self.kind.value == SENSOR:
            return compare_sensors(self.life, days[0], self.last_of(days[0]))
        if self.kind.value == RIGS:
            return compare_rigs(self.life.calibrations, days[0], days[1])
        return compare_days(self.life, day(days[0]), day(days[1]))


def _show(compared: CalibrationComparison, model: str) -> None:
    """Show a comparison in numbers; two runs have a link to the compare page."""
    differing = [name for name, (_, agreement) in compared.rows.items() if not agreement.agrees]
    with div("row-of"):
        words("do not agree" if differing else "agree", f"chip {'bad' if differing else 'good'}")
        words(", ".join(differing) or "in every quantity", "small grow")
        if compared.data is not None:
            first, second = compared.data
            query = urlencode({"first": first, "second": second, "model": model})
            ui.link("One model fitted to both, in pictures", f"/compare?{query}").classes("small")
    head, rows = agreements(compared, rounded)
    table(head, [(*row[:5], unit(row[5]), minus(row[6]), row[7]) for row in rows])
    words(E_N, "quiet small")


def _select(name: str, options: Sequence[str], first: int) -> ui.select:
    choice = ui.select(list(options), label=name, value=options[first])
    return choice.props("dense options-dense").style("min-width: 130px")


# Pictures: one quantity over time, and its control charts. A click on a point opens its run.

LIFE = "Calibrations over time"
CLICK_HANDLER = "(e) => { const k = e && e.points && e.points[0].customdata; if (k) emit(k) }"
FEW = "A control chart needs two calibrations, a drift three: measure this sensor again."


class HistoryPictures:
    """Pictures of one quantity. A point links to the page of its run with `model`."""

    def __init__(self, model: str) -> None:
        self.model = model
        with div("pictures three"):
            with box("picture wide"):
                self.life = self._plot(LIFE)
                self.text_box = words("", "quiet small")
            self.few = box("wide state")
            with self.few:
                words(FEW, "quiet")
            self.boxes = []
            self.charts: dict[str, ui.plotly] = {}
            for title, legend in CONTROL_LEGENDS.items():
                with box("picture") as place:
                    self.charts[title] = self._plot(title, legend)
                self.boxes.append(place)

    def show(self, q: Quantity) -> None:
        """Draw all pictures again."""
        draw(self.life, without_title(life(life_of(q))), f"life {q.name}")
        self.text_box.set_text(_legend(q))
        self.few.set_visibility(q.chart is None)
        for place in self.boxes:
            place.set_visibility(q.chart is not None)
        if q.chart is not None:
            days, keys = (
                [calibration.day for calibration in q.calibrations],
                [calibration.data for calibration in q.calibrations],
            )
            for title, panel in control_panels(q.name, q.chart, q.unit, days, keys).items():
                draw(self.charts[title], without_title(panel), f"{title} {q.name}")

    def _plot(self, title: str, legend: str = "") -> ui.plotly:
        return plot_with_title(title, legend).on("plotly_click", self._open_clicked, js_handler=CLICK_HANDLER)

    def _open_clicked(self, event: events.GenericEventArguments) -> None:
        ui.navigate.to(ModelState(str(event.args), self.model).address)


def without_title(panel: Panel) -> Chart:
    """The panel without its title, which the page shows above the picture."""
    return single_chart(replace(panel, title="", remark=""))


def _legend(q: Quantity) -> str:
    """The legend of the symbols in the picture."""
    signs = ["● a calibration, ± two standard uncertainties"]
    if q.chart is not None and q.chart.signals:
        signs.append("◆ outside the limits of a control chart")
    if q.line is not None:
        signs.append("line and band: drift, with 95 % interval of the value")
    if q.allowed is not None:
        signs.append("broken lines: limits")
    return " ".join(filter(None, [f"{'; '.join(signs)}.", q.no_drift, "Click on a point to open its model."]))


# Summary, the calibration closest to a day, and the tables.

LIMIT_IS_GIVEN = "the largest change, in the field above"


def summary_of(history: History, q: Quantity) -> None:
    """The date of the next calibration, quantities out of control, and numbers of the shown quantity."""
    out_of_control = [
        quantity.name for quantity in history.quantities if quantity.chart is not None and quantity.chart.verdict == OUT
    ]
    overdue = history.due is not None and str(history.due) < today()
    is_good = history.due is not None and not out_of_control and not overdue
    with box(f"verdict {'bad' if out_of_control or overdue else 'good' if is_good else ''}").props(
        "role=status aria-live=polite"
    ):
        with div("grow standing"):
            with div("row-of"):
                words(for_page(next_due(history, LIMIT_IS_GIVEN)), "headline")
                if overdue:
                    words("overdue", "chip bad")
            words(for_page(f"{summary(history)}."), "quiet small")
            for warning in history.warnings:
                words(for_page(warning), "fault")
            if out_of_control:
                words(f"{OUT.capitalize()}: {', '.join(out_of_control)}.", "small")
        with div("row-of numbers"):
            for title, value in (("drift a year", _drift(q)), ("control charts", chart_verdict(q) or "—")):
                with div("figure"):
                    words(value, "value")
                    words(f"{title}, {q.name}", "quiet small")


class ClosestBox:
    """The calibration closest to a day, with a warning if it is stale."""

    def __init__(self, request: HistoryRequest, on_change: Callable[[], None]) -> None:
        self.model = request.model
        with box("stack"):
            words("Closest to a day", "title")
            self.input = ui.date_input("Day", value=str(request.at), on_change=on_change).props("dense debounce=300")
            self.text_box = div("stack").props("role=status")

    @property
    def day(self) -> date | None:
        """The date in the field; None while it is incomplete."""
        try:
            return day(str(self.input.value))
        except RigError:
            return None

    def focus(self) -> None:
        """Move the focus to the field."""
        self.input.run_method("focus")

    def show(self, history: History) -> None:
        """Show the closest calibration with the present limits."""
        self.text_box.clear()
        if self.day is None:
            return
        calibration, age_days = closest(history.calibrations, self.day)
        staleness = stale(history, calibration, age_days)
        with self.text_box:
            words(closest_text(calibration, age_days, self.day), "small")
            if staleness is not None:
                with box("note"):
                    words(for_page(but_stale(staleness)), "small")
            ui.link("Open its model", ModelState(calibration.data, self.model).address).classes("small")


def quantities_table(history: History) -> None:
    """Table of quantities: last value, drift, scatter, control charts, limits, due date."""
    head = ("quantity", "last", "drift a year", "scatter", "control charts", "allowed", "due")
    with box("stack wide-table"):
        words("All quantities", "title")
        table(head, [_row(q) for q in history.quantities])


def calibrations_table(history: History, model: str) -> None:
    """Table of calibrations: run with a link to its model, rig, values."""
    titles = [f"{q.name} ({unit(q.unit)})" if q.unit != "1" else q.name for q in history.quantities]
    with box("stack wide-table"):
        words("All calibrations", "title")
        table(
            ("date", "run", "rig", *titles, ""),
            [_calibration(calibration, history, model) for calibration in history.calibrations],
        )


def _row(q: Quantity) -> tuple[str, ...]:
    spelt = unit(q.unit)
    limits_text = "—" if q.allowed is None else minus(f"{q.allowed[0]:.6g} to {q.allowed[1]:.6g} {spelt}")
    scatter = "—" if q.line is None else f"{rounded(q.line.scatter, 2)} {spelt}"
    last = estimate_in_prefix(q.last.value, q.last.std, q.unit)
    return q.name, last, _drift(q), scatter, chart_verdict(q) or "—", limits_text, str(q.due or "—")


def _drift(q: Quantity) -> str:
    if q.line is None:
        return "—"
    slope = estimate_in_prefix(YEAR_DAYS * q.line.slope, YEAR_DAYS * q.line.slope_std, q.unit)
    return f"{slope}{significance(q.line)}"


def _calibration(calibration: Calibration, history: History, model: str) -> tuple[str | Link, ...]:
    values = (calibration.values.get(q.name) for q in history.quantities)
    value_texts = ("—" if value is None else estimate_text(value.value, value.std) for value in values)
    return (
        calibration.day,
        Link(calibration.data, ModelState(calibration.data, model).address),
        calibration.rig,
        *value_texts,
        calibration.expired or "",
    )
