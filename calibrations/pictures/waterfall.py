"""The falling error: from the model as it was, effect by effect, down towards the noise floor."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter

from calibrations.discover import Added, Discovery
from calibrations.fit import Fit
from calibrations.numerals import plain
from calibrations.pictures.style import AMBER, BAND, BLUE, GREEN, INK, QUIET, VERMILION, panels, styled
from calibrations.search.held_out import held_out_excess
from calibrations.units import milli, pooled_mg, rows_of

LARGE_FALL = 8.0  # from first to last: beyond this the last bars would vanish on a linear scale
BAR = 0.62
MOST_LEVEL = 7  # names beside each other; more are written aslant


@dataclass(frozen=True)
class Level:
    """The error at one point of the way, in multiples of the noise floor (of noise: of chance), and what it is
    otherwise, such as "3.8 mg".
    """

    name: str
    seen: float
    unseen: float
    rms: str


class Falling(Protocol):
    """A fit, and the steps from there: a discovery, or a model that a person lets grow."""

    @property
    def start(self) -> Fit: ...

    @property
    def steps(self) -> tuple[Added, ...]: ...


def levels(found: Falling) -> list[Level]:
    """The model as it was, then each effect added."""
    start = Level(found.start.model.name, found.start.pooled_excess, held_out_excess(found.start), _rms(found.start))
    after = [Level(f"+ {s.name}", s.after.pooled_excess, s.held_out_after, _rms(s.after)) for s in found.steps]
    return [start, *after]


def _rms(fit: Fit) -> str:
    return f"{plain(pooled_mg(fit)[0], 2)} {milli(fit)}"


@styled
def picture(found: Discovery) -> Figure:
    """Bars from the error before to the error after each effect; diamonds for unseen poses; the noise floor."""
    steps, kind = levels(found), rows_of(found.start.table)
    figure, axes = panels(1, 1, 4.2)
    ax: Axes = axes[0, 0]
    seen, unseen = [level.seen for level in steps], [level.unseen for level in steps]
    bottom = _scale(ax, seen, unseen)
    ax.axhspan(bottom, 1.0, color=BAND, lw=0, zorder=0.5)
    _bars(ax, seen, bottom, VERMILION if found.verdict == "unexplained" else GREEN)
    (diamonds,) = ax.plot(range(len(steps)), unseen, "D", ms=5.5, mfc=AMBER, mec=INK, mew=0.7, zorder=4, ls="")
    diamonds.set_label(f"on unseen {kind}")
    for k, level in enumerate(steps):
        _told(ax, k, level)
    _names(ax, [level.name for level in steps] + (["left"] if len(steps) > 1 else []))
    floor = f"noise floor\n{plain(pooled_mg(found.start)[1], 2)} {milli(found.start)}"
    ax.annotate(floor, (1, 1.0), (-4, 3), xycoords=("axes fraction", "data"), textcoords="offset points", ha="right")
    ax.legend(handles=[Patch(color=QUIET, label=f"on the {kind} of the fit"), diamonds], loc="upper right")
    return figure


def _scale(ax: Axes, seen: list[float], unseen: list[float]) -> float:
    """The vertical axis, logarithmic where the fall is large; its lower end."""
    large = seen[0] / seen[-1] > LARGE_FALL
    bottom = 0.5 * min(1.0, *seen, *unseen) if large else 0.0
    ax.set_yscale("log" if large else "linear")
    ax.set_ylim(bottom, max(*seen, *unseen) * (2.5 if large else 1.2))
    ax.set_ylabel("rms error / noise floor")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.grid(visible=False, axis="x")
    return bottom


def _names(ax: Axes, names: list[str]) -> None:
    """The names under the bars, and room on the right for that of the noise floor."""
    ax.set_xlim(-0.7, 1.13 * max(len(names), 3) - 0.2)
    if len(names) > MOST_LEVEL:
        ax.set_xticks(range(len(names)), names, rotation=30, ha="right", rotation_mode="anchor")
    else:
        ax.set_xticks(range(len(names)), [_broken(name) for name in names])


def _bars(ax: Axes, seen: list[float], bottom: float, end: str) -> None:
    """The first and the last level stand on the ground; between them hang the falls."""
    ax.bar(0, seen[0] - bottom, BAR, bottom, color=QUIET, zorder=2)
    for k, (high, low) in enumerate(pairwise(seen), 1):
        ax.bar(k, high - low, BAR, low, color=BLUE if low <= high else VERMILION, zorder=2)
        ax.plot([k - 1 + BAR / 2, k + BAR / 2], [high, high], color=QUIET, lw=0.8, zorder=1)
    if len(seen) > 1:
        last = len(seen)
        ax.bar(last, seen[-1] - bottom, BAR, bottom, color=end, zorder=2)
        ax.plot([last - 1 + BAR / 2, last + BAR / 2], [seen[-1]] * 2, color=QUIET, lw=0.8, zorder=1)


def _told(ax: Axes, k: int, level: Level) -> None:
    """The level in numbers: over the first bar, under the others."""
    text = f"{plain(level.seen)} ×\n{level.rms}"
    side, align = (9, "bottom") if k == 0 else (-9, "top")
    ax.annotate(text, (k, level.seen), (0, side), textcoords="offset points", ha="center", va=align, fontsize=8.5,
                zorder=5)  # fmt: skip


def _broken(name: str) -> str:
    """A long name on two lines."""
    head, dash, tail = name.partition("-")
    return f"{head}{dash}\n{tail}" if len(name) > 12 else name
