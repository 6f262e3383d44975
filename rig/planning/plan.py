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

from calibrations.error_table import ErrorTable
from calibrations.errors import DataError
from procedures.catalogue import Procedure
from procedures.questions import Question
from procedures.session import Pose, Session
from rig.bench import ROLES, TURNING, Bench
from rig.connected.instruments import absent
from rig.errors import BenchError
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
from rig.planning.rehearsal import rehearsing

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
