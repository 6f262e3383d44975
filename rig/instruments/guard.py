"""The guard: checks during every wait of a run. Interlocks and alarms are checked often, the oven seldom.

All waits of drivers and procedures use the clock, so a clock that checks during its sleeps covers all of them. The end
of a sleep does not move: the checks take no time of the run. A failed check raises its error out of the wait, and the
run ends as after any failure of an instrument.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from drivers.clock import Clock, Wire

WATCH_S = 0.04  # interval of interlocks and alarms: less than half of the time that a stop may take
NOW_AND_THEN_S = 10.0  # interval of temperatures
SHORTEST_S = 0.01  # a shorter sleep may be a part of an exchange


@dataclass(frozen=True)
class Look:
    """A check at intervals of `every_s`, in sleeps that still last `takes_s`. `look` raises the error."""

    look: Callable[[], object]
    every_s: float = WATCH_S
    takes_s: float = 0.0

    def next_s(self, now_s: float) -> float:
        """The next time for it: a multiple of the interval, so that a resumed run checks at the same times."""
        return (math.floor(now_s / self.every_s + 1e-6) + 1) * self.every_s


class GuardedClock:
    """A clock that runs the checks during its sleeps, inside `guarded`."""

    def __init__(self, inner: Clock) -> None:
        self.inner = inner
        self._looks: Sequence[Look] = ()

    def now(self) -> float:
        return self.inner.now()

    def wait_readable(self, wire: Wire, timeout_s: float) -> bool:
        return self.inner.wait_readable(wire, timeout_s)

    def sleep(self, seconds: float) -> None:
        """Wait `seconds`. Raises the error of a failed check."""
        deadline = self.inner.now() + seconds
        while seconds >= SHORTEST_S and (due := self._due(deadline)):
            self.inner.sleep(due[0] - self.inner.now())
            self._take(due[1])
        self.inner.sleep(deadline - self.inner.now())

    @contextmanager
    def guarded(self, checks: Sequence[Look]) -> Iterator[None]:
        """Run the checks in every sleep inside the context."""
        self._looks = checks
        try:
            yield
        finally:
            self._looks = ()

    def _due(self, deadline: float) -> tuple[float, list[Look]] | None:
        """The next time of a check in a sleep until `deadline`, and its checks; None if there is no time for one."""
        now_s = self.inner.now()
        times = [(look.next_s(now_s), look) for look in self._looks]
        fitting = [(due_s, look) for due_s, look in times if due_s + look.takes_s < deadline]
        if not fitting:
            return None
        first_s = min(due_s for due_s, _ in fitting)
        return first_s, [look for due_s, look in fitting if due_s == first_s]

    def _take(self, due: Sequence[Look]) -> None:
        """Run the checks. During a check, and after a failed one, there are no further checks."""
        checks, self._looks = self._looks, ()
        for check in due:
            check.look()
        self._looks = checks
