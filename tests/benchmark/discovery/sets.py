"""Which sets make up each row of the table: (row, name, strength, seed), deterministic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from tests.benchmark.discovery.cases import STRENGTHS
from tests.benchmark.discovery.inseparable import INSEPARABLE
from tests.benchmark.discovery.mechanisms import MECHANISMS
from tests.benchmark.discovery.others import SAMPLED, WORLD, WORLD_OUTSIDE
from tests.benchmark.discovery.outside import OUTSIDE

ROWS = ("clean", "slow", "single", "unknown", "pair", "triple", "inseparable")


@dataclass(frozen=True)
class Case:
    """One set of one row."""

    row: str
    name: str
    strength: float
    seed: int

    @property
    def key(self) -> str:
        return f"{self.row} {self.name} {self.strength:g} {self.seed}"


def sets(row: str, count: int) -> Iterator[Case]:
    """`count` sets of a row, for single and unknown causes at each strength."""
    for k in range(count):
        if row == "clean":
            yield Case(row, ("clean/white", "clean/white", "world/clean", "sampled/clean")[k % 4], 0.0, 1000 + k)
        elif row == "slow":
            yield Case(row, "clean/slow", 0.0, 2000 + k)
        elif row in ("pair", "triple"):
            yield Case(row, row, STRENGTHS["medium"], 4000 + k)
        elif row == "inseparable":
            yield Case(row, f"inseparable/{list(INSEPARABLE)[k % len(INSEPARABLE)]}", STRENGTHS["medium"], 5000 + 5 * k)
        else:
            names = SINGLE if row == "single" else UNKNOWN
            for strength in STRENGTHS.values():
                yield Case(row, names[k % len(names)], strength, 3000 + 3 * k + k // len(names))


def _mixed(own: dict[str, object], *others: list[str]) -> list[str]:
    """Our own rigs' causes, with one of the other generators' after every second of them."""
    rest = [name for each in others for name in each]
    names = []
    for k, name in enumerate(own):
        names.append(f"own/{name}")
        if k % 2 and rest:
            names.append(rest.pop((k * 7) % len(rest)))
    return names + rest


SINGLE = _mixed(dict(MECHANISMS), [f"world/{name}" for name in WORLD], [f"sampled/{name}" for name in SAMPLED])
UNKNOWN = _mixed(dict(OUTSIDE), [f"world/{name}" for name in WORLD_OUTSIDE])
