"""Effects added one after another, as long as each is significant and lowers the error on unseen poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from calibrations.candidates import Candidate, candidates, refit
from calibrations.effect import Effect
from calibrations.fit import Fit, fit
from calibrations.held_out import held_out_excess
from calibrations.model import Model
from calibrations.table import Table

SIGNIFICANT = 0.003  # chance of naming anything at all where nothing is missing, over the whole search
MOST_EFFECTS = 8


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

    @cached_property
    def held_out_after(self) -> float:
        """Pooled excess on unseen poses with it."""
        return held_out_excess(self.after)


@dataclass(frozen=True)
class Path:
    """The way from a model to the last one that an effect could be added to."""

    start: Fit
    steps: tuple[Step, ...]
    left: tuple[Candidate, ...]  # candidates at the end, none of them good enough

    @property
    def end(self) -> Fit:
        """The last fit."""
        return self.steps[-1].after if self.steps else self.start

    @property
    def first(self) -> tuple[Candidate, ...]:
        """Candidates on top of the model that was given."""
        return self.steps[0].candidates if self.steps else self.left


def find_path(model: Model, table: Table, effects: Mapping[str, Effect]) -> Path:
    """Add the best effect until none is significant. Raises what `fit` raises."""
    start = present = fit(model, table)
    steps: list[Step] = []
    found = candidates(present, effects)
    while len(steps) < MOST_EFFECTS:
        step = _next(present, found)
        if step is None:
            break
        steps.append(step)
        present = step.after
        found = candidates(present, effects)
    return Path(start, tuple(steps), tuple(found))


def _next(present: Fit, found: list[Candidate]) -> Step | None:
    """The best candidate that is significant and still helps on unseen poses once refitted."""
    for c in found[:3]:
        if c.p_value >= SIGNIFICANT:
            continue
        step = Step(present, refit(present, c), tuple(found), c)
        if step.held_out_after < step.held_out_before:
            return step
    return None
