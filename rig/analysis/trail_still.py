"""A noise model as it grows on a still record: what `rig.analysis.trail` is for rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from calibrations.effect import Effect
from calibrations.errors import ModelError
from calibrations.model import Model
from calibrations.still.compare import Comparison, compare
from calibrations.still.diagnose import Diagnosis, diagnose
from calibrations.still.discover import Added
from calibrations.still.fit import NoiseFit, fit
from calibrations.still.record import Still
from rig.analysis.asked_still import asked_still
from rig.analysis.provenance import with_provenance
from rig.analysis.request import Request
from rig.planning.foresight import with_noise_next


@dataclass(frozen=True)
class StillTrail:
    """`model` beside `still`, and the `steps` taken from there; `effects` are those that may be added."""

    request: Request
    model: Model
    still: Still
    effects: Mapping[str, Effect]
    notes: tuple[str, ...]
    start: NoiseFit
    steps: tuple[Added, ...] = ()

    @property
    def end(self) -> NoiseFit:
        """The fit of the model as it is now."""
        return self.steps[-1].after if self.steps else self.start

    @property
    def unit(self) -> str:
        """Of the outputs."""
        return self.still.unit

    def among(self, effects: Mapping[str, Effect]) -> StillTrail:
        """The same with other effects to be added."""
        return replace(self, effects=effects)

    def tried(self, effect: Effect) -> Added:
        """The present model with one effect more, all fitted. Raises ModelError where it is in the model."""
        if self.end.model.holds(effect.name):
            raise ModelError(f"{effect.name} is in the model already")
        after = fit(self.end.model.with_effect(effect), self.still)
        return Added(effect.name, self.end, after, after.log_likelihood - self.end.log_likelihood)

    def with_step(self, step: Added) -> StillTrail:
        """One step further."""
        return replace(self, steps=(*self.steps, step))

    def undone(self) -> StillTrail:
        """One step back."""
        return replace(self, steps=self.steps[:-1])

    def kept(self) -> Model:
        """The present model as a file keeps it, with where it comes from."""
        return with_provenance(self.end, self.model)

    def compared(self) -> Comparison:
        """The present model beside the record: as given, where it came with values."""
        return compare(self.still, self.end.model if self.steps else self.model)

    def diagnosed(self) -> Diagnosis:
        """What the present model misses."""
        return diagnose(self.still, self.end.model if self.steps else self.model, self.effects)

    def with_next(self, result: Diagnosis, tell: Callable[[str], None]) -> Diagnosis:  # noqa: ARG002 as that of rows
        """The diagnosis with its next experiment planned on the bench."""
        return with_noise_next(result, self.request.bench_file)


def still_trail(request: Request) -> StillTrail | None:
    """The beginning; None where the data are no still record. Raises what `asked_still` raises."""
    notes: list[str] = []
    asked = asked_still(request, notes.append)
    if asked is None:
        return None
    return StillTrail(request, asked.model, asked.still, asked.effects, tuple(notes), fit(asked.model, asked.still))
