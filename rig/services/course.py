"""Dwells over time in a bounded number of parts: a night of samples as a picture that does not grow.

Each part holds the mean, the least and the greatest of its dwells. When there are MOST of them, neighbours are joined.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from procedures.session import Dwell

MOST = 1024  # parts: more than a screen has columns for


@dataclass
class Part:
    """Some dwells that follow each other: `n` of them, the sums of what they are the mean of, and extremes by name."""

    n: int = 0
    t_s: float = 0.0
    sums: dict[str, float] = field(default_factory=dict)
    low: dict[str, float] = field(default_factory=dict)
    high: dict[str, float] = field(default_factory=dict)

    def take(self, t_s: float, values: dict[str, float]) -> None:
        """One dwell more."""
        self.n, self.t_s = self.n + 1, self.t_s + t_s
        for name, value in values.items():
            self.sums[name] = self.sums.get(name, 0.0) + value
            self.low[name] = min(self.low.get(name, value), value)
            self.high[name] = max(self.high.get(name, value), value)

    def join(self, other: Part) -> None:
        """All dwells of another part more."""
        self.n, self.t_s = self.n + other.n, self.t_s + other.t_s
        for name, value in other.sums.items():
            self.sums[name] = self.sums.get(name, 0.0) + value
            self.low[name] = min(self.low.get(name, other.low[name]), other.low[name])
            self.high[name] = max(self.high.get(name, other.high[name]), other.high[name])


@dataclass
class Course:
    """The dwells of one kind of pose; `names` are channels, their noise as `rms vx`, and the temperature."""

    parts: list[Part] = field(default_factory=list)
    each: int = 1  # dwells in a part that is full

    def add(self, dwell: Dwell) -> None:
        """One dwell more."""
        values = dict(dwell.means) | {f"rms {name}": std for name, std in dwell.stds.items()}
        if dwell.temperature_c is not None:
            values["temperature"] = dwell.temperature_c
        if not self.parts or self.parts[-1].n >= self.each:
            if len(self.parts) == MOST:
                self._join()
            self.parts.append(Part())
        self.parts[-1].take(dwell.t_s, values)

    def _join(self) -> None:
        for first, second in zip(self.parts[::2], self.parts[1::2], strict=True):
            first.join(second)
        self.parts, self.each = self.parts[::2], 2 * self.each

    @property
    def names(self) -> list[str]:
        """What was measured."""
        return list(self.parts[0].sums) if self.parts else []

    def line(self, name: str) -> tuple[list[float], list[float], list[float], list[float]]:
        """(time in s, mean, least, greatest) of each part that has it."""
        there = [part for part in self.parts if name in part.sums]
        times = [part.t_s / part.n for part in there]
        means = [part.sums[name] / part.n for part in there]
        return times, means, [part.low[name] for part in there], [part.high[name] for part in there]


def kind_of(dwell: Dwell) -> str:
    """Dwells of numbered paths belong together by name: `hold` of `hold 17`; those of a sweep are of one kind, ""."""
    head, _, number = dwell.pose.path.rpartition(" ")
    return head if number.isdigit() else ""
