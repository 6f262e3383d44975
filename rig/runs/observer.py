"""Observers of a run: their common base, and the view of the run that they show (step, progress, values, limits).

The guided terminal and the workbench show the same view.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from signal import Signals
from typing import Any, Literal, get_args

import numpy as np

from calibrations.text import duration, in_milli
from procedures.errors import NoAnswer
from procedures.level_check import reversal
from procedures.questions import Choice, Question
from procedures.session import Guidance, Limits, Reading
from rig.bench import Bench
from rig.planning.plan import Plan
from rig.record import KeptPose, Run
from rig.runs.estimates import Value, live_estimates
from rig.runs.signals import stop_source

UNUSUAL = 2.0  # ratio to the usual scatter, up or down, above which it is shown
SCATTER_DWELLS = 200  # dwells of a kind for the usual scatter

Decision = Literal["resume", "repeat", "end"]
NEXT_STEP = Choice("interrupted", "What should the run do next?", choices=get_args(Decision))


@dataclass(frozen=True)
class Outcome:
    """The end of a run: complete, stopped or failed. `error`: why it is not complete. `moving`: instruments that did
    not stop. `retried`: why the run could not continue, although a person chose this.
    """

    run: Run
    error: Exception | None = None
    moving: tuple[str, ...] = ()
    retried: bool = False


class Observer:
    """The observer of a run: a terminal, a page, a test. This one shows nothing and has no person to decide.

    `ignored_when_paused`: signals that do not end the question of `interrupted`. `place`: where a person follows the
    run, for its record.
    """

    ignored_when_paused: Collection[Signals] = ()
    place = ""

    def planned(self, plan: Plan) -> None:
        """The plan of a new run, before it begins. Raises Declined if a person does not want it."""

    def begun(self, run: str) -> None:
        """The run begins or continues."""

    def doing(self, text: str) -> None:
        """The present step, in words."""

    def guide(self, guidance: Guidance) -> None:
        """The next action of a person with the sensor in the hand; a sound marks a taken position."""

    def expect(self, total: int, recorded_poses: int) -> None:
        """The number of poses of the run, and how many of them are recorded."""

    def kept(self, recorded: KeptPose) -> None:
        """A pose is recorded."""

    def read(self, reading: Reading) -> None:
        """A reading is recorded."""

    def ask(self, question: Question, instead: str | None) -> str:
        """The checked answer of a person, or `instead` if nobody is there. Raises NoAnswer without any answer."""
        if instead is None:
            raise NoAnswer(
                f'the question "{question.text}" has no answer; write `{question.name}: ...` ({question.accepts}) '
                "into a file for --answers, or run in a terminal without --unattended"
            )
        return instead

    def interrupted(self, outcome: Outcome) -> Decision:  # noqa: ARG002
        """The run is interrupted and the rig is at rest: resume the run, repeat its last pose first, or end it."""
        return "end"

    def stop_source(self, signal_name: str) -> str:
        """Who stopped the run by this signal."""
        return stop_source(signal_name)


@dataclass(frozen=True)
class Progress:
    """Progress and remaining time of a run: at first from the plan, later from the pace of the run.

    `at_s`: time of each pose in the plan, s; empty without a plan. `end_s`: end of the plan. `total`: number of poses.
    `first`: poses that were recorded when this process began, at `began_s` of the wall clock. `done`: recorded poses;
    the last one was recorded at `kept_s`.
    """

    at_s: tuple[float, ...] = ()
    end_s: float = 0.0
    total: int = 0
    first: int = 0
    done: int = 0
    began_s: float = 0.0
    kept_s: float = 0.0

    def begin(self, now_s: float) -> Progress:
        """This process begins or continues the run."""
        return replace(self, total=0, first=0, done=0, began_s=now_s, kept_s=now_s)

    def expect(self, total: int, recorded_poses: int) -> Progress:
        """The number of poses of the procedure and of the record, for the whole run or for its next part."""
        first = recorded_poses if not self.total else self.first
        return replace(self, total=max(total, len(self.at_s)), first=first, done=recorded_poses)

    def step(self, now_s: float) -> Progress:
        """One more pose is recorded."""
        return replace(self, done=self.done + 1, kept_s=now_s)

    def planned_left_s(self) -> float | None:
        """Remaining time of the plan, s of the rig's time; None without a plan."""
        return self.end_s - self._work(self.done) if self.at_s else None

    def left_s(self, now_s: float) -> float | None:
        """Remaining time by the wall clock, s; None before the first pose."""
        work_done = self._work(self.done) - self._work(self.first)
        if work_done <= 0 or self.done == self.first:
            return None
        end = self.end_s if self.at_s else float(self.total)
        remaining_s = (end - self._work(self.done)) * (self.kept_s - self.began_s) / work_done
        return max(0.0, remaining_s - (now_s - self.kept_s))

    def _work(self, recorded_poses: int) -> float:
        """The work of `recorded_poses` poses: seconds of the plan, or poses without a plan."""
        if not self.at_s:
            return float(recorded_poses)
        return self.at_s[recorded_poses] if recorded_poses < len(self.at_s) else self.end_s


