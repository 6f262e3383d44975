"""Screens of a run: the plan before it begins, and the live values with their limits."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from datetime import date
from pathlib import Path

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from calibrations.text import duration
from procedures.catalogue import Procedure
from rig.bench import Bench
from rig.bench.certificates import find_expired
from rig.drawings import Attitude, orientation_map, sketch
from rig.planning.plan import Plan, stretches
from rig.planning.preparation import checks, stops, storage
from rig.runs.estimates import Value, nearness
from rig.runs.observer import RunView, values

WIDTH = 15  # characters, the ends included
STYLES = {"": "green", "near its limit": "yellow", "beyond its limit": "bold red"}


def gauge(value: float, low: float, high: float) -> Text:
    """`├────────●───┤`: the position of `value` between `low` and `high`; outside them at the end."""
    share = (value - low) / (high - low) if math.isfinite(value) and high > low else 1.0
    place = 1 + round(min(max(share, 0.0), 1.0) * (WIDTH - 3))
    mark = ("●", STYLES[nearness(value, low, high)])
    return Text.assemble(("├" + "─" * (place - 1), "dim"), mark, ("─" * (WIDTH - 2 - place) + "┤", "dim"))


# The live screen: present step, progress, values with their limits.


Row = tuple[RenderableType, ...]


def screen(view: RunView, now_s: float) -> RenderableType:
    """The screen at `now_s` of the wall clock."""
    grid = Table.grid(padding=(0, 2))
    for row in _rows(view):
        grid.add_row(*row)
    body: list[RenderableType] = [
        _heading(view, now_s),
        ProgressBar(max(view.progress.total, 1), view.progress.done),
        Text(),
        grid,
    ]
    if view.guidance is not None:
        body.insert(3, Text("\n".join([*orientation_map(view.guidance), ""])))
    subtitle = "Ctrl-C stops the stages" if view.guidance is None else "Ctrl-C ends; later: rig resume"
    return Panel(Group(*body), title=view.title, subtitle=subtitle, title_align="left", subtitle_align="right")


def _heading(view: RunView, now_s: float) -> Table:
    """The present step, and the progress at the right."""
    heading = Table.grid(expand=True)
    heading.add_column(ratio=1)
    heading.add_column(justify="right")
    heading.add_row(Text(view.now, style="bold"), Text("  ".join(filter(None, (view.count, view.left(now_s))))))
    return heading


def _rows(view: RunView) -> Iterator[Row]:
    """A row for each value: name, value, position between its limits, remark."""
    yield from (_row(value) for value in values(view))
    if view.kept is not None:
        yield "", Text(f"t = {duration(view.kept.t_s)}", style="dim")


def _row(value: Value) -> Row:
    if value.limits is None:
        return value.name, Text(value.shown, justify="right"), "", Text(value.remark)
    remark = Text(", ".join(filter(None, (value.near, value.remark))), style=STYLES[value.near] if value.near else "")
    return value.name, Text(value.shown, justify="right"), _bar(value.reading, *value.limits), remark


def _bar(value: float, low: float, high: float) -> Text:
    return Text.assemble((f"{low:>6.4g} ", "dim"), gauge(value, low, high), (f" {high:.4g}", "dim"))


# The plan before a run: actions, duration, reach of the stages, checks by hand.


FACTS = re.compile(r"^(Excites|Blind to)\s+(.*(?:\n\s+.*)*)", re.MULTILINE)
MOST_STRETCHES = 6


def screen_before_run(plan: Plan, procedure: Procedure, bench: Bench, free_bytes: int, today: date) -> RenderableType:
    """The screen before a run; `free_bytes` is the free space on the disk of the record."""
    facts = Table.grid(padding=(0, 2))
    for name, text in _facts(plan, procedure, bench, free_bytes):
        facts.add_row(Text(name, style="bold"), text)
    for text in find_expired(bench, today):
        facts.add_row(Text("Expired", style="bold yellow"), f"{text}: the run gets a remark")
    summary = Text(procedure.summary[:1].upper() + procedure.summary[1:] + ".")
    check = Text("\n".join(f"[ ] {line}" for line in checks(plan)))
    by_hand = Group(Text("\nCheck by hand", style="bold"), check)
    return Panel(Group(summary, Text(), facts, by_hand), title=f"{plan.procedure} on {bench.name}", title_align="left")


def _facts(plan: Plan, procedure: Procedure, bench: Bench, free_bytes: int) -> Iterator[tuple[str, str]]:
    for match in FACTS.finditer(procedure.doc):
        yield match[1], " ".join(match[2].split())
    time = " of simulated time, which passes faster" if bench.simulated else ""
    yield "Takes", f"{duration(plan.duration_s)}{time}, {plan.poses} poses"
    yield "Does", "\n".join(_action_lines(plan))
    for role, ((low, high), (least, most)) in plan.reach.items():
        yield f"Turns {role}", f"from {low:g} to {high:g} deg; the limits are {least:g} to {most:g} deg"
    yield "Stops", "; ".join(stops(bench))
    if questions := Counter(re.sub(r"-\d+$", "", question.name) for question in plan.asked):
        yield "Asks you", ", ".join(f"{name} ({n} times)" if n > 1 else name for name, n in questions.items())
    yield "Stores", storage(plan, free_bytes)


def _action_lines(plan: Plan) -> list[str]:
    lines = [stretch.words for stretch in stretches(plan)]
    if len(lines) > MOST_STRETCHES:
        lines[MOST_STRETCHES - 1 :] = [f"and {len(lines) - MOST_STRETCHES + 1} more: rig plan {plan.procedure}"]
    return lines or ["records readings and no pose"]


def sketch_with_legend(attitude: Attitude, file: Path) -> RenderableType:
    """The sketch with its legend; `file` is the complete drawing."""
    grid = Table.grid(padding=(0, 3))
    legend = f"\n{attitude.words}\n\nTable at alpha 0, from above:\nx, y  axes of the sensor\no     pin 1\n\n{file}"
    grid.add_row(Text("\n".join(sketch(attitude))), Text(legend, overflow="fold"))
    return grid
