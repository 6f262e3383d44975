"""A model as it grows on its data: the fit that it began with, and effects added one by one, which can be undone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from calibrations.compare import Comparison, compare
from calibrations.diagnose import Diagnosis, diagnose
from calibrations.discover import Added
from calibrations.effect import Effect
from calibrations.errors import ModelError
from calibrations.expressions.effect import effect_for
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.search.common_floor import counted
from calibrations.search.outliers import fit_without
from calibrations.table import Table
from rig.analysis.asked import asked
from rig.analysis.provenance import with_provenance
from rig.analysis.request import Request
from rig.planning.foresight import with_next


@dataclass(frozen=True)
class Trail:
    """`model` on the rows of `table` that do not stand out, and the `steps` taken from there.

    `notes` is what a person should know of the data; `effects` are those that may be added.
    """

    request: Request
    model: Model
    table: Table
    effects: Mapping[str, Effect]
    notes: tuple[str, ...]
    start: Fit
    steps: tuple[Added, ...] = ()

    @property
    def end(self) -> Fit:
        """The fit of the model as it is now."""
        return self.steps[-1].after if self.steps else self.start

    @property
    def unit(self) -> str:
        """Of the outputs."""
        return self.table.unit

    def among(self, effects: Mapping[str, Effect]) -> Trail:
        """The same with other effects to be added."""
        return replace(self, effects=effects)

    def tried(self, effect: Effect) -> Added:
        """The present model with one effect more, all fitted. Raises ModelError where that says nothing new."""
        model, table = self.end.model, self.end.table
        if model.holds(effect.name):
            raise ModelError(f"{effect.name} is in the model already")
        if (why := effect.excluded(table)) is not None:
            raise ModelError(f"{effect.name} {why}; {table.source} is a table of {table.kind}")
        step = Added.of(effect, self.end)
        if effect.expression:
            require_new(step.after, effect.name, model.name)
        return step

    def written(self, name: str, text: str) -> Effect:
        """An effect of one's own, as an expression. Raises ModelError, ExpressionError with the place in the text."""
        if name in self.effects:
            raise ModelError(f"{name} is in the catalogue already; give yours another name")
        return effect_for(name, text, self.end.table)

    def with_step(self, step: Added) -> Trail:
        """One step further."""
        return self._with((*self.steps, step))

    def undone(self) -> Trail:
        """One step back; the beginning stays as it is."""
        return self._with(self.steps[:-1])

    def _with(self, steps: tuple[Added, ...]) -> Trail:
        """With these steps, all errors counted in one floor: what the last model leaves, where that is its noise."""
        end = steps[-1].after if steps else self.start
        floor = end.noise.scatter
        return replace(self, start=counted(self.start, floor), steps=tuple(step.counted(floor) for step in steps))

    def kept(self) -> Model:
        """The present model as a file keeps it, with where it comes from."""
        return with_provenance(self.end, self.model)

    def compared(self) -> Comparison:
        """The present model beside the data: as given, where it came with values."""
        return compare(self.start.table, self.end.model if self.steps else self.model)

    def diagnosed(self) -> Diagnosis:
        """What the present model misses."""
        return diagnose(self.table, self.end.model if self.steps else self.model, self.effects)

    def with_next(self, result: Diagnosis, tell: Callable[[str], None]) -> Diagnosis:
        """The diagnosis with its next experiment planned on the bench; `tell` hears where that is another bench."""
        return with_next(result, self.request.data, self.effects, self.request.bench_file, tell)


def trail(request: Request) -> Trail:
    """The beginning: data (a file or a run) and a model by name or file. Raises what `asked` and `fit` raise."""
    notes: list[str] = []
    table, start, effects = asked(request, notes.append)
    found, _ = fit_without(start, table)
    return Trail(request, start, table, effects, tuple(notes), found)


def require_new(found: Fit, name: str, model: str) -> None:
    """An expression has to add something that `model` does not have. Raises ModelError."""
    estimates = next(term.estimates for term in found.model.terms if term.name == name)
    if all(e.std is None for e in estimates):
        e = estimates[0]
        where = f" of {e.axis}" if e.axis else ""
        raise ModelError(f"{name} adds nothing that {model} does not have: {e.name}{where}: {e.why}")
