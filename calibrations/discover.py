"""Add missing effects until none is missing; drop what later effects have made needless; say what caused the error.

An effect whose loss would cost little beside the loss of the greatest is a refinement: it corrects the form in which
another acts, known only approximately, and is kept without being named as a cause. Geometry is exact: a strong
misalignment makes nothing else a refinement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from calibrations.effect import Effect, catalogue
from calibrations.experiment import Experiment, separating
from calibrations.fit import Fit, refit
from calibrations.model import Model
from calibrations.search.candidates import candidates
from calibrations.search.common_floor import counted
from calibrations.search.determined import undetermined
from calibrations.search.held_out import held_out_excess
from calibrations.search.outliers import caution, fit_without, told
from calibrations.search.path import Path, find_path
from calibrations.search.patterns import Pattern
from calibrations.search.plainer import plainer
from calibrations.search.rivals import with_rivals
from calibrations.search.settle import Settled, cost, first_order, settled
from calibrations.search.share import MATERIAL, MOST_LEFT, OF_FORM, share_left
from calibrations.search.structure import structure_of
from calibrations.table import Array, Table

REFINEMENT = 0.02  # of the greatest cost: an effect that costs less to lose refines the form of another


@dataclass(frozen=True)
class Added:
    """One effect added: the fits without and with it."""

    name: str
    before: Fit
    after: Fit

    @classmethod
    def of(cls, effect: Effect, before: Fit) -> Added:
        """The effect added to a fit; the errors of both are counted in one floor."""
        after = refit(before, before.model.with_effect(effect))
        return cls(effect.name, before, after).counted(after.noise.scatter)

    def counted(self, floor: Array) -> Added:
        """The same, errors counted in this floor (channels,) where a model's own is what it leaves."""
        return Added(self.name, counted(self.before, floor), counted(self.after, floor))

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
    def undecided(self) -> bool:
        """Whether more data would tell which explanation is right; what is left over may only be a matter of form."""
        return self.verdict == "ambiguous" and self.residual_structure is None

    @property
    def end(self) -> Fit:
        """The fit of the final model."""
        return self.steps[-1].after if self.steps else self.start

    @cached_property
    def caution(self) -> str | None:
        """Poses that were set aside, and why the data do not even determine the final model, where they do not."""
        return "; ".join(filter(None, (caution(self.path.outliers), undetermined(self.end)))) or None


def add(effect: Effect, model: Model, table: Table, effects: Mapping[str, Effect] | None = None) -> Discovery:
    """`model` with one effect more, both fitted to `table`. Raises what `fit` raises.

    The verdict is on the model with the effect: `unexplained` where more than its form is left beyond noise.
    """
    before, outliers = fit_without(model, table)
    before = counted(before, before.noise.floor)
    found = candidates(before, catalogue() if effects is None else effects)
    rivals = next((with_rivals(c, found, before).indistinguishable_from for c in found if c.name == effect.name), ())
    step = Added.of(effect, before)
    structure = structure_of(step.after)
    left = step.after.pooled_excess > MATERIAL and structure is not None
    return Discovery(
        start=step.before,
        steps=(step,),
        verdict=_verdict(before, step.after, left, bool(rivals)),
        causes=(effect.name,),
        refinements=(),
        alternatives={effect.name: rivals} if rivals else {},
        residual_structure=structure.text if structure and left else None,
        next_experiment=None,
        path=Path(before, (), tuple(found), outliers),
        pattern=structure if left else None,
    )


def discover(table: Table, model: Model, effects: Mapping[str, Effect] | None = None) -> Discovery:
    """All effects that `model` misses on `table`. Raises what `fit` raises."""
    effects = catalogue() if effects is None else effects
    path = find_path(model, table, effects)
    stand = settled(path, effects)
    better = plainer(path.start, stand.end)
    structure = better or structure_of(stand.end)
    left = stand.end.pooled_excess > MATERIAL and structure is not None
    if structure and left and (not stand.names or better or share_left(path.start, stand.end) > MOST_LEFT):
        return Discovery(path.start, (), "unexplained", (), (), {}, structure.text, None, path, structure)
    if path.outliers and not stand.names:
        return Discovery(path.start, (), "unexplained", (), (), {}, told(path.outliers), None, path)
    steps = _in_order(path.start, stand, effects)
    alternatives = {name: c.indistinguishable_from for name, c in stand.beside.items() if c.indistinguishable_from}
    causes = _causes(steps)
    ambiguous = next((stand.beside[name] for name in causes if name in alternatives), None)
    return Discovery(
        start=path.start,
        steps=steps,
        verdict=_verdict(path.start, stand.end, left, ambiguous is not None),
        causes=causes,
        refinements=tuple(s.name for s in steps if s.name not in causes),
        alternatives=alternatives,
        residual_structure=structure.text if structure and left else None,
        next_experiment=separating(ambiguous, table) if ambiguous else None,
        path=path,
        pattern=structure if left else None,
    )


def _verdict(start: Fit, end: Fit, left: bool, rivals: bool) -> str:
    """The verdict on the final model. `left`: a pattern remains beyond noise; `rivals`: another cause would do as well.

    What is left may be the form of the causes or one more of them: where it is little, that is not decided.
    """
    if left and share_left(start, end) > OF_FORM:
        return "unexplained"
    return "ambiguous" if left or rivals or undetermined(end) else "adequate"


def _in_order(start: Fit, stand: Settled, effects: Mapping[str, Effect]) -> tuple[Added, ...]:
    """The effects one after another: first those that free a value that the model already has, then new ones."""
    freed = {term.name for term in start.model.terms}
    order = sorted(stand.names, key=lambda name: name not in freed)
    steps: list[Added] = []
    present = start
    for name in order:
        last = len(steps) == len(order) - 1
        after = stand.end if last else refit(present, present.model.with_effect(effects[name]))
        steps.append(Added(name, present, after))
        present = after
    return tuple(steps)


def _causes(steps: tuple[Added, ...]) -> tuple[str, ...]:
    if not steps:
        return ()
    tied = {term.name for term in steps[0].before.model.terms if term.tied}
    end = steps[-1].after
    costs = {s.name: (first_order(end, s.name, shared=True) if s.name in tied else cost(end, s.name))[0] for s in steps}
    approximate = [s.name for s in steps if not s.after.model.terms[-1].effect.exact]
    greatest = max((costs[name] for name in approximate), default=0.0)
    return tuple(name for name, lost in costs.items() if name not in approximate or lost >= REFINEMENT * greatest)
