"""Which physical effect is a model missing on this data?

The answer is one of four. `adequate`: nothing that the catalogue or a pattern could describe is left beyond noise.
`effect-missing`: one effect, or several, explain what is left. `ambiguous`: the best has a rival that this data cannot
tell from it, or nothing shows because the data do not even determine the model. `unexplained`: something is left, and
the catalogue does not explain most of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from calibrations.candidates import Candidate
from calibrations.determined import undetermined
from calibrations.effect import Effect, catalogue
from calibrations.experiment import Experiment, separating
from calibrations.fit import Fit
from calibrations.held_out import held_out_excess
from calibrations.model import Model
from calibrations.path import MATERIAL, Path, find_path, share_left
from calibrations.patterns import Pattern
from calibrations.plainer import plainer
from calibrations.structure import structure_of
from calibrations.table import Table

MOST_LEFT = 1 / 5  # of the excess variance: more left than this, and the catalogue has not explained it


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
    caution: str | None  # why the data do not even determine the model, where they do not
    pattern: Pattern | None  # that of the structure

    @property
    def excess_before(self) -> float:
        """Pooled excess of the model as it is."""
        return self.fit.pooled_excess


def diagnose(table: Table, model: Model, effects: Mapping[str, Effect] | None = None) -> Diagnosis:
    """Fit `model` to `table` and find what it misses. Raises what `fit` raises."""
    path = find_path(model, table, catalogue() if effects is None else effects, enough=MOST_LEFT)
    better = plainer(path)
    structure = better or structure_of(path.end)
    left = path.left
    verdict, caution = _verdict_of(path, structure, better is not None), undetermined(path.start)
    if verdict == "adequate" and caution:
        verdict = "ambiguous"
    return Diagnosis(
        fit=path.start,
        verdict=verdict,
        candidates=path.first or left,
        held_out_before=held_out_excess(path.start),
        residual_structure=structure.text if structure and verdict == "unexplained" else None,
        next_experiment=separating(path.first[0]) if verdict == "ambiguous" and path.steps else None,
        path=path,
        caution=caution,
        pattern=structure if verdict == "unexplained" else None,
    )


def _verdict_of(path: Path, structure: Pattern | None, plainer_wins: bool) -> str:
    """The verdict on the model at the start of `path`, given what is left at its end."""
    not_explained = plainer_wins or _share_left(path) > MOST_LEFT
    if structure is not None and not_explained and path.end.pooled_excess > MATERIAL:
        return "unexplained"
    if not path.steps:
        return "adequate"
    return "ambiguous" if path.steps[0].taken.indistinguishable_from else "effect-missing"


def _share_left(path: Path) -> float:
    """Part of the excess variance that the path has not explained; 1 where it has not begun."""
    return share_left(path.start, path.end) if path.steps else 1.0
