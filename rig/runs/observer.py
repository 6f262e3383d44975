"""Observers of a run, and the view of the run that they show: present step, progress, live values and limits.

The guided terminal and the workbench show the same view.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import numpy as np

from calibrations.analyses.forecast import Forecast
from calibrations.text import duration, in_milli
from procedures.instruments import output_channel
from procedures.level_check import reversal
from procedures.questions import Question
from procedures.session import Guidance, Limits, Reading
from rig.bench import Bench
from rig.planning.plan import Plan
from rig.record import Kept, Run
from rig.runs.progress import Progress, RunningEstimates
from rig.runs.soak_forecast import outlook, present, soak_forecaster

UNUSUAL = 2.0  # ratio to the usual scatter, up or down, above which it is shown
REMEMBERED = 200  # dwells of a kind for the usual scatter
NEAR = 0.1  # of the span: distance from a limit below which a value is marked


@dataclass(frozen=True)
class RunView:
    """The view of a run at one moment.

    `usual`: usual scatter of dwells of this kind, by channel. `tilt`: readings of the level by name, deg. `foreseen`:
    forecast of bias and scale factor in a soak. `so_far`: estimates from the poses so far, in other runs. `range`:
    range of the converter, or of the digital sensor. `simulated`: the rig's time is simulated. `guidance`: what a
    person with the sensor in the hand does next.
    """

    title: str
    limits: Limits
    range: float | None
    simulated: bool
    unit_of: Callable[[str], str]  # of a channel
    now: str = "connecting"
    progress: Progress = field(default_factory=Progress)
    kept: Kept | None = None
    usual: Mapping[str, float] = field(default_factory=dict)
    tilt: Mapping[str, float] = field(default_factory=dict)
    foreseen: Mapping[str, Forecast] = field(default_factory=dict)
    so_far: Mapping[str, str] = field(default_factory=dict)
    guidance: Guidance | None = None

    @property
    def count(self) -> str:
        """The number of recorded poses and of all poses."""
        return f"{self.progress.done}/{self.progress.total} poses" if self.progress.total else ""

    def left(self, now_s: float) -> str:
        """Remaining time at `now_s` of the wall clock: from the pace so far, before that from the plan."""
        if (left_s := self.progress.left_s(now_s)) is not None:
            return f"{duration(left_s)} left"
        planned_s = self.progress.planned_left_s()
        if planned_s is None:
            return ""
        return f"{duration(planned_s)} {'of simulated time ' if self.simulated else ''}left by the plan"


@dataclass(frozen=True)
class Value:
    """A live value as text, with the `reading` for the comparison with its limits."""

    name: str
    shown: str
    remark: str = ""
    reading: float = 0.0
    limits: tuple[float, float] | None = None

    @property
    def near(self) -> str:
        """A remark if it is near or beyond a limit, else an empty text."""
        return nearness(self.reading, *self.limits) if self.limits else ""


class RunViewer:
    """Keeps the view of a run up to date with the events of the run."""

    def __init__(self, title: str, bench: Bench) -> None:
        adc = bench.instruments.get("adc")
        settings = adc.typed_settings() if adc else None
        end = getattr(settings, "range_v", None) or getattr(settings, "range", None)
        self.view = RunView(title, bench.limits, end, bench.simulated, bench.unit_of)
        self._soak, self._so_far = soak_forecaster(title), RunningEstimates()
        self._scatter: dict[tuple[str, str], deque[float]] = defaultdict(lambda: deque(maxlen=REMEMBERED))

    def planned(self, plan: Plan) -> None:
        """The plan of the run."""
        progress = replace(self.view.progress, at_s=tuple(held.start_s for held in plan.held), end_s=plan.duration_s)
        self.view = replace(self.view, progress=progress)

    def begun(self, title: str, run: str = "") -> None:
        """The run begins or continues; the title may be its id."""
        if self._soak:
            self._soak.begun(run or title)
        else:
            self._so_far.begun(run or title)
        self.view = replace(self.view, title=title, progress=self.view.progress.begin(time.monotonic()))

    def doing(self, text: str) -> None:
        self.view = replace(self.view, now=text)

    def guide(self, guidance: Guidance) -> None:
        """What a person with the sensor in the hand does next."""
        self.view = replace(self.view, now=guidance.text, guidance=guidance)

    def expect(self, total: int, done: int) -> None:
        self.view = replace(self.view, progress=self.view.progress.expect(total, done))

    def kept(self, kept: Kept) -> None:
        """Update the values with a new pose, and the usual scatter with the poses before it."""
        kind = kept.pose.path.partition(" ")[0]
        usual = {}
        for name, std in kept.dwell.stds.items():
            before_it = self._scatter[name, kind]
            if before_it:
                usual[name] = statistics.median(before_it)
            before_it.append(std)
        foreseen = (self._soak.kept(kept) if self._soak else {}) or self.view.foreseen
        progress, so_far = self.view.progress.step(time.monotonic()), self._so_far.kept(kept)
        self.view = replace(self.view, kept=kept, usual=usual, foreseen=foreseen, so_far=so_far, progress=progress)

    def read(self, reading: Reading) -> None:
        self.view = replace(self.view, tilt={**self.view.tilt, reading.name: reading.value})


def nearness(value: float, low: float, high: float) -> str:
    """ "" | near its limit | beyond its limit"""
    inside = min(value - low, high - value)
    if not inside >= 0:  # NaN is beyond as well
        return "beyond its limit"
    return "near its limit" if inside < NEAR * (high - low) else ""


def values(view: RunView) -> Iterator[Value]:
    """The live values: temperature, tilt, and each channel."""
    kept = view.kept
    if kept is not None and kept.temperature_c is not None:
        yield Value("temperature", f"{kept.temperature_c:.1f} C", "", kept.temperature_c, view.limits.temperature_c)
    if (limit := view.limits.level_deg) is not None:
        for axis in "xy":
            if (tilt_deg := _tilt(view.tilt, axis)) is not None:
                yield Value(f"level {axis}", f"{tilt_deg:.3f} deg", "", tilt_deg, (-limit, limit))
    if kept is not None:
        dwell, volts = kept.dwell, kept.samples.volts
        for name, column in zip(kept.samples.channels, volts.T, strict=True):
            farthest = float(column[np.argmax(np.abs(column))])
            yield _channel(name, dwell.means[name], dwell.stds[name], farthest, view)
    for name, each in view.foreseen.items():
        unit = view.unit_of(output_channel("x", kept.samples.channels) or "") if kept is not None else "V"
        yield Value(name, present(name, each, unit), outlook(name, each, unit))
    for name, shown in view.so_far.items():
        yield Value(name, shown, "from the poses so far")


def _channel(name: str, mean: float, std: float, farthest: float, view: RunView) -> Value:
    """A channel. Its largest sample is compared with the range."""
    unit = view.unit_of(name)
    factor, small = in_milli(unit)
    scatter = f"rms {factor * std:.3f} {small}"
    if usual := view.usual.get(name):
        ratio = std / usual
        scatter += f", {ratio:.2g} times the usual value" if not 1 / UNUSUAL <= ratio <= UNUSUAL else ", as usual"
    limits = None if view.range is None else (-view.range, view.range)
    return Value(name, f"{mean:.5f} {unit}", scatter, farthest, limits)


def _tilt(read: Mapping[str, float], axis: str) -> float | None:
    """The tilt of the table, if both readings of the level are there."""
    front, back = (read.get(f"level-{side}-{axis}") for side in ("front", "back"))
    return None if front is None or back is None else reversal(front, back)[0]


Decision = Literal["resume", "repeat", "end"]


class Observer(Protocol):
    """The observer of a run: a terminal, a page, a test."""

    def planned(self, plan: Plan) -> None:
        """The plan of a new run, before it begins. Raises Declined if a person does not want it."""

    def begun(self, run: str) -> None: ...
    def doing(self, text: str) -> None: ...
    def guide(self, guidance: Guidance) -> None:
        """What a person with the sensor in the hand does next; a sound marks the position that was taken."""

    def expect(self, total: int, done: int) -> None: ...
    def kept(self, kept: Kept) -> None: ...
    def read(self, reading: Reading) -> None: ...

    def ask(self, question: Question, instead: str | None) -> str:
        """The checked answer of a person, or `instead` if nobody is there. Raises NoAnswer without any answer."""

    def interrupted(self, outcome: Outcome) -> Decision:
        """The run is interrupted and the rig is at rest: resume the run, repeat its last pose first, or end it."""


@dataclass(frozen=True)
class Outcome:
    """The end of a run: complete, stopped or failed. `error`: why it is not complete. `moving`: instruments that did
    not stop.
    """

    run: Run
    error: Exception | None = None
    moving: tuple[str, ...] = ()
