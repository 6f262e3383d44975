"""What a search on a still record comes to, alike for a diagnosis and a discovery.

    adequate         nothing is missing
    effect-missing   processes are, and nothing is in doubt
    ambiguous        processes are, and others would do as well; or something is left that they are not
    unexplained      what is left is no mixture of processes: the samples, a pattern, a stretch of the spectrum

Whatever is in doubt has its alternatives or its reason, and the next experiment where one can tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from calibrations.experiment import Experiment
from calibrations.noise_analysis.oddities import hidden_in
from calibrations.search.share import MOST_LEFT
from calibrations.still.experiment import again, behind_filter, of_pattern, separating
from calibrations.still.filtered import OUTPUT_FILTER, corner_hz, filter_text
from calibrations.still.fit import NoiseFit
from calibrations.still.left import left
from calibrations.still.search import Search


@dataclass(frozen=True)
class Answer:
    """The verdict, the effects that are missing, what no effect is, and what cannot be told from what, and why."""

    verdict: str
    missing: tuple[str, ...]
    structure: str | None
    alternatives: Mapping[str, tuple[str, ...]]
    reason: str | None
    next_experiment: Experiment | None


def answer(found: Search, before: NoiseFit) -> Answer:
    """Of a search beside the fit of a model."""
    structure = structure_of(found)
    if found.still.hidden:
        return _told("unexplained", (), structure, found)  # what rounding makes of noise is no process
    if _disturbed(found):
        return _told("unexplained", tuple(found.gains), structure, found)
    if structure is not None and (not found.gains or _share_left(before, found.end) > MOST_LEFT):
        return _told("unexplained", (), structure, found)  # processes that explain little are none
    if not found.gains:
        return Answer("adequate", (), None, {}, None, None)
    doubtful = structure is not None or alternatives(found, tuple(found.gains))
    return _told("ambiguous" if doubtful else "effect-missing", tuple(found.gains), structure, found)


def structure_of(found: Search) -> str | None:
    """What no effect of the catalogue is, in words: what was taken off the record, and what its best mixture leaves."""
    return "; ".join(_disturbed(found)) or left(found.end)


def alternatives(found: Search, named: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """What each of the named effects cannot be told from; a low-pass that the data do not state goes by its effect."""
    behind = {name: (OUTPUT_FILTER,) for name in named if corner_hz(found, name) is not None}
    each = {name: (*found.rivals.get(name, ()), *behind.get(name, ())) for name in named}
    return {name: rivals for name, rivals in each.items() if rivals}


def reason_of(found: Search, doubts: Mapping[str, tuple[str, ...]], structure: str | None) -> str | None:
    """Why something is in doubt, in words."""
    said = []
    for name, rivals in doubts.items():
        if processes := [rival for rival in rivals if rival != OUTPUT_FILTER]:
            said.append(f"this record cannot tell {name} from {' or '.join(processes)}")
        if (corner := corner_hz(found, name)) is not None:
            said.append(filter_text(name, corner))
    if structure is not None and found.still.hidden:
        said.append(structure)
    elif structure is not None:
        said.append(f"there is something that no noise of the catalogue is: {structure}")
    return "; ".join(said) or None


def next_of(found: Search, doubts: Mapping[str, tuple[str, ...]], structure: str | None) -> Experiment | None:
    """The experiment for the first doubt that one can settle."""
    if any(hidden_in(channel.oddities) for channel in found.still.channels):
        return None  # what is to be done about it is said, and no run does it
    if any(rival != OUTPUT_FILTER for rivals in doubts.values() for rival in rivals):
        return separating(found, tuple(doubts))
    shaken = (behind_filter(name, corner) for name in doubts if (corner := corner_hz(found, name)) is not None)
    if (first := next(filter(None, shaken), None)) is not None:
        return first
    if found.patterns:
        return of_pattern(found.patterns[0], found.still.length_s)
    return again(found.still.length_s) if structure is not None else None


def _told(verdict: str, missing: tuple[str, ...], structure: str | None, found: Search) -> Answer:
    doubts = alternatives(found, missing)
    following = next_of(found, {} if verdict == "unexplained" else doubts, structure)
    return Answer(verdict, missing, structure, doubts, reason_of(found, doubts, structure), following)


def _disturbed(found: Search) -> list[str]:
    """Patterns and odd samples: what has a place or a cause of its own."""
    odd = [
        f"of {each.axis}, {oddity.text}" for each in found.still.channels for oddity in each.oddities if oddity.matters
    ]
    return [*(pattern.text for pattern in found.patterns), *odd]


def _share_left(before: NoiseFit, end: NoiseFit) -> float:
    """Of the excess variance, the share that is left."""
    excess = before.pooled_excess**2 - 1
    return (end.pooled_excess**2 - 1) / excess if excess > 0 else 1.0
