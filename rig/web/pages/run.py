"""Run page: the bench, a procedure with its plan, and the run in progress."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from fastapi import Request
from nicegui import ui

from calibrations.text import capital, duration
from drivers.errors import NotWired
from procedures.catalogue import Procedure, find, paths, summary
from procedures.errors import NoInstrument, SettingError
from procedures.settings import choices, meaning, parse, setting_label, setting_text
from rig.bench import Bench, read_bench
from rig.bench.certificates import find_expired
from rig.bench.file import DEMO
from rig.drawings import strip
from rig.errors import RigError
from rig.instruments.instruments import check_all
from rig.planning.plan import Plan, plan, stretches
from rig.planning.preparation import mounting
from rig.runs.background import control
from rig.web.calculations import Visit, off_loop
from rig.web.desk import Desk, lab_read
from rig.web.frame import Key, frame
from rig.web.pages.run_begin import BeginDialog, before_start, plan_facts
from rig.web.pages.run_live import Live
from rig.web.pages.run_optimal import OptimalDialog
from rig.web.parts import box, button, div, facts, message, show_error, shown, table, with_labels, words

MOST_STRETCHES = 12
DEFAULT_PROCEDURE = "sweep"
OTHER_BENCH = "Another bench in the list Measure on may have it."


def register(desk: Desk) -> None:
    """The page at /run; a procedure and its settings may be part of the address."""

    @ui.page("/run")
    def page(request: Request) -> None:
        with frame(desk, "/run") as keys:
            bench_file = desk.bench_file
            try:
                bench = read_bench(bench_file)
            except Exception as error:
                show_error("The bench file cannot be used", error)
                if len(desk.benches) > 1:
                    BenchChoice(desk, lambda: f"/run?{request.query_params}")
                return
            with div("run-page"):
                with div("stack"):
                    planning = PlanForm(bench_file, bench, dict(request.query_params), len(desk.benches) > 1)
                    Instruments(desk, bench, lambda: planning.address)
                with div("stack"):
                    live = Live(planning.allow)
                    planning.lay_out_plan()
            planning.started = live.look
            keys["p"] = Key("pause the run", live.pause_run)


class BenchChoice:
    """The choice of the bench for all pages, among those that `rig web` was started with.

    `address` gives the page Run with the present procedure and settings, which the other bench may have as well.
    """

    def __init__(self, desk: Desk, address: Callable[[], str]) -> None:
        self.desk, self.address = desk, address
        names = {k: _bench_name(path) for k, path in enumerate(desk.benches)}
        self.choice = ui.select(names, label="Measure on", value=self._present, on_change=self.choose)
        self.choice.props("dense options-dense").style("width: 100%")

    @property
    def _present(self) -> int:
        return self.desk.benches.index(self.desk.bench_file)

    def choose(self) -> None:
        """Open the page Run with another bench, unless a run is in progress."""
        if self.choice.value == self._present:
            return
        try:
            self.desk.choose_bench(self.desk.benches[int(self.choice.value)])
        except RigError as error:
            ui.notify(message(error), type="warning")
            self.choice.set_value(self._present)
            return
        ui.navigate.to(self.address())


def _bench_name(path: Path | None) -> str:
    """The name in a bench file, and the file; a file that cannot be read has no name."""
    try:
        name = read_bench(path).name
    except RigError:
        name = "cannot be read"
    return name if path in (None, DEMO) else f"{name} ({path})"


class Instruments:
    """The instruments of the bench, and a button that checks them."""

    def __init__(self, desk: Desk, bench: Bench, address: Callable[[], str]) -> None:
        self.bench = bench
        with box("stack bench"):
            words("Bench", "title")
            if len(desk.benches) > 1:
                BenchChoice(desk, address)
            else:
                words(bench.name, "quiet small")
            for fault in find_expired(bench, datetime.now(UTC).date()):
                words(f"{fault}; have it calibrated again", "fault")
            self.rows = div("")
            with self.rows:
                table(
                    ("role", "instrument", "at"),
                    [(r, i.driver, _url_text(i.url)) for r, i in bench.instruments.items()],
                )
            self.button = button("Check the instruments", "fact_check", self.check)

    async def check(self) -> None:
        """Identify and self-test every instrument."""
        self.button.disable()
        work = off_loop(check_all, self.bench)
        results = await shown(self.rows, "Connecting; nothing moves", "The bench cannot be checked", work)
        self.button.enable()
        rows = [
            (role, f"{'✓' if test.ok else '✗ FAILED'} {test.name}", test.detail)
            for role, (_, tests) in (results or {}).items()
            for test in tests
        ]
        if results is not None:
            with self.rows:
                table(("role", "check", "detail"), rows)


def _url_text(url: str) -> str:
    return "simulated" if url.startswith("simulated") else url


class PlanForm:
    """The form of a procedure and its settings; every change makes a new plan.

    `settings`: those of the address, with the procedure. `can_change_bench`: the page offers other benches.
    """

    def __init__(
        self, bench_file: Path | None, bench: Bench, settings: Mapping[str, str], can_change_bench: bool = False
    ) -> None:
        self.bench_file, self.bench, self.can_change_bench = bench_file, bench, can_change_bench
        self.given = {name: value for name, value in settings.items() if name != "procedure"}
        self.started: Callable[[], Awaitable[None]] | None = None
        self.turn, self.address, self.visit = 0, f"/run?{urlencode(settings)}", Visit()
        self.inputs: dict[str, Any] = {}
        self.planned: Plan | None = None
        self.under_way = False  # a run is in progress
        names = {name: f"{name}: {summary(path)}" for name, path in paths(bench.folders.procedures).items()}
        self.asked = settings.get("procedure", DEFAULT_PROCEDURE).replace("_", "-")
        with box():
            words("Measure", "title")
            self.name = ui.select(names, label="Procedure", value=self.asked if self.asked in names else None)
            self.name.props("dense options-dense").on_value_change(self._show_settings).style("width: 100%")
            self.about = words("", "quiet small")
            self.fields = div("settings")
            with ui.expansion("What the settings mean").props("dense") as self.meant:
                self.meaning = div("")
            self.attended = ui.switch("Ask me, even if the simulated rig can answer", value=not bench.simulated)
            self.attended.set_visibility(bench.simulated)
            with div("row-of"):
                self.button = ui.button("Start", icon="play_arrow", on_click=self.start)
                self.button.disable()  # until there is a plan
                self.optimal = ui.button("Choose poses for a model", icon="auto_fix_high", on_click=self._optimal)
                self.optimal.props("outline")
                self.waits = words("", "quiet small").props("role=status")

    def lay_out_plan(self) -> None:
        """Place the box of the plan on the page."""
        with box():
            words("Plan", "title")
            self.plan = div("stack")
        if self.name.value is not None:
            self._show_settings()
            return
        self.meant.set_visibility(False)
        self.optimal.set_visibility(False)
        with self.plan:
            unknown = f"There is no procedure {self.asked!r} on this bench; choose one from the list Procedure."
            show_error("This procedure is not known", unknown)

    @property
    def procedure(self) -> Procedure:
        """The selected procedure."""
        return find(str(self.name.value), self.bench.folders.procedures)

    def _show_settings(self) -> None:
        """Show the settings of the selected procedure."""
        procedure = self.procedure
        about = procedure.doc.partition("\n\n")[2].split("Source")[0]
        self.about.set_text(" ".join([f"{capital(procedure.summary)}.", *about.split()]))  # the list may cut its end
        self.meaning.clear()
        with self.meaning:
            facts({setting_label(name): meaning(procedure, name) for name in procedure.defaults})
        self.meant.set_visibility(bool(procedure.defaults))
        self.optimal.set_visibility(procedure.name == "sweep")
        self.fields.clear()
        choices_by_name = choices(procedure)
        self.inputs = {}
        with self.fields:
            for name, default in procedure.defaults.items():
                field = _field(name, self.given.get(name, setting_text(default)), choices_by_name.get(name, ()))
                self.inputs[name] = field.on_value_change(self.replan)
        ui.timer(0.0, self.replan, once=True)

    def _optimal(self) -> None:
        """Ask for a model; poses that are chosen for it replace the grid."""
        grid = {name: text for name, text in self.settings().items() if name != "pose_list"}
        OptimalDialog(self.bench, self.procedure, grid, self._fill_settings)

    def _fill_settings(self, settings: Mapping[str, str]) -> None:
        for name, text in settings.items():
            self.inputs[name].set_value(text)

    def settings(self) -> dict[str, str]:
        """The settings that differ from their defaults, as texts."""
        defaults = self.procedure.defaults
        texts = {name: str(field.value or "").strip() for name, field in self.inputs.items()}
        return {name: text for name, text in texts.items() if text != setting_text(defaults[name])}

    def _tell_address(self) -> None:
        """Write procedure and settings into the address, so that they survive a reload and can be passed on."""
        query = {"procedure": self.procedure.name, **self.settings()}
        address = "/run" if query == {"procedure": DEFAULT_PROCEDURE} else f"/run?{urlencode(query)}"
        if address != self.address:
            self.address = address
            ui.navigate.history.replace(address)

    async def replan(self) -> None:
        """Plan the run with the present settings."""
        self.turn += 1
        turn, self.planned = self.turn, None
        self.button.disable()
        self._tell_address()
        self.visit.cancel()  # a plan of other settings, which can take minutes
        work = self.visit.work(self._plan, self.procedure, self.settings())
        title = "This procedure cannot run"
        planned = await shown(self.plan, "Planning; nothing moves", title, work, lambda: turn == self.turn)
        if planned is not None:
            self.planned = planned
            self._enable()
            with self.plan:
                _show(planned, self.bench)

    def allow(self, under_way: bool) -> None:
        """Called with whether a run is in progress: two cannot be."""
        self.under_way = under_way
        self._enable()

    def _enable(self) -> None:
        """Enable Start if there is a plan and no run in progress."""
        self.button.set_enabled(self.planned is not None and not self.under_way)
        self.waits.set_text("Start waits until the present run ends." if self.under_way else "")

    def _plan(self, procedure: Procedure, settings: Mapping[str, str]) -> Plan:
        try:
            planned = plan(self.bench, procedure, parse(procedure, settings))
        except SettingError as error:
            raise SettingError(with_labels(str(error), procedure.defaults)) from error
        except (NoInstrument, NotWired) as error:
            if not self.can_change_bench:
                raise
            raise NoInstrument(f"{error}{'' if str(error).endswith('.') else '.'}\n{OTHER_BENCH}") from error
        if planned.reach:
            strip(mounting(planned))  # drawn and kept before a person clicks on Start
        return planned

    def start(self) -> None:
        """Open the checks before the run; their Begin starts it."""
        if lab_read() is not None:
            ui.notify(
                "This workbench reads the lab's record; start `rig web` without --record to make runs", type="warning"
            )
            return
        under_way = control.latest()
        if under_way is not None and under_way.phase != "ended":
            ui.notify(f"{under_way.procedure} is running; stop it first", type="warning")
            return
        if self.planned is None:  # a click that was on its way while a setting changed
            ui.notify("The plan is not ready; press Start again when it is shown", type="warning")
            return
        name, settings = str(self.name.value), self.settings()
        BeginDialog(before_start(self.planned, self.bench), partial(self._begin, name, settings))

    async def _begin(
        self, name: str, settings: Mapping[str, str], sensor: Mapping[str, str], answers: Mapping[str, str]
    ) -> None:
        """Start the run in a background process. Raises Busy while another run is in progress."""
        attended = bool(self.attended.value)
        await off_loop(control.begin, name, settings, self.bench_file, attended, sensor, answers)
        if self.started is not None:
            await self.started()


def _show(planned: Plan, bench: Bench) -> None:
    """Show a plan."""
    rows = plan_facts(planned, bench)
    if planned.asked:
        rows["Asks you"] = " ".join(dict.fromkeys(question.text for question in planned.asked))
    facts(rows)
    lines = [(duration(stretch.start_s), stretch.words.replace("  ", ", ")) for stretch in stretches(planned)]
    if lines:
        table(("at", "what"), lines[:MOST_STRETCHES])
    if len(lines) > MOST_STRETCHES:
        with ui.expansion(f"{len(lines) - MOST_STRETCHES} more").props("dense"):
            table(("at", "what"), lines[MOST_STRETCHES:])


def _field(name: str, value: str, options: Sequence[str]) -> ui.select | ui.input:
    """One setting: a list if it has only a few possible values."""
    if value in options:
        return ui.select(list(options), label=setting_label(name), value=value).props("dense options-dense")
    return ui.input(setting_label(name), value=value).props("dense debounce=300")
