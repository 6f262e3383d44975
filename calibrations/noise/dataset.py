"""Still records in the loop: a noise model, its spectrum by Whittle's likelihood, and what is not noise.

In the documents `rmse` is the rms mismatch of the spectrum, as a share of it, each band weighted by its degrees of
freedom; `noise_floor` is what chance alone leaves of that, and `excess` their ratio. There is no `slow_noise`: the
model itself describes it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from calibrations.discovery.dataset import Cells, Dataset
from calibrations.discovery.results import Candidate, Comparison, Diagnosis, Discovery, Findings, Place, Step
from calibrations.discovery.verdict import Verdict
from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.errors import ModelError
from calibrations.model import Model
from calibrations.noise.calibration import calibrated
from calibrations.noise.comparison import compare_deviations, evaluate, places
from calibrations.noise.doubts import (
    alternatives,
    as_disturbance,
    disturbance_document,
    disturbances,
    disturbed,
    filter_text,
    next_of,
    possible_corner_hz,
    reason_of,
    record_doubts,
    structure_of,
)
from calibrations.noise.fit import NoiseFit, fit
from calibrations.noise.record import Still, of_record
from calibrations.noise.search import Search, candidates, search, without_patterns
from calibrations.noise.signal import TEMPERATURE, acts_on_record, fit_signal
from calibrations.text import quantity, rounded, sentence

if TYPE_CHECKING:
    from calibrations.presentation.chart import Chart, Picture

HEAD = (
    "model", "log-likelihood gained", "lost without it alone", "mismatch / chance", "other half",
    "mismatch of the Allan deviation",
)  # fmt: skip
LOST = 2  # a column that one step alone does not need
CLEANED = "without non-noise signals"


@dataclass(frozen=True, kw_only=True)
class NoiseFindings(Findings[NoiseFit]):
    """Findings with the search that they come from."""

    search: Search


@dataclass(frozen=True, eq=False)
class StillRecord(Dataset[NoiseFit]):
    """The samples of a still sensor, reduced to what a likelihood needs."""

    still: Still

    form = "samples"
    default_model = "still"
    floor = "chance"
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
        """What the temperature does, then lines, disturbances and every mixture of processes."""
        return self._found(self.fit(model), effects)

    def search_on(self, start: NoiseFit, origin: NoiseFit, effects: Mapping[str, Effect]) -> NoiseFindings:
        """The same from a fitted model."""
        return self._found(fit(start.model, start.still), effects, origin)

    def candidates(
        self, before: NoiseFit, plan: Findings[NoiseFit], effects: Mapping[str, Effect]
    ) -> tuple[Candidate, ...]:
        """Every process alone, the next one of the plan first."""
        processes = candidates(search(before.still, before.model, effects), before, plan.alternatives)
        planned = tuple(c for c in plan.candidates if not c.effect.is_noise and c.name in plan.names)
        return (*planned, *sorted(processes, key=lambda c: c.name not in plan.names[:1]))

    def figures(self, fit: NoiseFit) -> dict[str, str]:
        """Mismatch of the spectrum, also on the other half, and of the Allan deviation."""
        return {
            "mismatch / chance": f"{rounded(fit.pooled_excess)} ×",
            "on the other half": f"{rounded(fit.held_out_excess)} ×",
            "Allan deviation is off by": ", ".join(f"{100 * value:.2g} %" for value in mismatch(fit).values()),
        }

    def facts(self, candidate: Candidate, result: Diagnosis[NoiseFit]) -> dict[str, str]:
        """Mismatch of the spectrum, and the gain in log-likelihood."""
        before, held_out = result.excess_before, result.held_out_before
        return {
            "Mismatch of the spectrum": f"{rounded(before)} → {rounded(candidate.excess_after)} × chance",
            "On the other half": f"{rounded(held_out)} → {rounded(candidate.held_out_after)} × chance",
            "Log-likelihood": f"+{rounded(candidate.gain / 2)}",
        }

    def _found(self, start: NoiseFit, effects: Mapping[str, Effect], origin: NoiseFit | None = None) -> NoiseFindings:
        missing = search(start.still, start.model, effects)
        calibration = calibrated(missing, start, effects)
        missing = calibration.after if calibration else missing
        baseline = fit(start.model, without_patterns(start.still, missing.patterns)) if missing.patterns else start
        signal = calibration.steps(baseline, missing.patterns) if calibration else ()
        present = signal[-1].after if signal else baseline
        structure = structure_of(missing)
        names = () if missing.still.hidden else tuple(missing.gains)
        doubts = alternatives(missing, names) | (calibration.alternatives if calibration else {})
        of_noise = {name: rivals for name, rivals in doubts.items() if name in names}
        spoilt = structure is not None and (missing.still.hidden or disturbed(missing))
        result = NoiseFindings(
            data=self,
            start=start,
            origin=origin or start,
            baseline=baseline,
            steps=(*signal, *_steps(present, missing, names)),
            candidates=(
                *(calibration.candidates(signal) if calibration else ()),
                *candidates(missing, present, alternatives(missing, tuple(missing.gains))),
            ),
            causes=(*(calibration.signal.causes if calibration else ()), *names),
            alternatives=doubts,
            left=structure,
            spoilt=spoilt,
            reason=reason_of(missing, doubts, structure),
            disturbances=tuple(
                disturbance_document(disturbance)
                for disturbance in (
                    *map(as_disturbance, calibration.patterns if calibration else ()),
                    *disturbances(missing),
                )
            ),
            separations=calibration.separations if calibration else {},
            further=next_of(missing, {} if spoilt else of_noise, structure),
            remarks=(
                *(calibration.signal.lags if calibration else ()),
                *(
                    sentence(filter_text(name, corner))
                    for name in doubts
                    if (corner := possible_corner_hz(missing, name))
                ),
                *(sentence(disturbance.text) for disturbance in missing.telegraphs),
            ),
            search=missing,
        )
        if names and not (signal or spoilt) and result.given.verdict is Verdict.UNEXPLAINED:
            return result.without_steps()
        return result

    def addition(self, effect: Effect, model: Model, effects: Mapping[str, Effect]) -> NoiseFindings:
        """One process, with what the record cannot separate from it, and what is missing beside it."""
        before = self.fit(model)
        step = self.step(effect, before)
        first = search(before.still, before.model, effects)
        more = search(step.after.still, step.after.model, {**effects, effect.name: effect})
        doubts = alternatives(first, (effect.name,)) if effect.name in first.gains else {}
        structure = structure_of(more)
        missing = f"{' and '.join(more.gains)} would explain more" if more.gains else None
        return NoiseFindings(
            data=self,
            start=before,
            origin=before,
            baseline=before,
            steps=(step,),
            causes=(effect.name,),
            alternatives=doubts,
            left=structure or missing,
            spoilt=bool(structure or missing),
            reason=reason_of(first, doubts, structure) or missing,
            further=next_of(first, doubts, structure),
            search=more,
        )

    def step(self, effect: Effect, before: NoiseFit) -> Step[NoiseFit]:
        """The effect added."""
        larger = before.model.with_effect(effect)
        after = fit(larger, before.still) if effect.is_noise else self.fit(larger)
        return Step(effect.name, before, after, after.log_likelihood - before.log_likelihood)

    def require_allowed(self, effect: Effect) -> None:
        """Raises ModelError for an effect that is neither noise nor one of a logged temperature."""
        if "still" in effect.kinds:
            return
        if acts_on_record(effect) and all(TEMPERATURE in channel.logged for channel in self.still.channels):
            return
        noises = ", ".join(sorted(name for name, e in catalogue().items() if e.is_noise))
        raise ModelError(
            f"{effect.name} is not noise, and a still record shows only noise, and what a logged temperature does to "
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
        curves = {}
        for channel in result.fit.channels:
            curve = compare_deviations(channel, self.still.allan[channel.channel.axis])
            curves[channel.channel.axis] = {
                "tau_s": curve.tau_s.tolist(),
                "deviation": curve.measured.tolist(),
                "low": curve.low.tolist(),
                "high": curve.high.tolist(),
                "model": curve.modelled.tolist(),
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

    def error_table(self, fit: NoiseFit) -> Cells:
        """Mismatch of the spectrum and of the Allan deviation, beside those by chance."""
        rows = []
        for channel in fit.channels:
            curve = compare_deviations(channel, fit.still.allan[channel.channel.axis])
            shares = (channel.mismatch, channel.floor), (curve.mismatch, curve.by_chance)
            (spectrum, by_chance), (allan, allan_by_chance) = (
                (f"{100 * a:.3g} %", f"{100 * b:.3g} %") for a, b in shares
            )
            rows.append((channel.channel.axis, spectrum, by_chance, f"{channel.excess:.2f}", allan, allan_by_chance))
        head = ("axis", "mismatch of the spectrum", "by chance", "ratio", "of the Allan deviation", "by chance")
        return head, rows

    def comparison_table(self, result: Comparison[NoiseFit]) -> Cells:
        """Measured and modelled Allan deviations."""
        unit, rows = self.unit, []
        for channel in result.fit.channels:
            curve = compare_deviations(channel, self.still.allan[channel.channel.axis])
            for k, tau in enumerate(curve.tau_s):
                shown = [quantity(float(x[k]), unit) for x in (curve.measured, curve.low, curve.high, curve.modelled)]
                off = f"{curve.deviations[k]:+.1f}" if abs(curve.deviations[k]) >= 0.05 else "0"
                rows.append((channel.channel.axis, f"{tau:.4g}", shown[0], f"{shown[1]} .. {shown[2]}", shown[3], off))
        return ("axis", "time (s)", "Allan deviation", "95 % interval", "model", "deviations off"), rows

    def step_table(self, discovery: Discovery[NoiseFit]) -> Cells:
        """Gains that add up, and the mismatch after each step."""
        several = len(discovery.steps) > 1
        chosen = [k for k in range(len(HEAD)) if k != LOST or several]
        rows = [[row[k] for k in chosen] for row in _rows(discovery, several)]
        return tuple(HEAD[k] for k in chosen), [tuple(row) for row in rows]

    def candidate_table(self, result: Diagnosis[NoiseFit], candidates: Sequence[Candidate]) -> Cells:
        """Held-out mismatch, gain, chance and probability of each candidate."""
        rows = [
            (
                c.name,
                f"{result.held_out_before:.3g} -> {c.held_out_after:.3g}",
                f"{c.gain / 2:.4g}" if c.gain > 1e-6 else "0",
                f"{c.p_value:.1g}",
                f"{c.probability:.3f}",
                ", ".join(c.indistinguishable_from) or "-",
            )
            for c in candidates
        ]
        head = (
            "candidate", f"mismatch on {self.unseen} / chance", "log-likelihood", "p-value", "probability",
            "cannot be separated from",
        )  # fmt: skip
        return head, rows

    def fit_chart(self, fit: NoiseFit) -> Chart:
        """Measured and modelled Allan deviations."""
        from calibrations.presentation.charts.noise import fit_chart

        return fit_chart(fit)

    def steps_chart(self, discovery: Discovery[NoiseFit]) -> Chart:
        """Error by model."""
        from calibrations.presentation.charts.noise import steps_chart

        return steps_chart(discovery.start, discovery.steps)

    def fit_album(self, fit: NoiseFit) -> list[Picture]:
        """Allan deviation and spectrum."""
        from calibrations.presentation.charts.noise import still_album

        return still_album(fit, fit)

    def steps_album(self, discovery: Discovery[NoiseFit]) -> list[Picture]:
        """Error by model, Allan deviation and spectrum of the given and of the final model."""
        from calibrations.presentation.charts.noise import steps_picture, still_album

        return [steps_picture(discovery), *still_album(discovery.end, discovery.start)]

    def remarks(self, fit: NoiseFit) -> list[str]:
        """Lines that the log-likelihood does not include."""
        if any(line.frequency_hz > channel.channel.highest_hz for channel in fit.channels for line in channel.lines):
            return ["Lines above half the corner of the low-pass are not part of the fit."]
        return []

    def cautions(self, fit: NoiseFit) -> list[str]:  # noqa: ARG002
        """What a person should check in the record."""
        return record_doubts(self.still.channels)


def mismatch(fit: NoiseFit) -> dict[str, float]:
    """Rms of the logarithm of measured over modelled Allan deviation, by axis."""
    return {
        channel.channel.axis: compare_deviations(channel, fit.still.allan[channel.channel.axis]).mismatch
        for channel in fit.channels
    }


def _steps(start: NoiseFit, search: Search, names: tuple[str, ...]) -> Iterator[Step[NoiseFit]]:
    """The effects one after another, the last fit being that of the search."""
    present = start
    for k, name in enumerate(names):
        last = k == len(search.gains) - 1
        after = search.end if last else fit(present.model.with_effect(search.effects[name]), search.still)
        yield Step(name, present, after, search.gains[name] / 2)
        present = after


def _rows(discovery: Discovery[NoiseFit], several: bool) -> Iterator[tuple[str, ...]]:
    start, baseline = discovery.start, discovery.findings.baseline
    yield _row(start.model.name, start)
    if baseline is not start:
        yield _row(CLEANED, baseline, baseline.log_likelihood - start.log_likelihood)
    for s in discovery.steps:
        gained = s.after.log_likelihood - s.before.log_likelihood
        yield _row(f"+ {s.name}", s.after, gained, s.alone if several else None)


def _row(name: str, fit: NoiseFit, gained: float | None = None, lost: float | None = None) -> tuple[str, ...]:
    """In the order of HEAD. A gain depends on the rows above, and gains add up; losses do not."""
    off = ", ".join(f"{100 * value:.3g} %" for value in mismatch(fit).values())
    shown = ["" if value is None else f"{value:+.5g}" for value in (gained, None if lost is None else -lost)]
    return name, *shown, f"{fit.pooled_excess:.2f}", f"{fit.held_out_excess:.2f}", off
