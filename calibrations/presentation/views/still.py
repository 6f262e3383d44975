"""Still records: mismatch of the spectrum and of the Allan deviation, compared with chance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.findings import Candidate
from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.noise.comparison import compared_deviations, mismatch
from calibrations.noise.fit import NoiseFit
from calibrations.presentation.views.view import ONLY_ONE, View, candidate_cells
from calibrations.text import Cells, quantity, rounded

if TYPE_CHECKING:
    from calibrations.presentation.chart import Chart, Picture

HEAD = (
    "model", "log-likelihood gained", "lost without it alone", "mismatch / chance", "other half",
    "mismatch of the Allan deviation",
)  # fmt: skip
LOST_COLUMN = 2  # a column that one step alone does not need
CLEANED_NAME = "without non-noise signals"  # the given model on the record without disturbances


@dataclass(frozen=True)
class StillView(View[NoiseFit]):
    """Results of a still record."""

    data: Dataset[NoiseFit]

    def figures(self, fit: NoiseFit) -> dict[str, str]:
        """Mismatch of the spectrum, also on the other half, and of the Allan deviation."""
        return {
            "mismatch / chance": f"{rounded(fit.pooled_excess)} ×",
            "on the other half": f"{rounded(fit.held_out_excess)} ×",
            "Allan deviation differs from the model by": ", ".join(
                f"{100 * value:.2g} % in {axis}" for axis, value in mismatch(fit).items()
            ),
        }

    def facts(self, candidate: Candidate, diagnosis: Diagnosis[NoiseFit]) -> dict[str, str]:
        """Mismatch of the spectrum, and the gain in log-likelihood."""
        excess_before, held_out = diagnosis.excess_before, diagnosis.held_out_before
        return {
            "Mismatch of the spectrum": f"{rounded(excess_before)} → {rounded(candidate.excess_after)} × chance",
            "On the other half": f"{rounded(held_out)} → {rounded(candidate.held_out_after)} × chance",
            "Log-likelihood": f"+{rounded(candidate.gain / 2)}",
        }

    def error_table(self, fit: NoiseFit) -> Cells:
        """Mismatch of the spectrum and of the Allan deviation, with the mismatch by chance."""
        rows = []
        curves = compared_deviations(fit)
        for channel in fit.channels:
            axis = channel.channel.axis
            shares = (channel.mismatch, channel.floor), (curves[axis].mismatch, curves[axis].by_chance)
            (spectrum, by_chance), (allan, allan_by_chance) = (
                (f"{100 * a:.3g} %", f"{100 * b:.3g} %") for a, b in shares
            )
            rows.append((axis, spectrum, by_chance, f"{channel.excess:.2f}", allan, allan_by_chance))
        head = ("axis", "mismatch of the spectrum", "by chance", "ratio", "of the Allan deviation", "by chance")
        return head, rows

    def comparison_table(self, comparison: Comparison[NoiseFit]) -> Cells:
        """Measured and modelled Allan deviations."""
        unit, rows = self.data.unit, []
        for axis, curve in compared_deviations(comparison.fit).items():
            for k, tau in enumerate(curve.tau_s):
                texts = [quantity(float(x[k]), unit) for x in (curve.measured, curve.low, curve.high, curve.modelled)]
                off = f"{curve.deviations[k]:+.1f}" if abs(curve.deviations[k]) >= 0.05 else "0"
                rows.append((axis, f"{tau:.4g}", texts[0], f"{texts[1]} .. {texts[2]}", texts[3], off))
        return ("axis", "time (s)", "Allan deviation", "95 % interval", "model", "deviations off"), rows

    def step_table(self, discovery: Discovery[NoiseFit]) -> Cells:
        """Gains that add up, and the mismatch after each step."""
        column_numbers = [k for k in range(len(HEAD)) if k != LOST_COLUMN or len(discovery.steps) > 1]
        rows = (_row(*row) for row in gains(discovery))
        return tuple(HEAD[k] for k in column_numbers), [tuple(row[k] for k in column_numbers) for row in rows]

    def candidate_table(self, diagnosis: Diagnosis[NoiseFit], candidates: Sequence[Candidate]) -> Cells:
        error = f"mismatch on {self.data.unseen} / chance"
        return candidate_cells(diagnosis, candidates, error, ONLY_ONE, gains=True)

    def fit_chart(self, fit: NoiseFit) -> Chart:
        """Measured and modelled Allan deviations."""
        from calibrations.presentation.charts.noise import fit_chart  # text needs no charts

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


def gains(discovery: Discovery[NoiseFit]) -> Iterator[tuple[str, float | None, float | None, NoiseFit]]:
    """For each model: name, log-likelihood gained over the row above, and lost without this effect alone, fit.

    Gains add up; losses do not. None where there is nothing to compare with.
    """
    start, baseline = discovery.start, discovery.findings.baseline
    yield start.model.name, None, None, start
    if baseline is not start:
        yield CLEANED_NAME, baseline.log_likelihood - start.log_likelihood, None, baseline
    for step in discovery.steps:
        yield f"+ {step.name}", step.after.log_likelihood - step.before.log_likelihood, step.alone, step.after


def _row(name: str, gained: float | None, loss: float | None, fit: NoiseFit) -> tuple[str, ...]:
    """Cells of one row, in the order of HEAD."""
    off = ", ".join(f"{100 * value:.3g} %" for value in mismatch(fit).values())
    texts = ["" if value is None else f"{value:+.5g}" for value in (gained, None if loss is None else -loss)]
    return name, *texts, f"{fit.pooled_excess:.2f}", f"{fit.held_out_excess:.2f}", off
