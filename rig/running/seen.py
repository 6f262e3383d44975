"""What whoever looks on knows of a run: what happens now, how far it is, live values against their limits.

The guided terminal and the workbench show the same.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from calibrations.evaluations.forecast import Forecast
from procedures.level_check import reversal
from procedures.session import Limits, Reading
from rig.bench import Bench
from rig.numerals import duration
from rig.planning.plan import Plan
from rig.record import Kept
from rig.running.so_far import SoFar
from rig.running.soak_forecast import outlook, present, soak_watch
from rig.running.way import Way

UNUSUAL = 2.0  # times the usual scatter, or less than a half of it
REMEMBERED = 200  # dwells of a kind that say what scatter is usual
NEAR = 0.1  # of the span: so near to a limit, a value is marked


@dataclass(frozen=True)
class Seen:
    """What is known of a run at one moment.

    `usual_v`: by channel the usual scatter of dwells of this kind. `tilt`: the level's readings by name, deg.
    `foreseen`: of a soak, what bias and scale factor come to. `so_far`: of others, what they are by the poses so far.
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
    foreseen: Mapping[str, Forecast] = field(default_factory=dict)
    so_far: Mapping[str, str] = field(default_factory=dict)

    @property
    def count(self) -> str:
        """How many poses are kept, of how many."""
        return f"{self.way.done}/{self.way.total} poses" if self.way.total else ""

    def left(self, now_s: float) -> str:
        """Time left at `now_s` of the wall's clock: measured; before there is a pace, as planned."""
        if (left_s := self.way.left_s(now_s)) is not None:
            return f"{duration(left_s)} left"
        planned_s = self.way.planned_left_s()
        if planned_s is None:
            return ""
        return f"{duration(planned_s)} {'of simulated time ' if self.simulated else ''}left as planned"


@dataclass(frozen=True)
class Value:
    """A live value in words; where it has limits, the `reading` that is held against them, and how near it is."""

    name: str
    shown: str
    remark: str = ""
    reading: float = 0.0
    limits: tuple[float, float] | None = None

    @property
    def near(self) -> str:
        """Whether it is near or beyond a limit, in words."""
        return nearness(self.reading, *self.limits) if self.limits else ""


class Sight:
    """Keeps what is seen of a run up to date, as its watch hears it."""

    def __init__(self, title: str, bench: Bench) -> None:
        adc = bench.instruments.get("adc")
        range_v = getattr(adc.typed_settings(), "range_v", None) if adc else None
        self.seen = Seen(title, bench.limits, range_v, bench.simulated)
        self._soak, self._so_far = soak_watch(title), SoFar()
        self._scatter: dict[tuple[str, str], deque[float]] = defaultdict(lambda: deque(maxlen=REMEMBERED))

    def planned(self, plan: Plan) -> None:
        """What it is going to do."""
        way = replace(self.seen.way, at_s=tuple(held.start_s for held in plan.held), end_s=plan.duration_s)
        self.seen = replace(self.seen, way=way)

    def begun(self, title: str, run: str = "") -> None:
        """The run begins, or goes on; the title may be its name."""
        if self._soak:
            self._soak.begun(run or title)
        else:
            self._so_far.begun(run or title)
        self.seen = replace(self.seen, title=title, way=self.seen.way.begin(time.monotonic()))

    def doing(self, text: str) -> None:
        self.seen = replace(self.seen, now=text)

    def expect(self, total: int, done: int) -> None:
        self.seen = replace(self.seen, way=self.seen.way.expect(total, done))

    def kept(self, kept: Kept) -> None:
        """The last dwell's values, beside what was usual before it."""
        kind = kept.pose.path.partition(" ")[0]
        usual = {}
        for name, std in kept.dwell.stds.items():
            before_it = self._scatter[name, kind]
            if before_it:
                usual[name] = statistics.median(before_it)
            before_it.append(std)
        foreseen = (self._soak.kept(kept) if self._soak else {}) or self.seen.foreseen
        way, so_far = self.seen.way.step(time.monotonic()), self._so_far.kept(kept)
        self.seen = replace(self.seen, kept=kept, usual_v=usual, foreseen=foreseen, so_far=so_far, way=way)

    def read(self, reading: Reading) -> None:
        self.seen = replace(self.seen, tilt={**self.seen.tilt, reading.name: reading.value})


def nearness(value: float, low: float, high: float) -> str:
    """ "" | near its limit | beyond its limit"""
    inside = min(value - low, high - value)
    if not inside >= 0:  # nor is what is no number
        return "beyond its limit"
    return "near its limit" if inside < NEAR * (high - low) else ""


def values(seen: Seen) -> Iterator[Value]:
    """The live values: temperature, tilt, and each channel."""
    kept = seen.kept
    if kept is not None and kept.temperature_c is not None:
        yield Value("temperature", f"{kept.temperature_c:.1f} C", "", kept.temperature_c, seen.limits.temperature_c)
    if (limit := seen.limits.level_deg) is not None:
        for axis in "xy":
            if (tilt_deg := _tilt(seen.tilt, axis)) is not None:
                yield Value(f"level {axis}", f"{tilt_deg:.3f} deg", "", tilt_deg, (-limit, limit))
    if kept is not None:
        dwell, volts = kept.dwell, kept.samples.volts
        for name, column in zip(kept.samples.channels, volts.T, strict=True):
            farthest = float(column[np.argmax(np.abs(column))])
            yield _channel(name, dwell.means[name], dwell.stds[name], farthest, seen)
    for name, each in seen.foreseen.items():
        yield Value(name, present(name, each), outlook(name, each))
    for name, shown in seen.so_far.items():
        yield Value(name, shown, "by the poses so far")


def _channel(name: str, mean: float, std: float, farthest: float, seen: Seen) -> Value:
    """A channel in V; what is held against the converter's range is its sample that is farthest out."""
    scatter = f"rms {1e3 * std:.3f} mV"
    if usual_v := seen.usual_v.get(name):
        ratio = std / usual_v
        scatter += f", {ratio:.2g} x the usual" if not 1 / UNUSUAL <= ratio <= UNUSUAL else ", as usual"
    limits = None if seen.range_v is None else (-seen.range_v, seen.range_v)
    return Value(name, f"{mean:.5f} V", scatter, farthest, limits)


def _tilt(read: Mapping[str, float], axis: str) -> float | None:
    """The table's tilt, as soon as the level was read both ways round."""
    both = [read.get(f"level-{side}-{axis}") for side in ("front", "back")]
    return None if both[0] is None or both[1] is None else reversal(both[0], both[1])[0]
