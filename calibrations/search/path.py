"""Effects added one after another, as long as each is significant and lowers the error on unseen poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from calibrations.effect import Effect
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.noise import rms
from calibrations.search.candidates import SIGNIFICANT, Candidate, added, best_pair, candidates
from calibrations.search.common_floor import counted, leaves_noise
from calibrations.search.determined import lets_go
from calibrations.search.held_out import held_out_excess
from calibrations.search.outliers import fit_without
from calibrations.search.rivals import with_rivals
from calibrations.search.share import MATERIAL, share_left
from calibrations.table import Table

MOST_EFFECTS = 14
LEAST_SHARE = 0.05  # of what is left beyond noise: a smaller gain may be the wrong form of something strong


@dataclass(frozen=True)
class Step:
    """One effect added: the fits before and after, all candidates of that moment, and the one that was taken."""

    before: Fit
    after: Fit
    candidates: tuple[Candidate, ...]
    taken: Candidate

    @cached_property
    def held_out_before(self) -> float:
        """Pooled excess on unseen poses without the effect."""
        return held_out_excess(self.before)

    @property
    def held_out_after(self) -> float:
        """Pooled excess on unseen poses with it."""
        return self.taken.held_out_after


@dataclass(frozen=True)
class Path:
    """The way from a model to the last one that an effect could be added to."""

    start: Fit
    steps: tuple[Step, ...]
    left: tuple[Candidate, ...]  # candidates of the last search
    outliers: tuple[int, ...] = ()  # poses that were set aside

    @property
    def end(self) -> Fit:
        """The last fit."""
        return self.steps[-1].after if self.steps else self.start

    @cached_property
    def first(self) -> tuple[Candidate, ...]:
        """Candidates on top of the model that was given; before them the one that was taken, with all its rivals."""
        if not self.steps:
            return self.left
        step = self.steps[0]
        best = with_rivals(step.taken, step.candidates, step.before)
        return best, *(c for c in step.candidates if c is not step.taken)


def find_path(model: Model, table: Table, effects: Mapping[str, Effect], enough: float = 0.0) -> Path:
    """Add the best effect until none is significant, or no more than `enough` of the excess variance is left.

    Raises what `fit` raises.
    """
    start, outliers = fit_without(model, table)
    return _recounted(grown(Path(counted(start, start.noise.floor), (), (), outliers), effects, enough))


def grown(path: Path, effects: Mapping[str, Effect], enough: float = 0.0) -> Path:
    """The path, as far as it goes on from its end."""
    present, steps = path.end, list(path.steps)
    found = candidates(present, effects)
    while len(steps) < MOST_EFFECTS:
        step = _next(present, found)
        if step is None:
            break
        steps.append(step)
        present = step.after
        if not leaves_noise(present) and share_left(path.start, present) <= enough:
            break
        found = candidates(present, effects)
    return Path(path.start, tuple(steps), tuple(found), path.outliers)


def _recounted(path: Path) -> Path:
    """The path with all errors counted in what its end leaves, where that is taken for noise."""
    if not leaves_noise(path.end):
        return path
    floor = path.end.noise.scatter
    times = float(rms(path.end.noise.floor) / rms(floor))

    def of(c: Candidate) -> Candidate:
        return replace(c, excess_after=times * c.excess_after, held_out_after=times * c.held_out_after)

    def step(s: Step) -> Step:
        found = tuple(map(of, s.candidates))
        taken = next(c for c, before in zip(found, s.candidates, strict=True) if before is s.taken)
        return Step(counted(s.before, floor), counted(s.after, floor), found, taken)

    return Path(counted(path.start, floor), tuple(map(step, path.steps)), tuple(map(of, path.left)), path.outliers)


def _next(present: Fit, found: list[Candidate]) -> Step | None:
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
    if present.table.kind == "poses" or present.pooled_excess <= MATERIAL:
        return None  # with known orientation an effect is seen beside others
    pair = best_pair(present, found)
    return _taken(present, found, pair[0]) if pair else None


def _share(present: Fit, excess_after: float) -> float:
    """Part of what is left beyond the noise floor that an effect explains; 1 where hardly anything is left."""
    before = present.pooled_excess**2
    return (before - excess_after**2) / (before - 1) if before > MATERIAL**2 else 1.0


def _taken(present: Fit, found: list[Candidate], c: Candidate) -> Step:
    """The step that adds `c`; its errors are then those of the full fit."""
    after = added(present, c)
    full = replace(c, excess_after=after.pooled_excess, held_out_after=held_out_excess(after))
    return Step(present, after, tuple(full if other is c else other for other in found), full)