@dataclass(frozen=True)
class RunView:
    """The view of a run at one moment.

    `usual`: usual scatter of dwells of this kind, by channel. `tilt`: readings of the level by name, deg. `estimates`:
    those of the sensor so far. `range`: range of the converter, or of the digital sensor. `simulated`: the rig's time
    is simulated. `guidance`: the next step for a person with the sensor in the hand.
    """

    title: str
    limits: Limits
    range: float | None
    simulated: bool
    unit_of: Callable[[str], str]  # of a channel
    now: str = "connecting"
    progress: Progress = field(default_factory=Progress)
    kept: KeptPose | None = None
    usual: Mapping[str, float] = field(default_factory=dict)
    tilt: Mapping[str, float] = field(default_factory=dict)
    estimates: Sequence[Value] = ()
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
        return f"{duration(planned_s)} {'of simulated time ' if self.simulated else ''}left, as planned"


class RunViewer(Observer):
    """An observer that keeps the view of a run up to date."""

    def __init__(self, procedure: str, bench: Bench) -> None:
        adc = bench.instruments.get("adc")
        settings = adc.parse_settings() if adc else None
        end = getattr(settings, "range_v", None) or getattr(settings, "range", None)
        self._name = procedure
        self.view = RunView(procedure, bench.limits, end, bench.simulated, bench.unit_of)
        self._estimates = live_estimates(procedure)
        self._scatter: dict[tuple[str, str], deque[float]] = defaultdict(lambda: deque(maxlen=SCATTER_DWELLS))

    def changed(self) -> None:
        """Called after each change of the view during the run."""

    def planned(self, plan: Plan) -> None:
        progress = replace(self.view.progress, at_s=tuple(dwell.start_s for dwell in plan.held), end_s=plan.duration_s)
        self.view = replace(self.view, progress=progress)

    def begun(self, run: str) -> None:
        self._estimates.begun(run)
        progress = self.view.progress.begin(time.monotonic())
        self.view = replace(self.view, title=f"{self._name}  {run}", progress=progress)

    def doing(self, text: str) -> None:
        self._change(now=text)

    def guide(self, guidance: Guidance) -> None:
        self._change(now=guidance.text, guidance=guidance)

    def expect(self, total: int, recorded_poses: int) -> None:
        self._change(progress=self.view.progress.expect(total, recorded_poses))

    def kept(self, recorded: KeptPose) -> None:
        """Update the values with a new pose, and the usual scatter with the poses before it."""
        kind = recorded.pose.path.partition(" ")[0]
        usual = {}
        for name, std in recorded.dwell.stds.items():
            earlier = self._scatter[name, kind]
            if earlier:
                usual[name] = statistics.median(earlier)
            earlier.append(std)
        estimates = self._estimates.values(recorded) or self.view.estimates
        self._change(
            kept=recorded, usual=usual, estimates=estimates, progress=self.view.progress.step(time.monotonic())
        )

    def read(self, reading: Reading) -> None:
        self._change(tilt={**self.view.tilt, reading.name: reading.value})

    def _change(self, **values: Any) -> None:
        self.view = replace(self.view, **values)
        self.changed()


def values(view: RunView) -> Iterator[Value]:
    """The live values: temperature, tilt, and each channel."""
    recorded = view.kept
    if recorded is not None and recorded.temperature_c is not None:
        yield Value(
            "temperature", f"{recorded.temperature_c:.1f} C", "", recorded.temperature_c, view.limits.temperature_c
        )
    if (limit := view.limits.level_deg) is not None:
        for axis in "xy":
            if (tilt_deg := _tilt(view.tilt, axis)) is not None:
                yield Value(f"level {axis}", f"{tilt_deg:.3f} deg", "", tilt_deg, (-limit, limit))
    if recorded is not None:
        dwell, volts = recorded.dwell, recorded.samples.volts
        for name, column in zip(recorded.samples.channels, volts.T, strict=True):
            farthest = float(column[np.argmax(np.abs(column))])
            yield _channel(name, dwell.means[name], dwell.stds[name], farthest, view)
    yield from view.estimates


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


def _tilt(readings: Mapping[str, float], axis: str) -> float | None:
    """The tilt of the table, if both readings of the level are there."""
    front, reversed_reading = (readings.get(f"level-{side}-{axis}") for side in ("front", "back"))
    return None if front is None or reversed_reading is None else reversal(front, reversed_reading)[0]
