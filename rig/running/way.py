"""How far a run is, and how long it still takes: as planned at first, by its own pace as soon as it has one."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Way:
    """`at_s`: when in its plan each pose begins, s; empty where there is no plan. `end_s`: when the plan ends.

    Of `total` poses `first` were there when this process began, at `began_s` on the wall's clock; the last of those
    that are `done` was kept at `kept_s`.
    """

    at_s: tuple[float, ...] = ()
    end_s: float = 0.0
    total: int = 0
    first: int = 0
    done: int = 0
    began_s: float = 0.0
    kept_s: float = 0.0

    def begin(self, now_s: float) -> Way:
        """This process takes up the run."""
        return replace(self, total=0, first=0, done=0, began_s=now_s, kept_s=now_s)

    def expect(self, total: int, done: int) -> Way:
        """The procedure says how many poses it has, and the record how many it holds: once, or part by part."""
        first = done if not self.total else self.first
        return replace(self, total=max(total, len(self.at_s)), first=first, done=done)

    def step(self, now_s: float) -> Way:
        """One more is kept."""
        return replace(self, done=self.done + 1, kept_s=now_s)

    def planned_left_s(self) -> float | None:
        """What is left of the plan, in its own time; None without a plan."""
        return self.end_s - self._work(self.done) if self.at_s else None

    def left_s(self, now_s: float) -> float | None:
        """What is left by the wall's clock; None as long as there is no pace."""
        gone = self._work(self.done) - self._work(self.first)
        if gone <= 0 or self.done == self.first:
            return None
        end = self.end_s if self.at_s else float(self.total)
        left = (end - self._work(self.done)) * (self.kept_s - self.began_s) / gone
        return max(0.0, left - (now_s - self.kept_s))

    def _work(self, done: int) -> float:
        """How much is done with so many poses: planned seconds, or else poses."""
        if not self.at_s:
            return float(done)
        return self.at_s[done] if done < len(self.at_s) else self.end_s
