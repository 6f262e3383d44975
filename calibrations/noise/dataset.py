"""Still records in the loop: a noise model, its spectrum by Whittle's likelihood, and the disturbances.

In the documents `rmse` is the rms mismatch of the spectrum, as a share of it, each band weighted by its degrees of
freedom; `noise_floor` is its expectation by chance, and `excess` their ratio. There is no `slow_noise`: the
model itself describes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from calibrations.design.experiment import Experiment
from calibrations.discovery.dataset import Dataset
from calibrations.discovery.findings import Candidate, Findings, Place, Step
from calibrations.discovery.results import Comparison
from calibrations.discovery.verdict import Verdict
from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.errors import ModelError
from calibrations.model import Model
from calibrations.noise.calibration import TemperatureCalibration, calibrate
from calibrations.noise.comparison import compared_deviations, evaluate, mismatch, places
from calibrations.noise.doubts import (
    alternatives,
    as_disturbance,
    disturbance_document,
    disturbances,
    filter_text,
    has_disturbance,
    next_of,
    possible_corner_hz,
    reason_of,
    record_doubts,
    structure_of,
)
from calibrations.noise.fit import NoiseFit, fit
from calibrations.noise.patterns import Pattern
from calibrations.noise.record import Still, of_record
from calibrations.noise.search import Search, candidates, search, without_patterns
from calibrations.noise.signal import TEMPERATURE, acts_on_record, fit_signal
from calibrations.text import sentence


@dataclass(frozen=True, kw_only=True)
class NoiseFindings(Findings[NoiseFit]):
    """Findings with the search that they come from."""

    search: Search


@dataclass(frozen=True)
class _SignalFindings:
    """The part of the findings that the temperature causes; empty without effects of temperature."""

    steps: tuple[Step[NoiseFit], ...] = ()
    candidates: tuple[Candidate, ...] = ()
    causes: tuple[str, ...] = ()
    alternatives: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    separations: Mapping[str, Experiment] = field(default_factory=dict)
    patterns: tuple[Pattern, ...] = ()
    lags: tuple[str, ...] = ()


def _signal_findings(calibration: TemperatureCalibration, baseline: NoiseFit, missing: Search) -> _SignalFindings:
    steps = calibration.steps(baseline, missing.patterns)
    return _SignalFindings(
        steps,
        calibration.candidates(steps),
        calibration.signal.causes,
        calibration.alternatives,
        calibration.separations,
        calibration.patterns,
        calibration.signal.lags,
    )


@dataclass(frozen=True, eq=False)
class StillRecord(Dataset[NoiseFit]):
    """The samples of a still sensor, reduced for the likelihood."""

    still: Still

    form = "samples"
    default_model = "still"
    floor = "the scatter by chance"
    unseen = "the other half of the record"
    complete = "The model fails nowhere: the differences are chance."

    @property
    def source(self) -> str:
        """File or run."""
        return self.still.source

    @property
    def content(self) -> str:
        """The kind of data, as models are defined for it."""
        return "still"

    @property
    def n(self) -> int:
        """Samples of a channel."""
        return self.still.n

    @property
    def unit(self) -> str:
        """Unit of the outputs."""
        return self.still.unit

    @property
    def axes(self) -> tuple[str, ...]:
        """Channels."""
        return self.still.axes

    @property
    def description(self) -> str:
        """Samples, source, rate and length."""
        return of_record(self.still)

    def fit(self, model: Model) -> NoiseFit:
        """Whittle's likelihood of the record less the model's signal. Raises ModelError for a model without noise."""
        return fit(fit_signal(model, self.still, catalogue()), self.still)

    def evaluate(self, model: Model) -> NoiseFit | None:
        """The model with its values. Raises DataError for a channel without values."""
        return evaluate(model, self.still)

    def places(self, fit: NoiseFit) -> tuple[Place, ...]:
        """Averaging times and frequencies."""
        return places(fit)

    def search(self, model: Model, effects: Mapping[str, Effect]) -> NoiseFindings:
        """Effects of temperature, then lines, disturbances and every mixture of processes."""
        return self._search(self.fit(model), effects)

    def search_on(self, start: NoiseFit, origin: NoiseFit, effects: Mapping[str, Effect]) -> NoiseFindings:
        """Search for missing effects, starting from a fitted model."""
        return self._search(fit(start.model, start.still), effects, origin)

    def candidates(
        self, base: NoiseFit, plan: Findings[NoiseFit], effects: Mapping[str, Effect]
    ) -> tuple[Candidate, ...]:
        """Every process alone, the next one of the plan first."""
        processes = candidates(search(base.still, base.model, effects), base, plan.alternatives)
        planned = tuple(c for c in plan.candidates if not c.effect.is_noise and c.name in plan.names)
        return (*planned, *sorted(processes, key=lambda c: c.name not in plan.names[:1]))

    def _search(self, start: NoiseFit, effects: Mapping[str, Effect], origin: NoiseFit | None = None) -> NoiseFindings:
        first = search(start.still, start.model, effects)
        calibration = calibrate(first, start, effects)
        missing = calibration.after if calibration else first
        baseline = fit(start.model, without_patterns(start.still, missing.patterns)) if missing.patterns else start
        signal = _signal_findings(calibration, baseline, missing) if calibration else _SignalFindings()
        present = signal.steps[-1].after if signal.steps else baseline
        structure = structure_of(missing)
        names = () if missing.still.hidden else tuple(missing.gains)
        doubts = {**alternatives(missing, names), **signal.alternatives}
        of_noise = {name: rivals for name, rivals in doubts.items() if name in names}
        is_spoilt = structure is not None and (missing.still.hidden or has_disturbance(missing))
        found = (*map(as_disturbance, signal.patterns), *disturbances(missing))
        result = NoiseFindings(
            data=self,
            start=start,
            origin=origin or start,
            baseline=baseline,
            steps=(*signal.steps, *_steps(present, missing, names)),
            candidates=(
                *signal.candidates,
                *candidates(missing, present, alternatives(missing, tuple(missing.gains))),
            ),
            causes=(*signal.causes, *names),
            alternatives=doubts,
            left=structure,
            spoilt=is_spoilt,
            reason=reason_of(missing, doubts, structure),
            disturbances=tuple(map(disturbance_document, found)),
            separations=signal.separations,
            further=next_of(missing, {} if is_spoilt else of_noise, structure),
            remarks=(*signal.lags, *_remarks(missing, doubts)),
            search=missing,
        )
        if names and not (signal.steps or is_spoilt) and result.given.verdict is Verdict.UNEXPLAINED:
            return result.without_steps()
        return result

    def addition(self, effect: Effect, model: Model, effects: Mapping[str, Effect]) -> NoiseFindings:
        """Add one process; report those that the record cannot separate from it, and further missing ones."""
        base = self.fit(model)
        step = self.step(effect, base)
        first = search(base.still, base.model, effects)
        next_search = search(step.after.still, step.after.model, {**effects, effect.name: effect})
        doubts = alternatives(first, (effect.name,)) if effect.name in first.gains else {}
        structure = structure_of(next_search)
        missing = f"{' and '.join(next_search.gains)} would explain more" if next_search.gains else None
        return NoiseFindings(
            data=self,
            start=base,
            origin=base,
            baseline=base,
            steps=(step,),
            causes=(effect.name,),
            alternatives=doubts,
            left=structure or missing,
            spoilt=bool(structure or missing),
            searched=missing is None,
            reason=reason_of(first, doubts, structure) or missing,
            further=next_of(first, doubts, structure),
            search=next_search,
        )

    def step(self, effect: Effect, base: NoiseFit) -> Step[NoiseFit]:
        """The effect added."""
        larger = base.model.with_effect(effect)
        extended = fit(larger, base.still) if effect.is_noise else self.fit(larger)
        return Step(effect.name, base, extended, extended.log_likelihood - base.log_likelihood)

    def require_allowed(self, effect: Effect) -> None:
        """Raises ModelError for an effect that is neither noise nor one of a logged temperature."""
        if "still" in effect.kinds:
            return
        if acts_on_record(effect) and all(TEMPERATURE in channel.logged for channel in self.still.channels):
            return
        noises = ", ".join(sorted(name for name, e in catalogue().items() if e.is_noise))
        raise ModelError(
            f"{effect.name} is not noise; a still record shows only noise and the effects of a logged temperature on "
            f"the bias; effects of noise: {noises}"
        )

    def errors_document(self, fit: NoiseFit) -> dict[str, Any]:
        """Mismatch of the spectrum by axis, and of the Allan deviation."""
        fits = {channel.channel.axis: channel for channel in fit.channels}
        return {
            "rmse": {axis: channel.mismatch for axis, channel in fits.items()},
            "noise_floor": {axis: channel.floor for axis, channel in fits.items()},
            "excess": {axis: channel.excess for axis, channel in fits.items()},
            "log_likelihood": {axis: channel.log_likelihood for axis, channel in fits.items()},
            "allan_mismatch": mismatch(fit),
        }

    def comparison_fields(self, result: Comparison[NoiseFit]) -> dict[str, Any]:
        """The Allan deviations that are compared."""
        curves = {
            axis: {
                "tau_s": curve.tau_s.tolist(),
                "deviation": curve.measured.tolist(),
                "low": curve.low.tolist(),
                "high": curve.high.tolist(),
                "model": curve.modelled.tolist(),
            }
            for axis, curve in compared_deviations(result.fit).items()
        }
        return {"allan": curves}

    def step_fields(self, step: Step[NoiseFit]) -> dict[str, Any]:
        """Log-likelihoods and mismatches of the Allan deviation."""
        return {
            "log_likelihood_before": step.before.log_likelihood,
            "log_likelihood_after": step.after.log_likelihood,
            "log_likelihood_alone": step.alone,
            "allan_mismatch_before": mismatch(step.before),
            "allan_mismatch_after": mismatch(step.after),
        }

    def candidate_fields(self, candidate: Candidate) -> dict[str, Any]:
        """The gain in log-likelihood."""
        return {"log_likelihood_gain": candidate.gain / 2}

    def remarks(self, fit: NoiseFit) -> list[str]:
        """Lines that the log-likelihood does not include."""
        if any(line.frequency_hz > channel.channel.highest_hz for channel in fit.channels for line in channel.lines):
            return ["Lines above half the corner of the low-pass are not part of the fit."]
        return []

    def cautions(self, fit: NoiseFit) -> list[str]:  # noqa: ARG002
        """The points that a person should check in the record."""
        return record_doubts(self.still.channels)


def _remarks(result: Search, doubts: Iterable[str]) -> Iterator[str]:
    """Sentences on filters that effects in doubt may come from, and on telegraph noise."""
    for name in doubts:
        if corner := possible_corner_hz(result, name):
            yield sentence(filter_text(name, corner))
    for disturbance in result.telegraphs:
        yield sentence(disturbance.text)


def _steps(start: NoiseFit, search: Search, names: tuple[str, ...]) -> Iterator[Step[NoiseFit]]:
    """The effects one after another, the last fit being that of the search."""
    present = start
    for k, name in enumerate(names):
        last = k == len(search.gains) - 1
        extended = search.end if last else fit(present.model.with_effect(search.effects[name]), search.still)
        yield Step(name, present, extended, search.gains[name] / 2)
        present = extended
