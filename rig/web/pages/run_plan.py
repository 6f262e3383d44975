"""A procedure with its settings, what it would do, and the button that starts it."""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any

from nicegui import ui

from calibrations.presentation.text import duration, size
from procedures.catalogue import Procedure, find, paths, summary
from procedures.settings import choices, parse
from rig.bench import Bench
from rig.files import free_bytes, home
from rig.planning.plan import Plan, plan, stretches
from rig.runs.background import control
from rig.web.desk import Desk, lab_read
from rig.web.parts import box, div, facts, failed, message, off_loop, table, waiting, words

# Settings as people read and write them: `step_deg = 10.0` as `step (deg)`, `10`.

UNITS = {  # ends of names, longest first
    "deg_s": "deg/s",
    "m_s2": "m/s²",
    "deg": "deg",
    "hz": "Hz",
    "um": "µm",
    "c": "°C",
    "s": "s",
}


def label(name: str) -> str:
    """`step_deg` as `step (deg)`."""
    unit = next((end for end in UNITS if name.endswith(f"_{end}")), "")
    head = name.removesuffix(f"_{unit}").replace("_", " ")
    return f"{head} ({UNITS[unit]})" if unit else head


def written(value: Any) -> str:
    """A setting as it is typed."""
    if isinstance(value, (list, tuple)):
        return ",".join(f"{part:g}" if isinstance(part, float) else str(part) for part in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


MOST_STRETCHES = 12
FIRST = "sweep"


class Planning:
    """The form; what it says is planned as it is changed."""

    def __init__(self, desk: Desk, bench: Bench, given: Mapping[str, str]) -> None:
        self.desk, self.bench = desk, bench
        self.given = {name: value for name, value in given.items() if name != "procedure"}
        self.started: Callable[[], Awaitable[None]] | None = None
        self.asked, self.good = 0, False
        names = {name: f"{name}: {summary(path)}" for name, path in paths(bench.folders.procedures).items()}
        chosen = given.get("procedure", FIRST)
        with box():
            words("Measure", "title")
            self.name = ui.select(names, label="Procedure", value=chosen if chosen in names else FIRST)
            self.name.props("dense options-dense").on_value_change(self._chosen).style("width: 100%")
            self.about = words("", "quiet small")
            self.fields = div("settings")
            with ui.expansion("What the settings mean").props("dense") as self.meant:
                self.meaning = words("", "quiet small")
            self.attended = ui.switch("Ask me, even where the simulated rig could answer", value=not bench.simulated)
            self.attended.set_visibility(bench.simulated)
            with div("row-of"):
                self.button = ui.button("Start", icon="play_arrow", on_click=self.start)

    def lay_out_plan(self) -> None:
        """The plan's place on the page."""
        with box() as self.plan_box:
            words("Plan", "title")
            self.plan = div("stack")
        self._chosen()

    @property
    def procedure(self) -> Procedure:
        """The one that is chosen."""
        return find(str(self.name.value), self.bench.folders.procedures)

    def _chosen(self) -> None:
        """Another procedure has other settings."""
        procedure = self.procedure
        self.about.set_text(" ".join(procedure.doc.partition("\n\n")[2].split("Source")[0].split()))
        self.meaning.set_text(_meaning(procedure))
        self.meant.set_visibility(bool(procedure.defaults))
        self.fields.clear()
        few = choices(procedure)
        self.inputs: dict[str, Any] = {}
        with self.fields:
            for name, default in procedure.defaults.items():
                field = _field(name, self.given.get(name, written(default)), few.get(name, ()))
                self.inputs[name] = field.on_value_change(self.replan)
        ui.timer(0.0, self.replan, once=True)

    def settings(self) -> dict[str, str]:
        """Those that are not as by default, as texts."""
        defaults = self.procedure.defaults
        texts = {name: str(field.value or "").strip() for name, field in self.inputs.items()}
        return {name: text for name, text in texts.items() if text != written(defaults[name])}

    async def replan(self) -> None:
        """What would be done now."""
        self.asked += 1
        asked, self.good = self.asked, False
        self.button.disable()
        self.plan.clear()
        with self.plan:
            waiting("Going through it without touching anything")
        try:
            procedure = self.procedure
            found = await off_loop(plan, self.bench, procedure, parse(procedure, self.settings()))
        except Exception as error:
            if asked == self.asked:
                self.plan.clear()
                with self.plan:
                    failed("This cannot be run", message(error))
            return
        if asked == self.asked:
            self.good = True
            self.button.enable()
            self.plan.clear()
            with self.plan:
                _show(found, self.bench)

    async def start(self) -> None:
        """Begin the run in a process of its own."""
        if lab_read() is not None:
            ui.notify("This workbench reads the lab's record; `rig web` without --record makes runs", type="warning")
            return
        under_way = control.latest()
        if under_way is not None and under_way.phase != "ended":
            ui.notify(f"{under_way.procedure} is under way; stop it first", type="warning")
            return
        if self.good:
            self.button.disable()
            name, settings = str(self.name.value), self.settings()
            await off_loop(control.begin, name, settings, self.desk.bench_file, bool(self.attended.value))
            if self.started is not None:
                await self.started()
            self.button.enable()


def _show(found: Plan, bench: Bench) -> None:
    """A plan for people."""
    faster = ", which is simulated and faster" if bench.simulated else ""
    free = free_bytes(home())
    rows = {
        "Takes": f"{duration(found.duration_s)}{faster}",
        "Keeps": f"{found.poses} poses, {size(found.bytes)}; {size(free)} are free on the disk",
    }
    for role, ((low, high), (least, most)) in found.reach.items():
        rows[f"Turns {role}"] = f"from {low:g} to {high:g} deg; its limits are {least:g} to {most:g} deg"
    if found.questions:
        rows["Asks you"] = "; ".join(dict.fromkeys(found.questions))
    facts(rows)
    lines = [(duration(each.start_s), each.words) for each in stretches(found)]
    table(("at", "what"), lines[:MOST_STRETCHES])
    if len(lines) > MOST_STRETCHES:
        words(f"and {len(lines) - MOST_STRETCHES} more: rig plan {found.procedure}", "quiet small")


def _field(name: str, value: str, few: Sequence[str]) -> ui.select | ui.input:
    """One setting: a list where it takes one of a few texts."""
    if value in few:
        return ui.select(list(few), label=label(name), value=value).props("dense options-dense")
    return ui.input(label(name), value=value).props("dense debounce=300")


def _meaning(procedure: Procedure) -> str:
    """What the procedure says of its settings, by the names that they have on the page."""
    text = " ".join(inspect.cleandoc(procedure.function.__doc__ or "").split())
    for name in sorted(procedure.defaults, key=len, reverse=True):
        text = text.replace(f"`{name}`", label(name).partition(" (")[0]).replace(f"`{name}=", f"`{label(name)} = ")
    return text.replace("`", "")
