"""The calibration itself on the model page: parameters, correlations, noise coefficients, and documents from them."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import ui

from calibrations.model.file import dump_model
from calibrations.noise.analysis import NoiseAnalysis
from calibrations.noise.dataset import NoiseFindings
from calibrations.presentation.noise_text import typeset_coefficients
from calibrations.presentation.parameter_table import HEAD, STRONG, correlations, parameter_rows, tab_separated
from calibrations.text import minus
from rig.web.calculations import off_loop
from rig.web.pages.model_documents import CertificateDialog, CompensationDialog
from rig.web.parts import afresh, box, button, div, for_page, message, notify_error, table, wide_table, words

if TYPE_CHECKING:
    from calibrations.discovery.results import Diagnosis
    from calibrations.presentation.parameter_table import CorrelatedPair, ParameterRow
    from rig.services.session import ModelSession
    from rig.web.pages.model import Workbench

MOST_PAIRS = 12
COPY = """(text) => {
  const old = () => { const t = document.createElement('textarea'); t.value = text; document.body.append(t); t.select();
    document.execCommand('copy'); t.remove(); };
  return navigator.clipboard ? navigator.clipboard.writeText(text).catch(old) : old();
}"""


class ParametersBox:
    """The parameters of the present model, and buttons for documents from them."""

    def __init__(self, page: Workbench) -> None:
        self.page = page
        self.rows: list[ParameterRow] = []
        self.turn = 0
        with box("parameters stack") as self.box:
            with div("row-of"):
                words("Parameters", "title spread")
                self.buttons = [
                    button("Copy table", "content_copy", self.copy),
                    button("Download model", "download", self.download),
                    button("Certificate", "workspace_premium", self.certificate),
                    button("Compensation", "code", self.compensation),
                ]
                for choice in self.buttons:
                    choice.disable()
            self.values = wide_table()
            self.pairs = div("stack")
            self.noise = div("stack")

    async def show(self, session: ModelSession[Any]) -> None:
        """Show the parameters of the session's model; the change is that by the last effect."""
        self.turn += 1
        turn = self.turn
        earlier_model = session.steps[-1].before.model if session.steps else None
        self.rows = await off_loop(parameter_rows, session.end.model, earlier_model)
        if turn != self.turn:
            return
        rows = session.data.form == "rows"
        for choice, usable in zip(self.buttons, (True, True, rows, rows), strict=True):
            choice.set_enabled(usable)
        head = HEAD if session.steps else HEAD[:-1]  # without a step there is no change
        with afresh(self.values):
            table(head, [_cells(row)[: len(head)] for row in self.rows])
        self.noise.clear()
        self.pairs.clear()
        try:
            pairs = await off_loop(correlations, session.end)
        except Exception as error:
            with self.pairs:
                words(f"No correlations: {message(error)}", "quiet small")
            return
        if turn == self.turn:
            with afresh(self.pairs):
                _pairs(pairs)

    def diagnosed(self, result: Diagnosis[Any]) -> None:
        """Show the noise coefficients of a still record: those of `rig noise`, from the search that has just ended."""
        findings = result.findings
        if not isinstance(findings, NoiseFindings):
            return
        still = findings.data.still  # type: ignore[attr-defined] # the data of noise findings are a still record
        with afresh(self.noise):
            for axis, noise in NoiseAnalysis(still, findings.search).channels.items():
                words(f"Noise coefficients of {axis}, by all processes that the search found", "title")
                (head, rows), density = typeset_coefficients(noise, still.sensed.get(axis))
                with wide_table().classes("coefficients"):
                    table(head, rows)
                words(density, "quiet small")

    async def copy(self) -> None:
        """Copy the table for a spreadsheet."""
        ui.run_javascript(f"({COPY})({json.dumps(tab_separated(self.rows))})")
        ui.notify("The table is in the clipboard.", type="positive")

    def download(self) -> None:
        """Download the model file."""
        if (session := self.page.session) is None:
            return
        try:
            text = dump_model(session.complete_model())
        except Exception as error:
            notify_error(error)
            return
        ui.download.content(text, f"{Path(self.page.data).stem}-model.yaml")

    def certificate(self) -> None:
        """Ask the questions of a certificate."""
        if self.page.session is not None:
            CertificateDialog(self.page.session, self.page.desk.bench_file)

    def compensation(self) -> None:
        """Ask the questions of a compensation."""
        if self.page.session is not None:
            CompensationDialog(self.page.session)


def _cells(row: ParameterRow) -> list[Callable[[], None]]:
    """The cells in the order of `HEAD`."""
    texts = (row.effect, row.name, row.axis, row.value, row.std, row.unit, row.change)
    return [partial(_cell, row, name, text) for name, text in zip(HEAD, texts, strict=True)]


def _cell(row: ParameterRow, name: str, text: str) -> None:
    """One cell: the meaning under the pointer, the reason below a value that is not identified."""
    cell = words(text, "chip doubt" if row.why and name == "value" else "number")
    if name == "parameter" and row.doc:
        with cell:
            ui.tooltip(row.doc)
    if row.why and name == "value":
        words(f"because {for_page(row.why)}", "quiet small why-not")


def _pairs(correlated: list[CorrelatedPair]) -> None:
    if not correlated:
        words(f"No two parameters are correlated by {STRONG:g} or more.", "quiet small")
        return
    strongest = correlated[0]
    title = f"{len(correlated)} correlations of {STRONG:g} or more; strongest: {_number(strongest.coefficient)}"
    with ui.expansion(title).props("dense").classes("small"):
        rows = [(pair.first, pair.second, _number(pair.coefficient)) for pair in correlated[:MOST_PAIRS]]
        table(("parameter", "and", "correlation"), rows)
        if len(correlated) > MOST_PAIRS:
            words(
                f"{len(correlated) - MOST_PAIRS} more are weaker; the certificate has the whole matrix.", "quiet small"
            )


def _number(value: float) -> str:
    return minus(f"{value:.3f}")
