"""A dry run: the procedure itself on instruments that only count what they are told. Nothing is touched.

Each move, the limits that it stays within, how long all of it takes, the room that it needs on the disk. A procedure
that goes by what it measures is rehearsed on twins: its plan is that of one simulated run.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from inspect import isgenerator
from itertools import groupby
from typing import Any

from calibrations.errors import DataError
from calibrations.geometry.error_table import ErrorTable
from procedures.catalogue import Procedure
from procedures.questions import Dial, Question
from procedures.session import Dwell, Pose, Samples, Session
from rig.bench import ROLES, SIMULATED, TURNING, Bench
from rig.errors import BenchError
from rig.instruments.instruments import Rig, absent, connected
from rig.instruments.person import answer
from rig.planning.planned import (
    Held,
    Ledger,
    PlanHost,
    PlannedAdc,
    PlannedLevel,
    PlannedOven,
    PlannedPositioner,
    PlannedStage,
    Step,
)
from rig.record.measured import of_sensor
from rig.record.values import Kept

# A dry run of a procedure that goes by what it measures: on a simulated copy of the bench, every step counted.
#
# Nothing real is touched and nothing is kept: all instruments are twins, in the world that the bench file describes.


class Counted:
    """Does what it is told with `twin`, after `planned` has counted it, or refused it."""

    def __init__(self, planned: Any, twin: Any) -> None:
        self._planned, self._twin = planned, twin

    def __getattr__(self, what: str) -> Any:
        count, act = getattr(self._planned, what), getattr(self._twin, what)

        def both(*arguments: Any, **named: Any) -> Any:
            counted = count(*arguments, **named)
            if isgenerator(counted):
                deque(counted, maxlen=0)  # to its end
            return act(*arguments, **named)

        return both


@dataclass
class RehearsalHost(PlanHost):
    """A plan's host that remembers what the twins of `rig` measure, for as long as the rehearsal lasts."""

    rig: Rig
    dwells: list[Dwell] = field(default_factory=list)

    def kept(self) -> Sequence[Pose]:
        return [dwell.pose for dwell in self.dwells]

    def measured(self) -> Sequence[Dwell]:
        return self.dwells

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None:
        self.ledger.held.append(Held(self.ledger.now_s, pose))  # the twins' clock shows another time
        kept = Kept(pose, samples, samples.start_s, temperature_c)
        self.dwells.append(of_sensor(kept, self.rig.bench.first_sensor).dwell)

    def ask(self, question: Question) -> str:
        done = answer(question, self.rig)
        if isinstance(question, Dial) and done is not None:  # the planned stage has counted the move
            return done
        planned = super().ask(question)
        return done or planned


@contextmanager
def rehearsing(bench: Bench, planned: Mapping[str, Any], ledger: Ledger) -> Iterator[Session]:
    """A session on the twins of `bench`, in which `planned` instruments count along.

    The limits of the world are not the bench's: the simulated table may stand worse than the real one.
    """
    with connected(_simulated(bench)) as rig:
        parts: dict[str, Any] = {role: absent(role) for role in planned}
        parts |= {role: Counted(planned[role], driver) for role, driver in rig.drivers.items()}
        level_deg = None if bench.limits.level_deg is None else math.inf
        limits = replace(bench.limits, temperature_c=(-math.inf, math.inf), level_deg=level_deg)
        clock: Any = Counted(ledger, rig.clock)
        host = RehearsalHost(ledger, rig)
        yield replace(rig.session(host), **parts, clock=clock, limits=limits)


def _simulated(bench: Bench) -> Bench:
    """The same bench with a sound twin in every role."""
    twins = {
        role: part.model_copy(update={"url": SIMULATED, "stream_url": None, "faults": ()})
        for role, part in bench.instruments.items()
    }
    return bench.model_copy(update={"instruments": twins})


BYTES_PER_SAMPLE = 0.4  # in the record, measured on a sweep; an estimate for other noise
BYTES_PER_POSE = 512  # the rest of a pose in the record
PLANNED = {
    "alpha": PlannedStage,
    "beta": PlannedStage,
    "adc": PlannedAdc,
    "oven": PlannedOven,
    "level": PlannedLevel,
    "positioner": PlannedPositioner,
}


@dataclass(frozen=True)
class Plan:
    """All that a procedure would do: `steps`, and the poses that it keeps, both in order.

    `reach`: for each stage (lowest, highest) angle and its limits, in deg.
    """

    procedure: str
    settings: Mapping[str, Any]
    steps: tuple[Step, ...]
    reach: Mapping[str, tuple[tuple[float, float], tuple[float, float]]]
    asked: tuple[Question, ...]
    held: tuple[Held, ...]
    duration_s: float
    bytes: int

    @property
    def poses(self) -> int:
        """How many are kept."""
        return len(self.held)

    @property
    def questions(self) -> tuple[str, ...]:
        """What a person is asked, each with its name."""
        return tuple(f"{question.name}: {question.text}" for question in self.asked)


