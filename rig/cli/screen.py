"""The one screen of a run: what happens now, how far it is, live values against their limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from procedures.level_check import reversal
from procedures.session import Limits
from rig.cli.gauge import STYLES, gauge, nearness
from rig.cli.output import duration
from rig.cli.way import Way
from rig.record import Kept

UNUSUAL = 2.0  # times the usual scatter, or less than a half of it
Row = tuple[RenderableType, ...]


@dataclass(frozen=True)
class Seen:
    """What is known of a run at one moment.

    `usual_v`: by channel the usual scatter of dwells of this kind. `tilt`: the level's readings by name, deg.
    `range_v`: what the converter can take. `simulated`: the rig's time is faster than the wall's.
    """

    title: str
    limits: Limits
    range_v: float | None
    simulated: bool
    now: str = "connecting"
    way: Way = field(default_factory=Way)
    kept: Kept | None = None
    usual_v: Mapping[str, float] = field(default_factory=dict)
    tilt: Mapping[str, float] = field(default_factory=dict)


def screen(seen: Seen, now_s: float) -> RenderableType:
    """The screen at `now_s` of the wall's clock."""
    values = Table.grid(padding=(0, 2))
    for row in _values(seen):
        values.add_row(*row)
    body = Group(_heading(seen, now_s), ProgressBar(max(seen.way.total, 1), seen.way.done), Text(), values)
    return Panel(body, title=seen.title, subtitle="Ctrl-C stops the stages", title_align="left", subtitle_align="right")


def _heading(seen: Seen, now_s: float) -> Table:
    """What happens now, and at the right how far it is."""
    way = seen.way
    heading = Table.grid(expand=True)
    heading.add_column(ratio=1)
    heading.add_column(justify="right")
    count = f"{way.done}/{way.total} poses" if way.total else ""
    heading.add_row(Text(seen.now, style="bold"), Text("  ".join(filter(None, (count, _left(seen, now_s))))))
    return heading


def _left(seen: Seen, now_s: float) -> str:
    """Time left: measured; before there is a pace, as planned."""
    if (left_s := seen.way.left_s(now_s)) is not None:
        return f"{duration(left_s)} left"
    planned_s = seen.way.planned_left_s()
    if planned_s is None:
        return ""
    return f"{duration(planned_s)} {'of simulated time ' if seen.simulated else ''}left as planned"


def _values(seen: Seen) -> Iterator[Row]:
    """A row for each live value: its name, what it is, where it is between its limits, a remark."""
    kept = seen.kept
    if kept is not None and kept.temperature_c is not None:
        low, high = seen.limits.temperature_c
        yield _limited("temperature", kept.temperature_c, f"{kept.temperature_c:.1f} C", low, high)
    if (limit := seen.limits.level_deg) is not None:
        for axis in "xy":
            if (tilt_deg := _tilt(seen.tilt, axis)) is not None:
                yield _limited(f"level {axis}", tilt_deg, f"{tilt_deg:.3f} deg", -limit, limit)
    if kept is not None:
        dwell, volts = kept.dwell, kept.samples.volts
        for name, column in zip(kept.samples.channels, volts.T, strict=True):
            farthest = float(column[np.argmax(np.abs(column))])
            yield _channel(name, dwell.means[name], dwell.stds[name], farthest, seen)
        yield "", Text(f"t = {duration(kept.t_s)}", style="dim")


def _limited(name: str, value: float, shown: str, low: float, high: float, remark: str = "") -> Row:
    near = nearness(value, low, high)
    words = ", ".join(filter(None, (near, remark)))
    return name, Text(shown, justify="right"), _bar(value, low, high), Text(words, style=STYLES[near] if near else "")


def _bar(value: float, low: float, high: float) -> Text:
    return Text.assemble((f"{low:>6.4g} ", "dim"), gauge(value, low, high), (f" {high:.4g}", "dim"))


def _channel(name: str, mean: float, std: float, farthest: float, seen: Seen) -> Row:
    """A channel in V; its bar is the converter's range, in which its sample that is farthest out is marked."""
    scatter = f"rms {1e3 * std:.3f} mV"
    if usual_v := seen.usual_v.get(name):
        ratio = std / usual_v
        scatter += f", {ratio:.2g} x the usual" if not 1 / UNUSUAL <= ratio <= UNUSUAL else ", as usual"
    if seen.range_v is None:
        return name, Text(f"{mean:.5f} V", justify="right"), "", Text(scatter)
    return _limited(name, farthest, f"{mean:.5f} V", -seen.range_v, seen.range_v, scatter)


def _tilt(read: Mapping[str, float], axis: str) -> float | None:
    """The table's tilt, as soon as the level was read both ways round."""
    both = [read.get(f"level-{side}-{axis}") for side in ("front", "back")]
    return None if both[0] is None or both[1] is None else reversal(both[0], both[1])[0]
