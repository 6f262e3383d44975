"""The search for missing effects: forward steps, then exchanges.

Forward: the search adds the best candidate as long as it is significant and lowers the error on unseen rows.

Exchange: the first effects were added while all others were still missing. Such an effect may describe what another one
causes, have a bad start, or be needless. The search removes each effect in turn. It drops the effect if the model does
as well without it, and exchanges it if another candidate makes the model clearly likelier (Miller, Subset Selection in
Regression).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from calibrations.criteria import (
    CANDIDATES_FOR_A_PLACE,
    CLEARLY_BETTER,
    EXCHANGE_ROUNDS,
    LEAST_SHARE,
    MATERIAL,
    MOST_EFFECTS,
    MOST_EXCHANGED,
    NEARLY_AS_GOOD,
    SIGNIFICANT,
)
from calibrations.discovery.candidates import RowCandidate, best_pair, candidates, refit_with, with_rivals
from calibrations.discovery.significance import chance, likelihood
from calibrations.effects import Effect
from calibrations.fitting.determined import loses_parameters
from calibrations.fitting.fit import Fit, refit
from calibrations.means.noise import rms


@dataclass(frozen=True)
class ForwardStep:
    """One forward step: the fits before and after it, all candidates on the fit before, and the selected one."""

    before: Fit
    after: Fit
    candidates: tuple[RowCandidate, ...]
    selected: RowCandidate

    @cached_property
    def held_out_before(self) -> float:
        """Pooled excess on unseen poses without the effect."""
        return self.before.held_out_excess

    @property
    def held_out_after(self) -> float:
        """Pooled excess on unseen poses with it."""
        return self.selected.held_out_after


@dataclass(frozen=True)
class Path:
    """The forward steps from a model to the last one to which the search could add an effect."""

    start: Fit
    steps: tuple[ForwardStep, ...]
    last_candidates: tuple[RowCandidate, ...]  # candidates of the last search
    outliers: tuple[int, ...] = ()  # poses that were set aside

    @property
    def end(self) -> Fit:
        """The last fit."""
        return self.steps[-1].after if self.steps else self.start

    @property
    def ranked(self) -> tuple[RowCandidate, ...]:
        """Candidates on the given model, best first."""
        return self.steps[0].candidates if self.steps else self.last_candidates

    @cached_property
    def first(self) -> tuple[RowCandidate, ...]:
        """Candidates on the given model: first the selected one with all its rivals, then the others."""
        if not self.steps:
            return self.last_candidates
        step = self.steps[0]
        best = with_rivals(step.selected, step.candidates, step.before)
        return best, *(c for c in step.candidates if c is not step.selected)


def find_path(
    start: Fit, outliers: tuple[int, ...], effects: Mapping[str, Effect], max_steps: int = MOST_EFFECTS
) -> Path:
    """Add the best effect to a fit until none is significant, `max_steps` effects at most."""
    path = extend_path(Path(start.in_floor(start.noise.floor), (), (), outliers), effects, max_steps)
    return in_final_floor(path, path.end)


def is_complete(path: Path) -> bool:
    """Whether no candidate on top of the last model is significant and helps."""
    explained = bool(path.steps) and path.end.share_left(path.start) <= 0  # no further candidates were asked for
    return explained or _next(path.end, list(path.last_candidates)) is None


def extend_path(path: Path, effects: Mapping[str, Effect], max_steps: int = MOST_EFFECTS) -> Path:
    """Continue the forward search from the last model."""
    present, steps = path.end, list(path.steps)
    ranked = candidates(present, effects)
    while len(steps) < max_steps:
        step = _next(present, ranked)
        if step is None:
            break
        steps.append(step)
        present = step.after
        if present.noise.known and present.share_left(path.start) <= 0:
            break
        ranked = candidates(present, effects)
    return Path(path.start, tuple(steps), tuple(ranked), path.outliers)


def continue_path(path: Path, effects: Mapping[str, Effect]) -> Path:
    """Continue the forward search of a path that ended after its first step."""
    complete = not path.steps or path.end.share_left(path.start) <= 0
    return path if complete else in_final_floor(further := extend_path(path, effects), further.end)


def in_final_floor(path: Path, end: Fit) -> Path:
    """The path with all errors in multiples of the residual of `end`, if that residual is the only measure of noise."""
    if end.noise.known:
        return path
    floor = end.noise.scatter
    times = float(rms(path.end.noise.floor) / rms(floor))

    def rescale(c: RowCandidate) -> RowCandidate:
        return replace(c, excess_after=times * c.excess_after, held_out_after=times * c.held_out_after)

    def rescale_step(s: ForwardStep) -> ForwardStep:
        rescaled_candidates = tuple(map(rescale, s.candidates))
        selected = next(
            c for c, candidate in zip(rescaled_candidates, s.candidates, strict=True) if candidate is s.selected
        )
        return ForwardStep(s.before.in_floor(floor), s.after.in_floor(floor), rescaled_candidates, selected)

    return Path(
        path.start.in_floor(floor),
        tuple(map(rescale_step, path.steps)),
        tuple(map(rescale, path.last_candidates)),
        path.outliers,
    )


def _next(present: Fit, ranked: list[RowCandidate]) -> ForwardStep | None:
    """The step with the best candidate that is significant and, refitted, lowers the error on unseen poses.

    If there is none, the residual is large and the orientations are not known: the stronger candidate of the best pair;
    the next step adds the other.
    """
    for c in ranked[:3]:
        if c.p_value >= SIGNIFICANT or _explained_share(present, c.excess_after) < LEAST_SHARE / 2:
            continue
        step = _forward_step(present, ranked, c)
        if loses_parameters(present, step.after):
            continue
        if (
            step.held_out_after < step.held_out_before
            and _explained_share(present, step.after.pooled_excess) >= LEAST_SHARE
        ):
            return step
    if present.table.type.stage_angles or present.pooled_excess <= MATERIAL:
        return None  # with known orientation, one effect is visible while another is missing
    pair = best_pair(present, ranked)
    return _forward_step(present, ranked, pair[0]) if pair else None


def _explained_share(present: Fit, excess_after: float) -> float:
    """Part of the excess variance over the noise floor that an effect explains; 1 if there is hardly any excess."""
    square_before = present.pooled_excess**2
    return (square_before - excess_after**2) / (square_before - 1) if square_before > MATERIAL**2 else 1.0


def _forward_step(present: Fit, ranked: list[RowCandidate], c: RowCandidate) -> ForwardStep:
    """The step that adds `c`, with the errors of the full fit."""
    extended = refit_with(present, c)
    fitted_candidate = replace(c, excess_after=extended.pooled_excess, held_out_after=extended.held_out_excess)
    return ForwardStep(
        present,
        extended,
        tuple(fitted_candidate if candidate is c else candidate for candidate in ranked),
        fitted_candidate,
    )


@dataclass(frozen=True)
class FinalModel:
    """The final fit, and the effects that it needs beyond the first model."""

    end: Fit
    names: tuple[str, ...]
    candidates_by_effect: Mapping[str, tuple[RowCandidate, ...]]  # on the model without the effect
    tested: bool = True  # whether the effects were tested against each other

    @cached_property
    def effect_candidates(self) -> Mapping[str, RowCandidate]:
        """Each effect of the model as a candidate, with its rivals."""
        added_effects = {
            name: c for name, ranked in self.candidates_by_effect.items() for c in ranked if c.name == name
        }
        return {
            name: with_rivals(c, self.candidates_by_effect[name], _refit_without(self.end, name))
            for name, c in added_effects.items()
        }


def final_model(path: Path, effects: Mapping[str, Effect]) -> FinalModel:
    """The model at the end of `path` after exchanges: without needless effects, and with better ones in their place."""
    freed = {term.name for term in path.start.model.terms}
    end, names = path.end, tuple(step.selected.name for step in path.steps)
    candidates_by_effect: Mapping[str, tuple[RowCandidate, ...]] = {}
    for _ in range(EXCHANGE_ROUNDS):
        end, names = _drop_needless(end, names, freed)
        if len(names) > MOST_EXCHANGED:
            return FinalModel(end, names, {}, tested=False)
        candidates_by_effect = _candidates_by_effect(
            path, end, tuple(name for name in names if name not in freed), effects
        )
        exchange = _first_exchange(end, names, candidates_by_effect, freed)
        if exchange is None:
            break
        further = extend_path(Path(exchange[0], (), ()), effects)
        end, names = further.end, (*exchange[1], *(step.selected.name for step in further.steps))
    return FinalModel(end, names, candidates_by_effect)


def _drop_needless(present: Fit, names: tuple[str, ...], freed: set[str]) -> tuple[Fit, tuple[str, ...]]:
    """The model without the added effects that it does not need; the effect of least cost goes first."""
    while len(names) > 1 and (removable := [name for name in names if name not in freed]):
        cost_of = cost if len(names) <= MOST_EXCHANGED else first_order_cost
        costs = {name: cost_of(present, name) for name in removable}
        name = min(costs, key=lambda n: costs[n][0] / max(costs[n][1], 1))
        reduced = _refit_without(present, name)
        is_needed = chance(*costs[name]) < SIGNIFICANT and reduced.held_out_excess > present.held_out_excess
        if is_needed or loses_parameters(present, reduced):
            break
        names = tuple(n for n in names if n != name)
        present = reduced
    return present, names


def _candidates_by_effect(
    path: Path, end: Fit, names: tuple[str, ...], effects: Mapping[str, Effect]
) -> Mapping[str, tuple[RowCandidate, ...]]:
    """By effect, all candidates on the model without that effect."""
    if len(path.steps) == 1 and names == (path.steps[0].selected.name,):
        return {names[0]: path.steps[0].candidates}
    return {name: tuple(candidates(_refit_without(end, name), effects)) for name in names}


def _first_exchange(
    end: Fit, names: tuple[str, ...], candidates_by_effect: Mapping[str, tuple[RowCandidate, ...]], freed: set[str]
) -> tuple[Fit, tuple[str, ...]] | None:
    """The first exchange that makes the model clearly likelier; None if no exchange does.

    An exchange for an equally likely effect counts as well if it makes a third effect needless.
    """
    present = likelihood(end)
    for name, ranked in candidates_by_effect.items():
        for c in _select_promising(ranked):
            exchanged = refit_with(_refit_without(end, name), c)
            exchanged_names = tuple(c.name if n == name else n for n in names)
            if present - CLEARLY_BETTER < likelihood(exchanged) <= present + CLEARLY_BETTER and c.name != name:
                exchanged, exchanged_names = _drop_needless(exchanged, exchanged_names, freed)
            if likelihood(exchanged) > present + CLEARLY_BETTER and not loses_parameters(end, exchanged):
                return exchanged, exchanged_names
    return None


def _select_promising(ranked: tuple[RowCandidate, ...]) -> list[RowCandidate]:
    """The best candidate, and those that explain nearly as much."""
    return [c for c in ranked[:CANDIDATES_FOR_A_PLACE] if c.gain > NEARLY_AS_GOOD * ranked[0].gain]


@lru_cache(maxsize=16)
def _refit_without(end: Fit, name: str) -> Fit:
    return refit(end, end.model.without(name))


def cost(end: Fit, name: str) -> tuple[float, int]:
    """Growth of the whitened sum of squares without the effect, and the number of its parameters."""
    residual_without = end.noise.whiten(_refit_without(end, name).residual[:, :, None])[:, 0]
    present = end.whitened[:, 0]
    return float(residual_without @ residual_without - present @ present), int(end.problem.layout.of_effect(name).sum())


def first_order_cost(end: Fit, *names: str, shared: bool = False) -> tuple[float, int]:
    """The same to first order, of one or more effects together.

    shared  growth if the axes share one value of each parameter, instead of without
    """
    white, mask = end.whitened[:, 1:], np.any([end.problem.layout.of_effect(name) for name in names], axis=0)
    size = np.linalg.norm(white, axis=0)
    white = white / np.where(size > 0, size, 1.0)
    value = end.theta[mask] - (end.theta[mask].mean() if shared else 0.0)
    signal = white[:, mask] @ (value * size[mask])
    other_columns = white[:, ~mask]
    lost_signal = signal - other_columns @ np.linalg.lstsq(other_columns, signal, rcond=1e-9)[0]
    return float(lost_signal @ lost_signal), int(mask.sum())
