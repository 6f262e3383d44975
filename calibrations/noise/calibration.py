"""A still record calibrated for temperature: the terms that the search at one orientation finds, as steps of the loop.

Whether an output follows the temperature at all is decided beside the noise of the record (`patterns`): where both
wander, chance alone makes them alike. What it does is then found by the search for poses at one orientation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from calibrations.design.experiment import Experiment
from calibrations.discovery.findings import Candidate, Step
from calibrations.effects import Effect
from calibrations.model import Model, Term
from calibrations.noise.doubts import CAUSES, experiment_for_pattern
from calibrations.noise.fit import NoiseFit, fit
from calibrations.noise.patterns import FOLLOWS, Pattern
from calibrations.noise.record import Still
from calibrations.noise.search import Search, search, without_patterns
from calibrations.noise.signal import PLACE, TEMPERATURE, SignalSearch, search_signal, signal_terms


@dataclass(frozen=True)
class TemperatureCalibration:
    """Effects of temperature on a record: their search, and the search for noise `after` they are removed."""

    start: NoiseFit
    signal: SignalSearch
    patterns: tuple[Pattern, ...]  # that follow the temperature, beside the noise
    after: Search
    containing: Mapping[str, tuple[str, ...]]  # by effect, those that it contains

    def steps(self, baseline: NoiseFit, patterns: tuple[Pattern, ...]) -> tuple[Step[NoiseFit], ...]:
        """A step for each term, on the record without `patterns`, which the temperature does not make."""
        still = without_patterns(self.start.still, patterns)
        fits = [baseline, *(fit(with_terms(self.start.model, terms), still) for terms in self.signal.steps)]
        return tuple(Step(name, *pair) for name, pair in zip(self.signal.names, pairwise(fits), strict=True))

    def candidates(self, steps: tuple[Step[NoiseFit], ...]) -> tuple[Candidate, ...]:
        """The effects of the steps, each on top of those before it."""
        gains = [2 * (step.after.log_likelihood - step.before.log_likelihood) for step in steps]
        return tuple(
            Candidate(
                effect=step.effect,
                gain=gain,
                p_value=float(np.exp(-max(gain, 0.0) / 2)),
                probability=1.0,
                excess_after=step.after.pooled_excess,
                held_out_after=step.after.held_out_excess,
                indistinguishable_from=self.alternatives.get(step.name, ()),
            )
            for step, gain in zip(steps, gains, strict=True)
        )

    @property
    def alternatives(self) -> dict[str, tuple[str, ...]]:
        """For each cause, the effects that the record cannot separate from it."""
        names = self.signal.names
        rivals = {CAUSES.get((r.kind, r.cause)) for pattern in self.patterns for r in pattern.rivals}
        by_search = self.signal.findings.alternatives
        by_cause = {  # a wider effect whose further shape vanishes is no other cause
            name: tuple(r for r in by_search.get(name, ()) if name not in self.containing.get(r, ()))
            for name in self.signal.causes
        }
        first = self.signal.causes[0]
        by_cause[first] = tuple(dict.fromkeys([*by_cause[first], *sorted(filter(None, rivals - set(names)))]))
        return {name: names_of_rivals for name, names_of_rivals in by_cause.items() if names_of_rivals}

    @property
    def separations(self) -> Mapping[str, Experiment]:
        """For each uncertain cause, the experiment that separates it from its rivals."""
        pattern_in_doubt = next((pattern for pattern in self.patterns if pattern.rivals), None)
        experiment = experiment_for_pattern(pattern_in_doubt, self.start.still.length_s) if pattern_in_doubt else None
        return {self.signal.causes[0]: experiment} if experiment and self.alternatives else {}


def calibrate(search_before: Search, start: NoiseFit, effects: Mapping[str, Effect]) -> TemperatureCalibration | None:
    """Effects of temperature on the record of `search_before`; None if there are none beyond the model."""
    model_terms = signal_terms(start.model)
    warm = tuple(
        pattern for pattern in search_before.patterns if pattern.kind == FOLLOWS and pattern.cause == TEMPERATURE
    )
    if not (warm or model_terms):
        return None
    unrelated = () if model_terms else tuple(pattern for pattern in search_before.patterns if pattern not in warm)
    still = without_patterns(start.still, unrelated)
    lag_s = max(warm, key=lambda pattern: pattern.gain).lag_s if warm else 0.0
    signal = search_signal(still, effects, lag_s, model_terms)
    signal = _without_costly_curves(signal, start.model, still, effects) if signal.steps else signal
    if not signal.names:
        return None
    model = with_terms(start.model, signal.steps[-1])
    search_after = search(fit(model, start.still).still, model, effects)
    return TemperatureCalibration(
        start, signal, warm, search_after, {name: effect.contains for name, effect in effects.items()}
    )


def _without_costly_curves(
    signal: SignalSearch, model: Model, still: Still, effects: Mapping[str, Effect]
) -> SignalSearch:
    """The signal without a curve whose gain in likelihood is below the cost of its coefficients (Schwarz)."""
    for name in signal.names:
        if name in signal.causes:
            continue
        smaller = [signal.without(name, effects, still)]
        if PLACE not in (*signal.names, *signal.given):  # branches of any form may hold a straight line
            smaller.append(signal.with_line(name, effects, still))
        signal = max((signal, *smaller), key=lambda candidate: _penalised_likelihood(candidate, model, still))
    return signal


def _penalised_likelihood(signal: SignalSearch, model: Model, still: Still) -> float:
    """Log-likelihood of the record less these terms, less what their parameters cost."""
    terms = signal.steps[-1]
    count = sum(len(term.estimates) for term in terms)
    return fit(with_terms(model, terms), still).log_likelihood - count * float(np.log(signal.table.n)) / 2


def with_terms(model: Model, terms: tuple[Term, ...]) -> Model:
    """The model with these terms, which replace its terms of the same names or follow the others."""
    by_name = {term.name: term for term in terms}
    new = [term for term in terms if term.name not in model.effects]
    replaced = tuple(by_name.get(term.name, term) for term in model.terms)
    return replace(model, name="+".join([model.name, *(term.name for term in new)]), terms=(*replaced, *new))