def plan(bench: Bench, procedure: Procedure, settings: Mapping[str, Any]) -> Plan:
    """What `procedure` would do on `bench`. Raises what the run would: LimitError, SettingError, ProcedureError.

    Raises BenchError for a pose at which a stage's error table has nothing.
    """
    ledger = Ledger()
    parts = _parts(bench, ledger)
    dry = rehearsing if procedure.adaptive else _counting
    with dry(bench, parts, ledger) as session:
        session.reference()
        procedure.function(session, **settings)
    _require_known_angles(bench, [held.pose for held in ledger.held])
    stages = {role: part for role, part in parts.items() if isinstance(part, PlannedStage)}
    return Plan(
        procedure=procedure.name,
        settings=settings,
        steps=tuple(ledger.steps),
        reach={role: (stage.reach, stage.limits) for role, stage in stages.items()},
        asked=tuple(ledger.asked),
        held=tuple(ledger.held),
        duration_s=ledger.now_s,
        bytes=round(ledger.samples * BYTES_PER_SAMPLE + len(ledger.held) * BYTES_PER_POSE),
    )


@contextmanager
def _counting(bench: Bench, parts: Mapping[str, Any], ledger: Ledger) -> Iterator[Session]:
    """A session on instruments that only count."""
    limits = replace(bench.limits, temperature_c=(-math.inf, math.inf))  # nobody knows it yet
    yield Session(**parts, clock=ledger, host=PlanHost(ledger), limits=limits)


def _require_known_angles(bench: Bench, poses: Sequence[Pose]) -> None:
    """Better told now than when the run is evaluated."""
    for role in TURNING:
        part = bench.instruments.get(role)
        if part is None or not isinstance(part.error_table, tuple):
            continue
        try:
            ErrorTable(part.error_table).true_deg([getattr(pose, f"{role}_deg") for pose in poses])
        except DataError as error:
            raise BenchError(f"{role}: {error}") from None


def _parts(bench: Bench, ledger: Ledger) -> dict[str, Any]:
    """The planned instruments by role, with the settings of the real ones."""
    made: dict[str, Any] = {role: absent(role) for role in ROLES}
    for role, instrument in bench.instruments.items():
        made[role] = PLANNED[role](role, instrument.typed_settings(), ledger)
    return made


# A plan in a few lines: poses of one path are a stretch, and what is done besides moving and recording is named.

PLAIN = re.compile(
    r"(alpha|beta) (from|seeks|turns|brakes)|adc records|wait |level is read"
)  # steps that go without saying
COUNTER = re.compile(r"\s*(\d+)$")  # of a path: "still 3" is the third of one stretch
LONG_WAIT_S = 30.0


@dataclass(frozen=True)
class Stretch:
    """Poses in a row, the first dwell of which begins at `start_s`; `also` is what else is done on the way there."""

    start_s: float
    poses: tuple[Pose, ...]
    also: tuple[str, ...]

    @property
    def words(self) -> str:
        """In one line."""
        number = f"{len(self.poses)} pose{'s' * (len(self.poses) > 1)}"
        alpha, beta = _range([p.alpha_deg for p in self.poses]), _range([p.beta_deg for p in self.poses])
        return "  ".join([f"alpha {alpha}, beta {beta} deg: {number}", *_named(self.poses)])


def stretches(plan: Plan) -> list[Stretch]:
    """All poses of a plan, in order."""
    found, before_s = [], 0.0
    for _, group in groupby(plan.held, lambda held: _kind(held.pose)):
        held = list(group)
        also = tuple(_besides(plan, before_s, held[-1].start_s))
        found.append(Stretch(held[0].start_s, tuple(each.pose for each in held), also))
        before_s = held[-1].start_s
    return found


def _kind(pose: Pose) -> tuple[str, float, int]:
    return COUNTER.sub("", pose.path), pose.mount_deg, pose.flip


def _besides(plan: Plan, from_s: float, to_s: float) -> Iterator[str]:
    """What is done between two moments that is no plain step, each once, and how long is waited where it is long."""
    mine = [step for step in plan.steps if from_s <= step.start_s < to_s]
    yield from dict.fromkeys(step.what for step in mine if not PLAIN.match(step.what))
    waited_s = sum(step.duration_s for step in mine if step.what.startswith("wait ") and step.duration_s >= LONG_WAIT_S)
    if waited_s:
        yield f"waiting for {waited_s:g} s"


def _range(angles_deg: Sequence[float]) -> str:
    first, last = angles_deg[0], angles_deg[-1]
    low, high = min(angles_deg), max(angles_deg)
    if low == high:
        return f"{low:g}"
    return f"{first:g} to {last:g}" if {first, last} == {low, high} else f"{low:g} .. {high:g}"


def _named(poses: Sequence[Pose]) -> Iterator[str]:
    """The path, and how the sensor is mounted where that is not as usual."""
    numbers = [match[1] for pose in (poses[0], poses[-1]) if (match := COUNTER.search(pose.path))]
    path = COUNTER.sub("", poses[0].path)
    counted = [*dict.fromkeys(numbers)]
    if path:
        yield f"{path} {' to '.join(counted)}".rstrip()
    if rates := sorted({abs(pose.rate_deg_s) for pose in poses} - {0.0}):
        yield f"at {', '.join(f'{rate:g}' for rate in rates)} deg/s both ways"
    if poses[0].mount_deg or poses[0].flip:
        yield f"mounted face {'down' if poses[0].flip else 'up'}, turned by {poses[0].mount_deg:g} deg"
