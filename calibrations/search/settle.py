"""The effects that a search has added, put to the test beside each other.

Effects are added one at a time, the first of them while all others are still missing: one may be there in another's
place, or have been fitted from a bad start, or be needed no longer. So each is taken out of the whole. What the model
does as well without is dropped. What then explains more of what is left, be it another effect or the same from another
start, takes its place where the likelihood clearly gains (an exchange step; Miller, Subset Selection in Regression).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from calibrations.effect import Effect
from calibrations.fit import Fit, refit
from calibrations.noise_estimation.likelihood import likelihood
from calibrations.search.candidates import SIGNIFICANT, Candidate, added, candidates
from calibrations.search.determined import lets_go
from calibrations.search.held_out import held_out_excess
from calibrations.search.path import Path, grown
from calibrations.search.rivals import with_rivals
from calibrations.search.screen import chance

MOST_ROUNDS = 6
MOST_EXCHANGED = 6  # effects: so many are no longer sorted out one by one in the time that a person waits
TRIED = 2  # candidates for one place
NEARLY = 0.9  # of the best one's gain
CLEARLY = 6.0  # of twice the log-likelihood beyond the price of parameters: odds of 20 to 1


@dataclass(frozen=True)
class Settled:
    """The final fit, and the effects that it needs beyond the first model."""

    end: Fit
    names: tuple[str, ...]
    found: Mapping[str, tuple[Candidate, ...]]  # for each effect, all candidates once every other one is in the model

    @cached_property
    def beside(self) -> Mapping[str, Candidate]:
        """Each effect of the model as a candidate, with its rivals."""
        own = {name: c for name, others in self.found.items() for c in others if c.name == name}
        return {name: with_rivals(c, self.found[name], _without(self.end, name)) for name, c in own.items()}


def settled(path: Path, effects: Mapping[str, Effect]) -> Settled:
    """What stands of the effects of `path`, and what comes in their place."""
    freed = {term.name for term in path.start.model.terms}
    end, names = path.end, tuple(step.taken.name for step in path.steps)
    found: Mapping[str, tuple[Candidate, ...]] = {}
    for _ in range(MOST_ROUNDS):
        end, names = _needed(end, names, freed)
        if len(names) > MOST_EXCHANGED:
            return Settled(end, names, {})
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
        if chance(*costs[name]) < SIGNIFICANT and held_out_excess(smaller) > held_out_excess(present):
            break
        names = tuple(other for other in names if other != name)
        present = smaller
    return present, names


def _beside(
    path: Path, end: Fit, names: tuple[str, ...], effects: Mapping[str, Effect]
) -> Mapping[str, tuple[Candidate, ...]]:
    """For each effect, all candidates once every other one is in the model."""
    if len(path.steps) == 1 and names == (path.steps[0].taken.name,):
        return {names[0]: path.steps[0].candidates}
    return {name: tuple(candidates(_without(end, name), effects)) for name in names}


def _exchanged(
    end: Fit, names: tuple[str, ...], beside: Mapping[str, tuple[Candidate, ...]], freed: set[str]
) -> tuple[Fit, tuple[str, ...]] | None:
    """The first exchange that makes the model clearly likelier; None where there is none.

    One that is as good counts as well if it makes another effect needless.
    """
    present = likelihood(end)
    for name, found in beside.items():
        for c in _promising(found):
            after = added(_without(end, name), c)
            others = tuple(c.name if other == name else other for other in names)
            if present - CLEARLY < likelihood(after) <= present + CLEARLY and c.name != name:
                after, others = _needed(after, others, freed)
            if likelihood(after) > present + CLEARLY and not lets_go(end, after):
                return after, others
    return None


def _promising(found: tuple[Candidate, ...]) -> list[Candidate]:
    """The best, and those that explain nearly as much."""
    return [c for c in found[:TRIED] if c.gain > NEARLY * found[0].gain]


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
