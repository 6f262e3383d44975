"""The plan of a procedure: the procedure runs on planned instruments, and nothing moves.

A plan has every move, the limits, the duration, and the size on the disk. A procedure that depends on its measurements
runs on simulated instruments: its plan is that of one simulated run.
"""

from __future__ import annotations

import math
import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from inspect import isgenerator
from itertools import groupby
from typing import Any

from calibrations.errors import DataError
from calibrations.geometry.error_table import ErrorTable
from drivers.recorder import Samples
from procedures.catalogue import Procedure
from procedures.questions import Dial, Question
from procedures.session import Dwell, Guidance, Pose, RecordedPose, Session
from rig.bench import ROLES, SIMULATED, TURNING, Bench
from rig.errors import BenchError
from rig.instruments.instruments import Rig, absent, connect_all
from rig.instruments.person import answer, follow
from rig.planning.planned import (
    Ledger,
    PlanHost,
    PlannedAdc,
    PlannedDwell,
    PlannedLevel,
    PlannedOven,
    PlannedPositioner,
    PlannedStage,
    Step,
)
from rig.record.measured import of_sensor
from rig.record.values import KeptPose

# The plan of a procedure that depends on its measurements: a run on a simulated copy of the bench, which records
# every step. Nothing real moves and nothing is stored; all instruments are simulated, in the world of the bench file.


class RecordedTwin:
    """Calls `planned`, which records or refuses a command, and then the simulated instrument `twin`."""

    def __init__(self, planned: Any, twin: Any) -> None:
        self._planned, self._twin = planned, twin

    def __getattr__(self, name: str) -> Any:
        count, act = getattr(self._planned, name), getattr(self._twin, name)
        if name == "only":
            return lambda *outputs: RecordedTwin(count(*outputs), act(*outputs))

        def plan_and_act(*arguments: Any, **keywords: Any) -> Any:
            planned = count(*arguments, **keywords)
            recorded = act(*arguments, **keywords)
            return _plan_and_record(planned, recorded) if isgenerator(planned) else recorded

        return plan_and_act


def _plan_and_record(planned: Iterator[Any], recorded: Generator[Any, None, None]) -> Generator[Any, None, None]:
    """The blocks of a twin's record, each of which is planned too. Closing it ends the record."""
    with closing(recorded):
        for _, block in zip(planned, recorded, strict=False):
            yield block


@dataclass
class RehearsalHost(PlanHost):
    """A planned host that stores the simulated measurements of `rig` during the rehearsal."""

    rig: Rig
    blocks: list[KeptPose] = field(default_factory=list)

    def kept(self) -> Sequence[Pose]:
        return [recorded.pose for recorded in self.blocks]

    def measured(self) -> Sequence[Dwell]:
        return [recorded.dwell for recorded in self.blocks]

    def recorded(self) -> Sequence[RecordedPose]:
        return self.blocks

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None:
        self.ledger.held.append(PlannedDwell(self.ledger.now_s, pose))  # the clock of the twins differs
        recorded = KeptPose(pose, samples, samples.start_s, temperature_c, number=len(self.blocks))
        self.blocks.append(of_sensor(recorded, self.rig.bench.first_sensor))

    def guide(self, guidance: Guidance) -> None:
        follow(guidance, self.rig)

    def ask(self, question: Question) -> str:
        reply = answer(question, self.rig)
        if isinstance(question, Dial) and reply is not None:  # the planned stage has recorded the move
            return reply
        planned = super().ask(question)
        return reply or planned


@contextmanager
def rehearse(bench: Bench, planned: Mapping[str, Any], ledger: Ledger) -> Iterator[Session]:
    """A session on simulated instruments of `bench`; `planned` instruments record every step.

    The limits of temperature and tilt do not apply: the simulated table may be less level than the real one.
    """
    with connect_all(_simulate_instruments(bench)) as rig:
        parts: dict[str, Any] = {role: absent(role) for role in planned}
        parts |= {role: RecordedTwin(planned[role], driver) for role, driver in rig.drivers.items()}
        level_deg = None if bench.limits.level_deg is None else math.inf
        limits = replace(bench.limits, temperature_c=(-math.inf, math.inf), level_deg=level_deg)
        clock: Any = RecordedTwin(ledger, rig.clock)
        host = RehearsalHost(ledger, rig)
        yield replace(rig.session(host), **parts, clock=clock, limits=limits)


def _simulate_instruments(bench: Bench) -> Bench:
    """The same bench with a simulated instrument without faults in every role."""
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
    """The steps and the recorded poses of a procedure, both in order.

    `reach`: for each stage (lowest, highest) angle and its limits, in deg.
    """

    procedure: str
    settings: Mapping[str, Any]
    steps: tuple[Step, ...]
    reach: Mapping[str, tuple[tuple[float, float], tuple[float, float]]]
    asked: tuple[Question, ...]
    held: tuple[PlannedDwell, ...]
    duration_s: float
    bytes: int

    @property
    def poses(self) -> int:
        """Number of recorded poses."""
        return len(self.held)

    def after(self, recorded_poses: int) -> Plan:
        """The rest of the plan after its first poses, with its duration and storage."""
        if not recorded_poses:
            return self
        remaining = self.held[recorded_poses:]
        begin_s = remaining[0].start_s if remaining else self.duration_s
        share = len(remaining) / self.poses if self.poses else 1.0
        return replace(self, held=remaining, duration_s=self.duration_s - begin_s, bytes=round(self.bytes * share))

    @property
    def questions(self) -> tuple[str, ...]:
        """The questions to a person with their names."""
        return tuple(f"{question.name}: {question.text}" for question in self.asked)


