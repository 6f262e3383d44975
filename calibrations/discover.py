"""Add missing effects until none is missing; drop what later effects have made needless; say what caused the error.

An effect whose loss would cost little beside the loss of the greatest transduction is a refinement: it corrects the
form in which another acts, known only approximately, and is kept without being named as a cause. Geometry is exact: a
strong misalignment makes nothing else a refinement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibrations.candidates import SIGNIFICANT, Candidate, candidates
from calibrations.determined import undetermined
from calibrations.diagnose import MOST_LEFT
from calibrations.effect import Effect, catalogue
from calibrations.experiment import Experiment, separating
from calibrations.fit import Fit, fit, refit
from calibrations.held_out import held_out_excess
from calibrations.model import Model
from calibrations.path import MATERIAL, Path, find_path, share_left
from calibrations.patterns import Pattern
from calibrations.plainer import plainer
from calibrations.screen import chance
from calibrations.structure import structure_of
from calibrations.table import Table

REFINEMENT = 0.02  # of the greatest cost: an effect that costs less to lose refines the form of another


@dataclass(frozen=True)
class Added:
    """One effect added: the fits without and with it."""

    name: str
    before: Fit
    after: Fit

    @cached_property
    def held_out_before(self) -> float:
        """Pooled excess on unseen poses without it."""
        return held_out_excess(self.before)

    @cached_property
    def held_out_after(self) -> float:
        """Pooled excess on unseen poses with it."""
        return held_out_excess(self.after)


@dataclass(frozen=True)
class Discovery:
    """What was missing: the effects in the order added, and what this data cannot tell from each."""

    start: Fit
    steps: tuple[Added, ...]
    verdict: str
    causes: tuple[str, ...]
    refinements: tuple[str, ...]
    alternatives: Mapping[str, tuple[str, ...]]
    residual_structure: str | None
    next_experiment: Experiment | None
    path: Path
    pattern: Pattern | None = None  # that of the structure

    @property
    def end(self) -> Fit:
        """The fit of the final model."""
        return self.steps[-1].after if self.steps else self.start

    @cached_property
    def caution(self) -> str | None:
        """Why the data do not even determine the final model, where they do not."""
        return undetermined(self.end)


def add(effect: Effect, model: Model, table: Table, effects: Mapping[str, Effect] | None = None) -> Discovery:
    """`model` with one effect more, both fitted to `table`. Raises what `fit` raises.

    The verdict is on the model with the effect: `unexplained` where a pattern is left beyond noise.
    """
    before = fit(model, table)
    found = candidates(before, catalogue() if effects is None else effects)
    rivals = next((c.indistinguishable_from for c in found if c.name == effect.name), ())
    step = Added(effect.name, before, refit(before, before.model.with_effect(effect)))
    structure = structure_of(step.after)
    left = step.after.pooled_excess > MATERIAL and structure is not None
    return Discovery(
        start=before,
        steps=(step,),
        verdict="unexplained" if left else "ambiguous" if rivals or undetermined(step.after) else "adequate",
        causes=(effect.name,),
        refinements=(),
        alternatives={effect.name: rivals} if rivals else {},
        residual_structure=structure.text if structure and left else None,
        next_experiment=None,
        path=Path(before, (), tuple(found)),
        pattern=structure if left else None,
    )


def discover(table: Table, model: Model, effects: Mapping[str, Effect] | None = None) -> Discovery:
    """All effects that `model` misses on `table`. Raises what `fit` raises."""
    effects = catalogue() if effects is None else effects
    path = find_path(model, table, effects)
    better = plainer(path)
    structure = better or structure_of(path.end)
    left = path.end.pooled_excess > MATERIAL and structure is not None
    if structure and left and (not path.steps or better or share_left(path.start, path.end) > MOST_LEFT):
        return Discovery(path.start, (), "unexplained", (), (), {}, structure.text, None, path, structure)
    kept = _needed(path)
    steps = _in_order(path, kept, effects)
    new = [name for name in kept if name not in path.start.model.effects]
    doubtful = [s.taken.name for s in path.steps if s.taken.indistinguishable_from and s.taken.name in new]
    seen = {name: _beside_the_others(name, steps, effects) for name in doubtful}
    alternatives = {name: c.indistinguishable_from for name, c in seen.items() if c and c.indistinguishable_from}
    causes = _causes(steps)
    ambiguous = next((seen[name] for name in causes if name in alternatives), None)
    uncertain = ambiguous or undetermined(steps[-1].after if steps else path.start)
    return Discovery(
        start=path.start,
        steps=steps,
        verdict="unexplained" if left else "ambiguous" if uncertain else "adequate",
        causes=causes,
        refinements=tuple(s.name for s in steps if s.name not in causes),
        alternatives=alternatives,
        residual_structure=structure.text if structure and left else None,
        next_experiment=separating(ambiguous) if ambiguous else None,
        path=path,
        pattern=structure if left else None,
    )


def _needed(path: Path) -> list[str]:
    """Names of the added effects that the final model cannot do without, in the order of the path."""
    names = [step.taken.name for step in path.steps]
    freed = {term.name for term in path.start.model.terms}
    present = path.end
    while len([name for name in names if name not in freed]) > 1:
        costs = {name: _cost(present, name) for name in names if name not in freed}
        name = min(costs, key=lambda n: costs[n][0] / max(costs[n][1], 1))
        smaller = refit(present, present.model.without(name))
        if chance(*costs[name]) < SIGNIFICANT and held_out_excess(smaller) > held_out_excess(present):
            return names
        names.remove(name)
        present = smaller
    return names


def _cost(found: Fit, name: str, tied: bool = False) -> tuple[float, int]:
    """Sum of squares that losing the effect would cost, to first order, and the parameters that it has.

    `tied`: losing it means that its axes share one value again.
    """
    white, mine = found.whitened[:, 1:], found.problem.layout.of_effect(name)
    size = np.linalg.norm(white, axis=0)
    white = white / np.where(size > 0, size, 1.0)
    value = found.theta[mine]
    if tied:
        value = value - value.mean()
    signal = white[:, mine] @ (value * size[mine])
    others = white[:, ~mine]
    lost = signal - others @ np.linalg.lstsq(others, signal, rcond=1e-9)[0]
    return float(lost @ lost), int(mine.sum())


def _in_order(path: Path, kept: list[str], effects: Mapping[str, Effect]) -> tuple[Added, ...]:
    """The kept effects one after another: first those that free a value that the model already has, then new ones."""
    first = [name for name in kept if any(term.name == name for term in path.start.model.terms)]
    order = first + [name for name in kept if name not in first]
    if order == [step.taken.name for step in path.steps]:
        return tuple(Added(step.taken.name, step.before, step.after) for step in path.steps)
    steps: list[Added] = []
    present = path.start
    for name in order:
        after = refit(present, present.model.with_effect(effects[name]))
        steps.append(Added(name, present, after))
        present = after
    return tuple(steps)


def _beside_the_others(name: str, steps: tuple[Added, ...], effects: Mapping[str, Effect]) -> Candidate | None:
    """The effect as a candidate once all others are in the model: a rival seen before may be ruled out by then."""
    end = steps[-1].after
    found = candidates(refit(end, end.model.without(name)), effects)
    return next((c for c in found if c.name == name), None)


def _causes(steps: tuple[Added, ...]) -> tuple[str, ...]:
    if not steps:
        return ()
    tied = {term.name for term in steps[0].before.model.terms if term.tied}
    costs = {s.name: _cost(steps[-1].after, s.name, s.name in tied)[0] for s in steps}
    approximate = [s.name for s in steps if s.after.model.terms[-1].effect.acts_on in ("transduction", "output")]
    greatest = max((costs[name] for name in approximate), default=0.0)
    return tuple(name for name, cost in costs.items() if name not in approximate or cost >= REFINEMENT * greatest)
