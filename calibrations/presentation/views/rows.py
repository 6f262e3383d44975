"""Poses, positions, fields, rates and motion: errors and noise floor, bars of the error, residual charts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.findings import Candidate
from calibrations.discovery.results import Diagnosis, Discovery
from calibrations.discovery.summary import step_shares
from calibrations.discovery.verdict import Verdict
from calibrations.fitting.fit import Fit, milli_unit, pool_in_milli
from calibrations.presentation.views.view import ONLY_ONE, View, candidate_cells
from calibrations.text import Cells, milli_amount, quantity, rounded

if TYPE_CHECKING:
    from calibrations.presentation.chart import Chart, Picture

LONGEST_BAR = 40  # characters


@dataclass(frozen=True)
class RowsView(View[Fit]):
    """Results of a table of rows."""

    data: Dataset[Fit]

    def figures(self, fit: Fit) -> dict[str, str]:
        """Error, held-out error and noise floor."""
        (error, floor), unit = pool_in_milli(fit), milli_unit(fit)
        return {
            "error": f"{rounded(fit.pooled_excess)} × ({milli_amount(error, unit, 2)})",
            f"on {self.data.unseen}": f"{rounded(fit.held_out_excess)} ×",
            "noise floor": milli_amount(floor, unit, 2),
        }

    def facts(self, candidate: Candidate, diagnosis: Diagnosis[Fit]) -> dict[str, str]:
        """Error on the rows of the fit, and on unseen rows."""
        return {
            f"Error, {diagnosis.fit.table.type.rows} of the fit": _fall(
                diagnosis.excess_before, candidate.excess_after
            ),
            f"Error, {self.data.unseen}": _fall(diagnosis.held_out_before, candidate.held_out_after),
        }

    def error_table(self, fit: Fit) -> Cells:
        """Residual, noise floor and slow noise of each channel."""
        unit = fit.problem.unit
        rows = [
            (
                channel,
                quantity(fit.rmse[c], unit),
                quantity(fit.noise.floor[c], unit),
                quantity(fit.noise.slow[c], unit),
                f"{fit.excess[c]:.2f}",
            )
            for c, channel in enumerate(fit.channels)
        ]
        floor = "noise floor" if fit.noise.known else "scatter (noise floor not known)"
        return ("axis", "rms error", floor, "slow noise", "error / floor"), rows

    def step_table(self, discovery: Discovery[Fit]) -> Cells:
        """The error of each model, with bars."""
        start = discovery.start
        fits = [(start.model.name, start), *((f"+ {s.name}", s.after) for s in discovery.steps)]
        shares = ["", *("-" if share is None else f"{100 * share:z.1f} %" for share in step_shares(discovery))]
        rows = [
            (name, f"{fit.pooled_excess:.2f}", f"{fit.held_out_excess:.2f}", share, _bar(fit, start))
            for (name, fit), share in zip(fits, shares, strict=True)
        ]
        return ("model", "error / floor", self.data.unseen, "share", ""), rows

    def candidate_table(self, diagnosis: Diagnosis[Fit], candidates: Sequence[Candidate]) -> Cells:
        chance = "if it is one of these" if diagnosis.verdict is Verdict.UNEXPLAINED else ONLY_ONE
        return candidate_cells(diagnosis, candidates, f"error on {self.data.unseen} / floor", chance)

    def fit_chart(self, fit: Fit) -> Chart:
        """The residual."""
        from calibrations.presentation.charts.fit import residual_chart  # text needs no charts

        return residual_chart(fit)

    def steps_chart(self, discovery: Discovery[Fit]) -> Chart:
        """Error by model."""
        from calibrations.presentation.charts.discovery import levels, waterfall

        return waterfall(levels(discovery))

    def fit_album(self, fit: Fit) -> list[Picture]:
        """Measurement and model, the residual, and its pattern."""
        from calibrations.presentation.charts.fit import fit_album

        return fit_album(fit)

    def steps_album(self, discovery: Discovery[Fit]) -> list[Picture]:
        """Error by model, each effect's curve, and the curves of places."""
        from calibrations.presentation.charts.discovery import steps_album

        return steps_album(discovery)


def _fall(error_before: float, error_after: float) -> str:
    return f"{rounded(error_before)} → {rounded(error_after)} × the noise floor"


def _bar(fit: Fit, first: Fit) -> str:
    """A bar as long as the logarithm of the error over the noise floor."""
    longest = float(np.log(max(first.pooled_excess, 1.1)))
    return "#" * max(1, round(LONGEST_BAR * float(np.log(max(fit.pooled_excess, 1.0))) / longest))
