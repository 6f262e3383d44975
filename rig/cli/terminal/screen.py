"""The one screen of a run: what happens now, how far it is, live values against their limits."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from calibrations.presentation.text import duration
from rig.cli.terminal.gauge import STYLES, gauge
from rig.runs.observer import Seen, Value, values

Row = tuple[RenderableType, ...]


def screen(seen: Seen, now_s: float) -> RenderableType:
    """The screen at `now_s` of the wall's clock."""
    shown = Table.grid(padding=(0, 2))
    for row in _rows(seen):
        shown.add_row(*row)
    body = Group(_heading(seen, now_s), ProgressBar(max(seen.way.total, 1), seen.way.done), Text(), shown)
    return Panel(body, title=seen.title, subtitle="Ctrl-C stops the stages", title_align="left", subtitle_align="right")


def _heading(seen: Seen, now_s: float) -> Table:
    """What happens now, and at the right how far it is."""
    heading = Table.grid(expand=True)
    heading.add_column(ratio=1)
    heading.add_column(justify="right")
    heading.add_row(Text(seen.now, style="bold"), Text("  ".join(filter(None, (seen.count, seen.left(now_s))))))
    return heading


def _rows(seen: Seen) -> Iterator[Row]:
    """A row for each live value: its name, what it is, where it is between its limits, a remark."""
    yield from (_row(value) for value in values(seen))
    if seen.kept is not None:
        yield "", Text(f"t = {duration(seen.kept.t_s)}", style="dim")


def _row(value: Value) -> Row:
    if value.limits is None:
        return value.name, Text(value.shown, justify="right"), "", Text(value.remark)
    remark = Text(", ".join(filter(None, (value.near, value.remark))), style=STYLES[value.near] if value.near else "")
    return value.name, Text(value.shown, justify="right"), _bar(value.reading, *value.limits), remark


def _bar(value: float, low: float, high: float) -> Text:
    return Text.assemble((f"{low:>6.4g} ", "dim"), gauge(value, low, high), (f" {high:.4g}", "dim"))
