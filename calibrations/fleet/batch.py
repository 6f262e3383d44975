"""The missing effects of a batch: its sensors show them together, even if no sensor shows them alone.

Two tests of each effect, both with the sensors as replicates, so that neither leans on any one sensor's noise model:

    common   its sensors have the same value: Hotelling's T^2 of their scores against no effect. Scores are bounded (no
             sensor counts more than twice as much as the median one), so that one defect does not decide for a batch.
    own      each sensor has a value of its own: how many gain more by it than it costs (Mallows: the fall of the sum of
             squares above twice the parameters), against how many would on noise alone. Half of them must.

The chance is multiplied by the number of tests (Bonferroni). Among those that are significant the one with the greatest
gain is the batch's, a parameter costing log(rows) in each sensor, or log(sensors) where all have one value (Schwarz).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import bdtrc, chdtrc, fdtrc

from calibrations.criteria import (
    FEWEST_SENSORS,
    INSEPARABLE,
    LEAST_GAINING_SHARE,
    LEAST_SHARED_GAIN,
    MOST_SCORE_LENGTH,
    SIGNIFICANT,
)
from calibrations.fleet.look import Score, Screening
from calibrations.fleet.rigs import RigError
from calibrations.table import Array

SMALLEST_EIGENVALUE = 1e-9  # eigenvalue of a covariance of scores, over the greatest: less is rounding


@dataclass(frozen=True)
class BatchEffect:
    """An effect as a batch shows it. `sensors` show it alone, out of `of`; `common`: all have about one value.

    `p_value` is corrected for the search, `gain` twice the log-likelihood less the price of the parameters; `rivals`
    would do as well.
    """

    effect: str
    common: bool
    p_value: float
    gain: float
    sensors: int
    of: int
    rivals: tuple[str, ...] = ()


def find_batch_effects(looks: Sequence[Screening], of_stage: Container[str] = ()) -> list[BatchEffect]:
    """The significant effects of a batch in addition to the model of `looks`, best first; none in a batch of too few.

    Effects `of_stage` are of the rig, which every sensor finds as it is: they are tested only in common.
    """
    if len(looks) < FEWEST_SENSORS:
        return []
    scores_by_effect: dict[tuple[str, int, int], list[tuple[Score, int]]] = defaultdict(list)
    for look in looks:
        for score in look.scores:
            scores_by_effect[score.effect, score.start, len(score.score)].append((score, look.rows))
    tests = [scores for scores in scores_by_effect.values() if len(scores) >= max(FEWEST_SENSORS, len(looks) / 2)]
    tested = [_judge(scores, 2 * len(tests), scores[0][0].effect not in of_stage) for scores in tests]
    tested = sorted((effect for effect in tested if effect.p_value < SIGNIFICANT), key=lambda e: e.gain, reverse=True)
    best: dict[str, BatchEffect] = {}
    for effect in tested:
        best.setdefault(effect.effect, effect)
    return [_with_rivals(effect, list(best.values())) for effect in best.values()]


def _with_rivals(effect: BatchEffect, candidates: list[BatchEffect]) -> BatchEffect:
    rivals = tuple(o.effect for o in candidates if o is not effect and o.gain > effect.gain - INSEPARABLE)
    return replace(effect, rivals=rivals)


def _judge(scores_and_rows: list[tuple[Score, int]], tests: int, may_differ: bool) -> BatchEffect:
    scores = [score for score, _ in scores_and_rows]
    statistics, ranks = np.array([s.statistic for s in scores]), np.array([s.rank for s in scores])
    price = float(np.median(ranks)) * float(np.median(np.log([rows for _, rows in scores_and_rows])))
    options = [(True, *_common(scores, int(np.median(ranks))))]
    if may_differ:
        options.append(
            (False, _sensor_chance(statistics, ranks), len(scores_and_rows) * (float(np.median(statistics)) - price))
        )
    significant = [option for option in options if option[1] * tests < SIGNIFICANT]
    common, p_value, gain = max(significant or options, key=lambda option: option[2])
    return BatchEffect(
        effect=scores[0].effect,
        common=common,
        p_value=min(1.0, tests * p_value),
        gain=gain,
        sensors=int(np.sum([s.p_value * tests / 2 < SIGNIFICANT for s in scores])),
        of=len(scores_and_rows),
    )


def _common(scores: list[Score], rank: int) -> tuple[float, float]:
    """Chance of so much in common without an effect, and the gain by one value for all."""
    u, weights = _limit_scores(scores)
    n, total = len(u), u.sum(axis=0)
    values, vectors = np.linalg.eigh(u.T @ u)
    is_determined = values > SMALLEST_EIGENVALUE * values[-1]
    rank = min(rank, int(is_determined.sum()))
    if not rank or n <= rank + 1:
        return 1.0, 0.0
    components = (vectors.T @ total)[is_determined][-rank:]
    share = float(np.sum(components**2 / values[is_determined][-rank:])) / n  # the common share of their information
    f = share / max(1 - share, 1e-12) * (n - rank) / rank
    information = sum((w * s.information for w, s in zip(weights, scores, strict=True)), np.zeros((u.shape[1],) * 2))
    gain = float(total @ np.linalg.pinv(information, rcond=1e-9, hermitian=True) @ total)
    return float(fdtrc(rank, n - rank, f)), gain - rank * float(np.log(n))


def _limit_scores(scores: list[Score]) -> tuple[Array, Array]:
    """Scores (n, k), none longer than MOST_SCORE_LENGTH times the median, and the factors (n,) that make them so."""
    length = np.sqrt([s.statistic for s in scores])
    weights = np.minimum(1.0, MOST_SCORE_LENGTH * np.median(length) / np.maximum(length, 1e-300))
    return np.array([s.score for s in scores]) * weights[:, None], weights


def _sensor_chance(statistics: Array, ranks: Array) -> float:
    """Chance that noise makes as many sensors gain from the effect.

    1 where a smaller share of them than LEAST_GAINING_SHARE gains.
    """
    n, gaining = len(statistics), int(np.sum(statistics > LEAST_SHARED_GAIN * ranks))
    if gaining < LEAST_GAINING_SHARE * n:
        return 1.0
    chance = float(np.max(chdtrc(ranks, LEAST_SHARED_GAIN * ranks)))
    return float(bdtrc(gaining - 1, n, chance))


# The result for a fleet: batches with their missing effects, rigs with their errors, sensors with their verdicts.

WITH_BATCH, FULL_SEARCH = "beside its batch", "in full"


@dataclass(frozen=True)
class SensorVerdict:
    """One sensor: `effects` that the first model misses on it, those of its batch and its own; how it was judged.

    `fault`: why it could not be read or fitted. The data cannot separate an effect from its `rivals`.
    """

    sensor: str
    batch: str
    rig: str
    data: str
    verdict: str
    effects: tuple[str, ...] = ()
    own: tuple[str, ...] = ()
    excess: float | None = None
    judged: str = WITH_BATCH
    rivals: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    remark: str | None = None

    @property
    def needs_a_person(self) -> bool:
        """Whether it is unlike its siblings or could not be judged; an effect of the whole batch does not count."""
        return self.verdict in ("failed", "unexplained", "no-response") or bool(self.own or self.remark)


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
        return Counter(sensor.verdict for sensor in self.sensors)


def batch_verdict(batch: str, effects: tuple[BatchEffect, ...], sensors: tuple[SensorVerdict, ...]) -> BatchVerdict:
    """The summary of a batch from its sensors'."""
    analysed = [sensor for sensor in sensors if sensor.verdict != "failed"]
    counts = Counter(name for sensor in analysed for name in sensor.effects)
    shares = {name: count / len(analysed) for name, count in counts.most_common()}
    return BatchVerdict(batch, len(sensors), effects, shares)
