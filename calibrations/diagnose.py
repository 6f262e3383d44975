"""Which physical effect is a model missing on this data?

The answer is one of four. `adequate`: nothing that the catalogue or a pattern could describe is left beyond noise.
`effect-missing`: one effect, or several, explain what is left. `ambiguous`: the best has a rival that this data cannot
tell from it, or nothing shows because the data do not even determine the model. `unexplained`: something is left, and
the catalogue does not explain most of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from calibrations.effect import Effect, catalogue
from calibrations.experiment import Experiment, separating
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.search.candidates import Candidate
from calibrations.search.determined import undetermined
from calibrations.search.held_out import held_out_excess
from calibrations.search.outliers import caution, told
from calibrations.search.path import Path, find_path
from calibrations.search.patterns import Pattern
from calibrations.search.plainer import plainer
from calibrations.search.settle import settled
from calibrations.search.share import MATERIAL, MOST_LEFT, share_left
from calibrations.search.structure import structure_of
from calibrations.table import Table


@dataclass(frozen=True)
class Diagnosis:
    """The verdict, the candidates behind it (best first), and what is left when they are added."""

    fit: Fit
    verdict: str
    candidates: tuple[Candidate, ...]
    held_out_before: float
    residual_structure: str | None
    next_experiment: Experiment | None
    path: Path
    caution: str | None  # poses that were set aside, and why the data do not even determine the model
    pattern: Pattern | None  # that of the structure

    @property
    def excess_before(self) -> float:
        """Pooled excess of the model as it is."""
        return self.fit.pooled_excess


def diagnose(table: Table, model: Model, effects: Mapping[str, Effect] | None = None) -> Diagnosis:
    """Fit `model` to `table` and find what it misses. Raises what `fit` raises."""
    effects = catalogue() if effects is None else effects
    path = find_path(model, table, effects, enough=MOST_LEFT)
    end = path.end
    better = plainer(path.start, end)
    if better is None and path.steps and share_left(path.start, end) > MOST_LEFT:
        end = settled(path, effects).end
        better = plainer(path.start, end)
    structure = better or structure_of(end)
    verdict, why_not = _verdict_of(path, end, structure, better is not None), undetermined(path.start)
    if verdict == "adequate" and why_not:
        verdict = "ambiguous"
    shown = structure.text if structure and verdict == "unexplained" else None
    if verdict == "adequate" and path.outliers:
        verdict, structure, shown = "unexplained", None, told(path.outliers)
    return Diagnosis(
        fit=path.start,
        verdict=verdict,
        candidates=path.first,
        held_out_before=held_out_excess(path.start),
        residual_structure=shown,
        next_experiment=separating(path.first[0], table) if verdict == "ambiguous" and path.steps else None,
        path=path,
        caution="; ".join(filter(None, (caution(path.outliers), why_not))) or None,
        pattern=structure if verdict == "unexplained" else None,
    )


def _verdict_of(path: Path, end: Fit, structure: Pattern | None, plainer_wins: bool) -> str:
    """The verdict on the model at the start of `path`, given what is left when its effects have settled."""
    not_explained = plainer_wins or not path.steps or share_left(path.start, end) > MOST_LEFT
    if structure is not None and not_explained and end.pooled_excess > MATERIAL:
        return "unexplained"
    if not path.steps:
        return "adequate"
    return "ambiguous" if path.first[0].indistinguishable_from else "effect-missing"
