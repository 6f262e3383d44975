"""A dry run of a procedure that goes by what it measures: on a simulated copy of the bench, every step counted.

Nothing real is touched and nothing is kept: all instruments are twins, in the world that the bench file describes.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from inspect import isgenerator
from typing import Any

from procedures.questions import Dial, Question
from procedures.session import Dwell, Pose, Samples, Session
from rig.bench import SIMULATED, Bench
from rig.connected.instruments import Rig, absent, connected
from rig.connected.technician import answer
from rig.planning.planned import Held, Ledger, PlanHost
from rig.record.measured import of_sensor
from rig.record.values import Kept


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
