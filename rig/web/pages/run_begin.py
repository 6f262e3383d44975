"""The last step before a run: sensor, drawing, checks by hand, duration and limits; then Begin."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field

from nicegui import ui

from calibrations.text import capital, count_words
from rig.bench import Bench
from rig.drawings import Attitude, strip
from rig.files import free_bytes, home
from rig.planning.plan import Plan
from rig.planning.preparation import checks, first_question, mounting, stops, storage
from rig.record import Run
from rig.web.parts import dialog_with_name, div, facts, for_page, message, words


@dataclass(frozen=True)
class Preparation:
    """The content of the dialog. `answers`: the questions that the checks answer with yes, by name."""

    title: str
    facts: Mapping[str, str]
    checks: Sequence[str]
    attitude: Attitude | None  # None: the sensor is in a hand
    sensor: Mapping[str, str] | None = None  # name and serial number; None: they cannot be changed
    answers: Mapping[str, str] = field(default_factory=dict)


def before_start(plan: Plan, bench: Bench) -> Preparation:
    """The preparation of a new run. The sensors of a batch keep the names of the bench file."""
    question = first_question(plan)
    by_hand = [for_page(capital(line)) for line in checks(plan)]
    sensor = None if bench.sensors else {"name": bench.sensor.name, "serial": bench.sensor.serial}
    batch = {"Sensors": ", ".join(bench.sensors)} if bench.sensors else {}
    return Preparation(
        f"{plan.procedure} on {bench.name}",
        batch | plan_facts(plan, bench),
        [*by_hand, *([question.text] if question is not None else [])],
        mounting(plan) if plan.reach else None,
        sensor,
        {question.name: "yes"} if question is not None else {},
    )


def before_resume(run: Run, plan: Plan, bench: Bench, attitude: Attitude | None) -> Preparation:
    """The preparation of a stopped run that continues.

    `plan` is that of the whole run on its `bench`. `attitude`: the last known one; None if the sensor is in a hand.
    """
    remaining = plan.after(run.rows)
    names = bench.sensors or {" ".join(filter(None, (bench.sensor.name, bench.sensor.serial))): bench.sensor}
    head = {
        "Sensors" if bench.sensors else "Sensor": ", ".join(names),
        "Recorded": f"{run.rows} of {plan.poses} poses",
    }
    rows = plan_facts(remaining, bench)
    rows["Takes"] = f"{rows['Takes']}; the whole run {_duration_in_words(plan.duration_s)}"
    return Preparation(
        f"Resume {run.procedure} {run.run}",
        head | rows,
        [for_page(capital(line)) for line in checks(plan, is_resumed=True)],
        attitude if plan.reach else None,
    )


def plan_facts(plan: Plan, bench: Bench) -> dict[str, str]:
    """Duration, storage, reach and limits of a plan."""
    faster = ", simulated: it passes faster" if bench.simulated else ""
    poses = count_words(plan.poses, "pose", "poses")
    rows = {
        "Takes": f"{_duration_in_words(plan.duration_s)}{faster}",
        "Stores": f"{poses}, {storage(plan, free_bytes(home()))}" if plan.poses else "its readings, and no poses",
    }
    for role, ((low, high), (least, most)) in plan.reach.items():
        turns = f"from {low:g} to {high:g} deg" if low < high else f"to {low:g} deg"
        reach = f"{turns}; the limits are {least:g} to {most:g} deg"
        rows[f"Turns {role}"] = for_page(reach)
    rows["Stops"] = for_page("; ".join(stops(bench)))
    return rows


def _duration_in_words(seconds: float) -> str:
    """12 min 30 s, 1 h 2 min: on a page without a column of times, 12:30 may be hours or minutes."""
    minutes, s = divmod(round(seconds), 60)
    hours, m = divmod(minutes, 60)
    return f"{hours} h {m} min" if hours else f"{m} min {s} s" if m else f"{s} s"


Begin = Callable[[Mapping[str, str], Mapping[str, str]], Awaitable[None]]


class BeginDialog:
    """The dialog; `begin` receives sensor and answers. *Begin* is enabled when every check is ticked.

    An error of `begin` keeps the dialog open and is shown in it.
    """

    def __init__(self, content: Preparation, begin: Begin) -> None:
        self.content, self.begin = content, begin
        with dialog_with_name(content.title).props("no-backdrop-dismiss") as self.dialog, ui.card().classes("begin"):
            words(content.title, "title")
            if content.attitude is not None:
                with div("attitude"):
                    ui.html(strip(content.attitude), sanitize=False)
            with div("two"):
                with div("stack"):
                    self._sensor()
                    facts(content.facts)
                with div("stack"):
                    words("Check by hand", "title")
                    self.boxes = [ui.checkbox(line, on_change=self._look) for line in content.checks]
            self.fault = words("", "fault").props("role=alert")
            with div("row-of"):
                self.button = ui.button("Begin", icon="play_arrow", on_click=self._begin)
                ui.button("Cancel", on_click=self.close).props("flat")
                self.hint = words("", "quiet small")
        self._look()
        self.dialog.on("hide", self.dialog.delete)
        self.dialog.open()

    def _sensor(self) -> None:
        self.inputs: dict[str, ui.input] = {}
        if self.content.sensor is None:
            return
        with div("row-of"):
            for name, label in (("name", "Sensor"), ("serial", "Serial number")):
                field = ui.input(label, value=self.content.sensor[name], on_change=self._look).props("dense")
                self.inputs[name] = field.classes("grow")

    @property
    def sensor(self) -> dict[str, str]:
        """Name and serial number as typed."""
        return {name: str(field.value or "").strip() for name, field in self.inputs.items()}

    def _look(self) -> None:
        """Enable Begin if every check is ticked and the sensor has a name or a serial number."""
        if not hasattr(self, "button"):
            return
        open_boxes = sum(not box.value for box in self.boxes)
        unnamed = bool(self.inputs) and not any(self.sensor.values())
        self.button.set_enabled(not open_boxes and not unnamed)
        text = f"{open_boxes} of {len(self.boxes)} checks to do" if open_boxes else "Nothing has moved yet."
        self.hint.set_text("Give the name or the serial number of the sensor." if unnamed else text)

    async def _begin(self) -> None:
        self.button.disable()
        self.fault.set_text("")
        sensor = {name: text for name, text in self.sensor.items() if text or name == "serial"}
        try:
            await self.begin(sensor, self.content.answers)
        except Exception as error:
            self._look()
            self.fault.set_text(message(error))
            self.hint.set_text("")  # another run may move the stages
            return
        self.close()

    def close(self) -> None:
        """Close the dialog and forget its ticks."""
        self.dialog.close()  # then it is hidden, as by the key Escape
