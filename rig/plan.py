"""A dry run: the procedure itself on instruments that only count what they are told. Nothing is touched.

Each move, the limits that it stays within, how long all of it takes, the room that it needs on the disk. A procedure
that goes by what it measures is rehearsed on twins: its plan is that of one simulated run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from procedures.catalogue import Procedure
from procedures.questions import Question
from procedures.session import Dwell, Pose, Reading, Samples, Session
from rig.bench import ROLES, Bench
from rig.instruments import absent
from rig.planned import (
    Ledger,
    PlannedAdc,
    PlannedLevel,
    PlannedOven,
    PlannedPositioner,
    PlannedStage,
    Step,
    planned_answer,
)
from rig.rehearsal import rehearsing

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
    """All that a procedure would do. `reach`: for each stage (lowest, highest) angle and its limits, in deg."""

    procedure: str
    settings: Mapping[str, Any]
    steps: tuple[Step, ...]
    reach: Mapping[str, tuple[tuple[float, float], tuple[float, float]]]
    questions: tuple[str, ...]
    poses: int
    duration_s: float
    bytes: int


@dataclass
class PlanHost:
    """The session's host that keeps nothing."""

    ledger: Ledger

    def kept(self) -> Sequence[Pose]:
        return ()

    def expect(self, missing: int) -> None:
        """A plan has no progress."""

    def measured(self) -> Sequence[Dwell]:
        return ()

    def readings(self) -> Sequence[Reading]:
        return ()

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None:  # noqa: ARG002
        self.ledger.poses += 1

    def keep_readings(self, *readings: Reading) -> None:
        """A plan reads nothing."""

    def ask(self, question: Question) -> str:
        self.ledger.questions.append(f"{question.name}: {question.text}")
        return planned_answer(question)

    def doing(self, text: str) -> None:
        """Its steps say what it does."""


def plan(bench: Bench, procedure: Procedure, settings: Mapping[str, Any]) -> Plan:
    """What `procedure` would do on `bench`. Raises what the run would: LimitError, SettingError, ProcedureError."""
    ledger = Ledger()
    parts = _parts(bench, ledger)
    dry = rehearsing if procedure.adaptive else _counting
    with dry(bench, parts, ledger) as session:
        session.reference()
        procedure.function(session, **settings)
    stages = {role: part for role, part in parts.items() if isinstance(part, PlannedStage)}
    return Plan(
        procedure=procedure.name,
        settings=settings,
        steps=tuple(ledger.steps),
        reach={role: (stage.reach, stage.limits) for role, stage in stages.items()},
        questions=tuple(ledger.questions),
        poses=ledger.poses,
        duration_s=ledger.now_s,
        bytes=round(ledger.samples * BYTES_PER_SAMPLE + ledger.poses * BYTES_PER_POSE),
    )


@contextmanager
def _counting(bench: Bench, parts: Mapping[str, Any], ledger: Ledger) -> Iterator[Session]:
    """A session on instruments that only count."""
    limits = replace(bench.limits, temperature_c=(-math.inf, math.inf))  # nobody knows it yet
    yield Session(**parts, clock=ledger, host=PlanHost(ledger), limits=limits)


def _parts(bench: Bench, ledger: Ledger) -> dict[str, Any]:
    """The planned instruments by role, with the settings of the real ones."""
    made: dict[str, Any] = {role: absent(role) for role in ROLES}
    for role, instrument in bench.instruments.items():
        made[role] = PLANNED[role](role, instrument.typed_settings(), ledger)
    return made