def plan(bench: Bench, procedure: Procedure, settings: Mapping[str, Any]) -> Plan:
    """The plan of `procedure` on `bench`. Raises LimitError, SettingError and ProcedureError, as the run does.

    Raises BenchError for a pose outside the error table of a stage.
    """
    ledger = Ledger()
    parts = _parts(bench, ledger)
    dry = rehearse if procedure.adaptive else _plan_session
    with dry(bench, parts, ledger) as session:
        session.reference()
        procedure.function(session, **settings)
    _require_known_angles(bench, [dwell.pose for dwell in ledger.held])
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
def _plan_session(bench: Bench, parts: Mapping[str, Any], ledger: Ledger) -> Iterator[Session]:
    """A session on planned instruments."""
    limits = replace(bench.limits, temperature_c=(-math.inf, math.inf))  # the temperature is not known yet
    yield Session(**parts, clock=ledger, host=PlanHost(ledger), limits=limits)


def _require_known_angles(bench: Bench, poses: Sequence[Pose]) -> None:
    """Raises BenchError for poses outside an error table, before the run."""
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
    parts: dict[str, Any] = {role: absent(role) for role in ROLES}
    for role, instrument in bench.instruments.items():
        parts[role] = PLANNED[role](role, instrument.parse_settings(), ledger)
    return parts


# A plan in a few lines: the poses of one path are a stretch; other steps than moves and recordings are listed.

PLAIN = re.compile(
    r"(alpha|beta) (from|seeks|turns|brakes)|adc records|wait |level is read"
)  # steps that are not listed
COUNTER = re.compile(r"\s*(\d+)$")  # of a path: "still 3" is the third pose of a stretch
WAY_ROUND = re.compile(r"\s*[AB][+-] to [AB][+-]$")  # of a path: the angles already say it
LONG_WAIT_S = 30.0


@dataclass(frozen=True)
class Stretch:
    """Consecutive poses, the first dwell of which begins at `start_s`; `also` lists other steps before them.

    `by_hand`: no stage gives them their angles.
    """

    start_s: float
    poses: tuple[Pose, ...]
    also: tuple[str, ...]
    by_hand: bool = False

    @property
    def words(self) -> str:
        """The stretch in one line."""
        number = f"{len(self.poses)} pose{'s' * (len(self.poses) > 1)}"
        if self.by_hand:
            return "  ".join([f"by hand: {number}", *_path_words(self.poses)])
        alpha, beta = _range([p.alpha_deg for p in self.poses]), _range([p.beta_deg for p in self.poses])
        return "  ".join([f"alpha {alpha}, beta {beta} deg: {number}", *_path_words(self.poses)])


def stretches(plan: Plan) -> list[Stretch]:
    """The stretches of a plan, in order."""
    parts, before_s = [], 0.0
    for _, group in groupby(plan.held, lambda dwells: _kind(dwells.pose)):
        dwells = list(group)
        other_steps = tuple(_other_steps(plan, before_s, dwells[-1].start_s))
        poses = tuple(dwell.pose for dwell in dwells)
        parts.append(Stretch(dwells[0].start_s, poses, other_steps, by_hand=not plan.reach))
        before_s = dwells[-1].start_s
    return parts


def _kind(pose: Pose) -> tuple[str, float, int]:
    return COUNTER.sub("", pose.path), pose.mount_deg, pose.flip


def turn_words(pose: Pose) -> str:
    """The path of a pose in words: inclination and direction of beta in place of the names of the turn's ends."""
    if not WAY_ROUND.search(pose.path):
        return pose.path
    turning = {1: ", beta rising", -1: ", beta falling"}.get(pose.direction, "")
    return f"{WAY_ROUND.sub('', pose.path)} alpha {pose.alpha_deg:g} deg{turning}".lstrip()


def _other_steps(plan: Plan, from_s: float, to_s: float) -> Iterator[str]:
    """Other steps between two times, each once, and long waits."""
    between_steps = [step for step in plan.steps if from_s <= step.start_s < to_s]
    yield from dict.fromkeys(step.what for step in between_steps if not PLAIN.match(step.what))
    waited_s = sum(
        step.duration_s for step in between_steps if step.what.startswith("wait ") and step.duration_s >= LONG_WAIT_S
    )
    if waited_s:
        yield f"waiting for {waited_s:g} s"


def _range(angles_deg: Sequence[float]) -> str:
    first, last = angles_deg[0], angles_deg[-1]
    low, high = min(angles_deg), max(angles_deg)
    if low == high:
        return f"{low:g}"
    return f"{first:g} to {last:g}" if {first, last} == {low, high} else f"between {low:g} and {high:g}"


def _path_words(poses: Sequence[Pose]) -> Iterator[str]:
    """The path, the rates, and an unusual mounting of the sensor."""
    numbers = [match[1] for pose in (poses[0], poses[-1]) if (match := COUNTER.search(pose.path))]
    path = WAY_ROUND.sub("", COUNTER.sub("", poses[0].path))
    distinct = [*dict.fromkeys(numbers)]
    if path:
        yield f"{path} {' to '.join(distinct)}".rstrip()
    if rates := sorted({abs(pose.rate_deg_s) for pose in poses} - {0.0}):
        yield f"at {', '.join(f'{rate:g}' for rate in rates)} deg/s in both directions"
    if poses[0].mount_deg or poses[0].flip:
        yield f"mounted face {'down' if poses[0].flip else 'up'}, rotated by {poses[0].mount_deg:g} deg"
