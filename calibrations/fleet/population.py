"""What a fleet turned out to be: batches with what they miss, rigs with their errors, sensors with their verdicts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from calibrations.fleet.batch import BatchEffect
from calibrations.fleet.rigs import RigError

BESIDE, IN_FULL = "beside its batch", "in full"


@dataclass(frozen=True)
class SensorVerdict:
    """One sensor: `effects` that the first model misses on it, those of its batch and its own; how it was judged.

    `fault`: why it could not be read or fitted. `rivals` of an effect cannot be told from it.
    """

    sensor: str
    batch: str
    rig: str
    data: str
    verdict: str
    effects: tuple[str, ...] = ()
    own: tuple[str, ...] = ()
    excess: float | None = None
    judged: str = BESIDE
    rivals: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    remark: str | None = None

    @property
    def needs_a_person(self) -> bool:
        """Whether it is unlike its siblings or could not be judged; what a whole batch misses is no sensor's matter."""
        return self.verdict in ("failed", "unexplained") or bool(self.own or self.remark)


@dataclass(frozen=True)
class BatchVerdict:
    """One batch: the effects that its sensors share, in the order added, and of how many sensors the rest is."""

    batch: str
    sensors: int
    effects: tuple[BatchEffect, ...]
    shares: Mapping[str, float]  # effect -> share of the batch's sensors that have it, as a batch or by themselves


@dataclass(frozen=True)
class Population:
    """The whole fleet. `unconnected`: groups of rigs that no batch connects, and whose errors cannot be compared."""

    sensors: tuple[SensorVerdict, ...]
    batches: tuple[BatchVerdict, ...]
    rigs: tuple[RigError, ...]
    unconnected: tuple[tuple[str, ...], ...]

    @property
    def verdicts(self) -> Counter[str]:
        """How many sensors have each verdict."""
        return Counter(each.verdict for each in self.sensors)


def batch_verdict(batch: str, effects: tuple[BatchEffect, ...], sensors: tuple[SensorVerdict, ...]) -> BatchVerdict:
    """The summary of a batch from its sensors'."""
    judged = [each for each in sensors if each.verdict != "failed"]
    counts = Counter(name for each in judged for name in each.effects)
    shares = {name: count / len(judged) for name, count in counts.most_common()}
    return BatchVerdict(batch, len(sensors), effects, shares)
