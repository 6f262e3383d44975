"""What is looked at while a run waits: interlocks and alarms at once, the oven now and then.

All waits of drivers and procedures are the clock's, so a clock that looks about while it sleeps leaves none out. The
end of a sleep stays where it was: looking takes none of the run's time. What is found is raised out of the wait, and
ends the run as any failure of an instrument does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from drivers.clock import Clock, Wire

AT_ONCE_S = 0.04  # from one look at interlocks and alarms to the next: less than half of what a stop may take
NOW_AND_THEN_S = 10.0  # for what is as slow as heat
SHORTEST_S = 0.01  # a sleep that is shorter may be a part of an exchange


@dataclass(frozen=True)
class Look:
    """Something to be looked at every `every_s`, in sleeps that have `takes_s` left; it raises what it finds."""

    look: Callable[[], object]
    every_s: float = AT_ONCE_S
    takes_s: float = 0.0

    def next_s(self, now_s: float) -> float:
        """The next time for it: whole intervals of the clock, so that a run that goes on looks as it would have."""
        return (math.floor(now_s / self.every_s + 1e-6) + 1) * self.every_s


class GuardedClock:
    """A clock whose sleeps look about, inside `guarded`."""

    def __init__(self, inner: Clock) -> None:
        self.inner = inner
        self._looks: Sequence[Look] = ()

    def now(self) -> float:
        return self.inner.now()

    def wait_readable(self, wire: Wire, timeout_s: float) -> bool:
        return self.inner.wait_readable(wire, timeout_s)

    def sleep(self, seconds: float) -> None:
        """Wait so long; raises what a look finds."""
        deadline = self.inner.now() + seconds
        while seconds >= SHORTEST_S and (due := self._due(deadline)):
            self.inner.sleep(due[0] - self.inner.now())
            self._take(due[1])
        self.inner.sleep(deadline - self.inner.now())

    @contextmanager
    def guarded(self, looks: Sequence[Look]) -> Iterator[None]:
        """Look about in every sleep inside."""
        self._looks = looks
        try:
            yield
        finally:
            self._looks = ()

    def _due(self, deadline: float) -> tuple[float, list[Look]] | None:
        """When to look next in a sleep until `deadline`, and at what; None where there is no time for it."""
        now_s = self.inner.now()
        times = [(look.next_s(now_s), look) for look in self._looks]
        fitting = [(due_s, look) for due_s, look in times if due_s + look.takes_s < deadline]
        if not fitting:
            return None
        first_s = min(due_s for due_s, _ in fitting)
        return first_s, [look for due_s, look in fitting if due_s == first_s]

    def _take(self, due: Sequence[Look]) -> None:
        """A look that waits does not look about itself; nor does anybody once something was found: it is put right."""
        looks, self._looks = self._looks, ()
        for each in due:
            each.look()
        self._looks = looks
