"""The search for missing effects: forward steps, then exchanges.

Forward: the best candidate is added as long as it is significant and lowers the error on unseen rows.

Exchange: the first effects were added while all others were still missing, so one may stand in another's place, have a
bad start, or be needless. Each is taken out in turn. It is dropped where the model does as well without it, and
exchanged where another candidate makes the model clearly likelier (Miller, Subset Selection in Regression).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from calibrations.criteria import (
    CANDIDATES_FOR_A_PLACE,
    CLEARLY_BETTER,
    EXCHANGE_ROUNDS,
    LEAST_SHARE,
    MATERIAL,
    MOST_EFFECTS,
    MOST_EXCHANGED,
    NEARLY_AS_GOOD,
    SIGNIFICANT,
)
from calibrations.discovery.candidates import RowCandidate, added, best_pair, candidates, with_rivals
from calibrations.discovery.significance import chance, likelihood
from calibrations.effects import Effect
from calibrations.fitting.determined import lets_go
from calibrations.fitting.fit import Fit, refit
from calibrations.means.noise import rms


@dataclass(frozen=True)
class Taken:
    """One forward step: the fits before and after, all candidates of that moment, and the one that was taken."""

    before: Fit
    after: Fit
    candidates: tuple[RowCandidate, ...]
    taken: RowCandidate

    @cached_property
    def held_out_before(self) -> float:
        """Pooled excess on unseen poses without the effect."""
        return self.before.held_out_excess

    @property
    def held_out_after(self) -> float:
        """Pooled excess on unseen poses with it."""
        return self.taken.held_out_after


@dataclass(frozen=True)
class Path:
    """The way from a model to the last one that an effect could be added to."""

    start: Fit
    steps: tuple[Taken, ...]
    left: tuple[RowCandidate, ...]  # candidates of the last search
    outliers: tuple[int, ...] = ()  # poses that were set aside

    @property
    def end(self) -> Fit:
        """The last fit."""
        return self.steps[-1].after if self.steps else self.start

    @cached_property
    def first(self) -> tuple[RowCandidate, ...]:
        """Candidates on top of the model that was given; before them the one that was taken, with all its rivals."""
        if not self.steps:
            return self.left
        step = self.steps[0]
        best = with_rivals(step.taken, step.candidates, step.before)
        return best, *(c for c in step.candidates if c is not step.taken)


def find_path(start: Fit, outliers: tuple[int, ...], effects: Mapping[str, Effect], most: int = MOST_EFFECTS) -> Path:
    """Add the best effect to a fit until none is significant, `most` effects at most."""
    path = grown(Path(start.in_floor(start.noise.floor), (), (), outliers), effects, most)
    return recounted(path, path.end)


def is_complete(path: Path) -> bool:
    """Whether no candidate on top of the last model is significant and helps."""
    explained = bool(path.steps) and path.end.share_left(path.start) <= 0  # no further candidates were asked for
    return explained or _next(path.end, list(path.left)) is None


def grown(path: Path, effects: Mapping[str, Effect], most: int = MOST_EFFECTS) -> Path:
    """Continue the forward search from the last model."""
    present, steps = path.end, list(path.steps)
    found = candidates(present, effects)
    while len(steps) < most:
        step = _next(present, found)
        if step is None:
            break
        steps.append(step)
        present = step.after
        if not present.residual_is_noise and present.share_left(path.start) <= 0:
            break
        found = candidates(present, effects)
    return Path(path.start, tuple(steps), tuple(found), path.outliers)


def continued(path: Path, effects: Mapping[str, Effect]) -> Path:
    """The forward search from the last model of a path that has ended after its first step."""
    done = not path.steps or path.end.share_left(path.start) <= 0
    return path if done else recounted(further := grown(path, effects), further.end)


def recounted(path: Path, end: Fit) -> Path:
    """The path with all errors as multiples of the residual of `end`, where that is the only measure of noise."""
    if not end.residual_is_noise:
        return path
    floor = end.noise.scatter
    times = float(rms(path.end.noise.floor) / rms(floor))

    def of(c: RowCandidate) -> RowCandidate:
        return replace(c, excess_after=times * c.excess_after, held_out_after=times * c.held_out_after)

    def step(s: Taken) -> Taken:
        found = tuple(map(of, s.candidates))
        taken = next(c for c, before in zip(found, s.candidates, strict=True) if before is s.taken)
        return Taken(s.before.in_floor(floor), s.after.in_floor(floor), found, taken)

    return Path(path.start.in_floor(floor), tuple(map(step, path.steps)), tuple(map(of, path.left)), path.outliers)


def _next(present: Fit, found: list[RowCandidate]) -> Taken | None:
    """The best candidate that is significant and still helps on unseen poses once refitted.

    Where there is none though much is left, the stronger of the best pair: the other then follows by itself.
    """
    for c in found[:3]:
        if c.p_value >= SIGNIFICANT or _share(present, c.excess_after) < LEAST_SHARE / 2:
            continue
        step = _taken(present, found, c)
        if lets_go(present, step.after):
            continue
        if step.held_out_after < step.held_out_before and _share(present, step.after.pooled_excess) >= LEAST_SHARE:
            return step
    if present.table.type.stage_angles or present.pooled_excess <= MATERIAL:
        return None  # with known orientation an effect is seen beside others
    pair = best_pair(present, found)
    return _taken(present, found, pair[0]) if pair else None


def _share(present: Fit, excess_after: float) -> float:
    """Part of what is left beyond the noise floor that an effect explains; 1 where hardly anything is left."""
    before = present.pooled_excess**2
    return (before - excess_after**2) / (before - 1) if before > MATERIAL**2 else 1.0


def _taken(present: Fit, found: list[RowCandidate], c: RowCandidate) -> Taken:
    """The step that adds `c`; its errors are then those of the full fit."""
    after = added(present, c)
    full = replace(c, excess_after=after.pooled_excess, held_out_after=after.held_out_excess)
    return Taken(present, after, tuple(full if other is c else other for other in found), full)


@dataclass(frozen=True)
class Settled:
    """The final fit, and the effects that it needs beyond the first model."""

    end: Fit
    names: tuple[str, ...]
    found: Mapping[str, tuple[RowCandidate, ...]]  # by effect: candidates once all others are in
    tested: bool = True  # whether the effects were tested against each other

    @cached_property
    def beside(self) -> Mapping[str, RowCandidate]:
        """Each effect of the model as a candidate, with its rivals."""
        own = {name: c for name, others in self.found.items() for c in others if c.name == name}
        return {name: with_rivals(c, self.found[name], _without(self.end, name)) for name, c in own.items()}


def settled(path: Path, effects: Mapping[str, Effect]) -> Settled:
    """What stands of the effects of `path`, and what comes in their place."""
    freed = {term.name for term in path.start.model.terms}
    end, names = path.end, tuple(step.taken.name for step in path.steps)
    found: Mapping[str, tuple[RowCandidate, ...]] = {}
    for _ in range(EXCHANGE_ROUNDS):
        end, names = _needed(end, names, freed)
        if len(names) > MOST_EXCHANGED:
            return Settled(end, names, {}, tested=False)
        found = _beside(path, end, tuple(name for name in names if name not in freed), effects)
        after = _exchanged(end, names, found, freed)
        if after is None:
            break
        further = grown(Path(after[0], (), ()), effects)
        end, names = further.end, (*after[1], *(step.taken.name for step in further.steps))
    return Settled(end, names, found)


def _needed(present: Fit, names: tuple[str, ...], freed: set[str]) -> tuple[Fit, tuple[str, ...]]:
    """Without those of the added effects that the model does as well without, the least first."""
    while len(names) > 1 and (new := [name for name in names if name not in freed]):
        of = cost if len(names) <= MOST_EXCHANGED else first_order
        costs = {name: of(present, name) for name in new}
        name = min(costs, key=lambda n: costs[n][0] / max(costs[n][1], 1))
        smaller = _without(present, name)
        if chance(*costs[name]) < SIGNIFICANT and smaller.held_out_excess > present.held_out_excess:
            break
        names = tuple(other for other in names if other != name)
        present = smaller
    return present, names


def _beside(
    path: Path, end: Fit, names: tuple[str, ...], effects: Mapping[str, Effect]
) -> Mapping[str, tuple[RowCandidate, ...]]:
    """For each effect, all candidates once every other one is in the model."""
    if len(path.steps) == 1 and names == (path.steps[0].taken.name,):
        return {names[0]: path.steps[0].candidates}
    return {name: tuple(candidates(_without(end, name), effects)) for name in names}


def _exchanged(
    end: Fit, names: tuple[str, ...], beside: Mapping[str, tuple[RowCandidate, ...]], freed: set[str]
) -> tuple[Fit, tuple[str, ...]] | None:
    """The first exchange that makes the model clearly likelier; None where there is none.

    One that is as good counts as well if it makes another effect needless.
    """
    present = likelihood(end)
    for name, found in beside.items():
        for c in _promising(found):
            after = added(_without(end, name), c)
            others = tuple(c.name if other == name else other for other in names)
            if present - CLEARLY_BETTER < likelihood(after) <= present + CLEARLY_BETTER and c.name != name:
                after, others = _needed(after, others, freed)
            if likelihood(after) > present + CLEARLY_BETTER and not lets_go(end, after):
                return after, others
    return None


def _promising(found: tuple[RowCandidate, ...]) -> list[RowCandidate]:
    """The best, and those that explain nearly as much."""
    return [c for c in found[:CANDIDATES_FOR_A_PLACE] if c.gain > NEARLY_AS_GOOD * found[0].gain]


@lru_cache(maxsize=16)
def _without(end: Fit, name: str) -> Fit:
    return refit(end, end.model.without(name))


def cost(end: Fit, name: str) -> tuple[float, int]:
    """Growth of the whitened sum of squares when the model does without the effect, and the parameters that it has."""
    left = end.noise.whiten(_without(end, name).residual[:, :, None])[:, 0]
    present = end.whitened[:, 0]
    return float(left @ left - present @ present), int(end.problem.layout.of_effect(name).sum())


def first_order(end: Fit, name: str, shared: bool = False) -> tuple[float, int]:
    """The same to first order; `shared`: when the axes only share one value of each of its parameters."""
    white, mine = end.whitened[:, 1:], end.problem.layout.of_effect(name)
    size = np.linalg.norm(white, axis=0)
    white = white / np.where(size > 0, size, 1.0)
    value = end.theta[mine] - (end.theta[mine].mean() if shared else 0.0)
    signal = white[:, mine] @ (value * size[mine])
    others = white[:, ~mine]
    lost = signal - others @ np.linalg.lstsq(others, signal, rcond=1e-9)[0]
    return float(lost @ lost), int(mine.sum())
