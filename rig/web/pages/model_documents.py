"""Certificate and compensation of the present model, with the questions of the command line."""

from __future__ import annotations

import io
import zipfile
from functools import partial
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from nicegui import ui

from calibrations.compensation.forward import input_unit
from calibrations.compensation.inverse import Range, invert_model
from calibrations.model.file import dump_model
from calibrations.presentation.residual import column_label
from calibrations.progress import report
from calibrations.text import unit
from rig.bench import read_bench
from rig.errors import RigError
from rig.services.search import Cancelled
from rig.web.calculations import Visit
from rig.web.desk import models
from rig.web.parts import PROGRESS_S, afresh, dialog_with_name, div, for_page, message, waiting, words

if TYPE_CHECKING:
    from calibrations.model import Model
    from rig.services.session import ModelSession


class DocumentDialog:
    """A dialog with questions, a button that makes a document, and the answer or the error below it."""

    def __init__(self, title: str, explanation: str) -> None:
        with dialog_with_name(title) as self.dialog, ui.card().style("min-width: min(560px, 92vw)"):
            words(title, "title")
            words(explanation, "quiet small")
            self.fields = div("settings").style("width: 100%")
            self.below = div("stack")
            self.answer = div("stack").props("role=status")
            self.visit = Visit()
            with div("row-of"):
                self.make = ui.button("Make and download", icon="download", on_click=self._make)
                self.end = ui.button("Cancel", icon="close", on_click=self.visit.cancel).props("flat")
                self.end.set_visibility(False)
                ui.button("Close", on_click=self._close).props("flat")

    def _close(self) -> None:
        self.visit.cancel()
        self.dialog.close()

    async def _make(self) -> None:
        """Make the document off the event loop; the reason stays in the dialog if that fails."""
        self.make.disable()
        self.end.set_visibility(True)
        begun_s, self.visit.doing = monotonic(), "Making the document"
        with afresh(self.answer):
            progress = waiting(f"{self.visit.doing} ...")
            tick = partial(_show_progress, progress, self.visit, begun_s)
            ui.timer(PROGRESS_S, tick)
        try:
            content, name, lines = await self.visit.work(self.made)
            ui.download.content(content, name)
            with afresh(self.answer):
                words(f"Downloaded: {name}", "chip good")
                for line in lines:
                    words(for_page(line), "small")
        except Cancelled:
            if not self.visit.closed:
                with afresh(self.answer):
                    words("Cancelled. Nothing was downloaded.", "quiet")
        except Exception as error:
            self.answer.clear()
            with self.answer, div("").props("role=alert"):
                words(message(error), "fault")
        finally:
            self.end.set_visibility(False)
            self.make.enable()

    def made(self) -> tuple[bytes | str, str, list[str]]:
        """Content, file name, and remarks."""
        raise NotImplementedError


def _show_progress(label: ui.label, visit: Visit, begun_s: float) -> None:
    """What the work does now, and since when."""
    label.set_text(f"{visit.doing}, {monotonic() - begun_s:.0f} s")


class CertificateDialog(DocumentDialog):
    """`rig certificate`: the form, the number, the customer, and the model in use until now."""

    def __init__(self, session: ModelSession[Any], bench_file: Path | None) -> None:
        super().__init__(
            "Calibration certificate",
            "Results and uncertainty budgets, as found and as left. Results are judged by the limits of the bench.",
        )
        self.session, self.bench_file = session, bench_file
        earlier = models(default="none, or the given model if it has values from other data")
        with self.fields:
            self.form = ui.select({".html": "HTML", ".pdf": "PDF", ".xml": "DCC XML"}, label="Form", value=".html")
            self.number = ui.input("Number (empty: run and digest)")
            self.customer = ui.input("Customer (empty: the bench's)")
            self.before = ui.select(earlier, label="As found: model in use until now", value="")
        for field in (self.form, self.number, self.customer, self.before):
            field.props("dense options-dense")
        self.before.style("grid-column: 1 / -1")  # its texts are long
        self.dialog.open()

    def made(self) -> tuple[bytes | str, str, list[str]]:
        """The certificate of the present model."""
        from rig.services.certify import (
            CertificateInput,
            certificate_head,
            certified,
            failed_results,
            format_certificate,
        )

        session, form = self.session, str(self.form.value)
        subject = CertificateInput(
            session.request.data,
            session.data.table,  # type: ignore[attr-defined] # the button is enabled for rows
            session.complete_model() if session.steps else session.model,  # its provenance: values from these data
            session.end.model.name,
            session.effects,
            read_bench(self.bench_file) if self.bench_file is not None else None,
            str(self.before.value) or (session.request.model if session.steps else None),
        )
        document = certified(subject, str(self.number.value or "").strip(), str(self.customer.value or "").strip())
        failed = failed_results(document)
        report("Writing the certificate")
        lines = [certificate_head(document), *document.figures.remarks, *document.remarks]
        lines += [f"Beyond its limit: {name}" for name in failed]
        return format_certificate(document, form), f"{document.number}{form}", lines


class CompensationDialog(DocumentDialog):
    """`rig compensate`: language, name, precision, ranges, and effects to leave out."""

    def __init__(self, session: ModelSession[Any]) -> None:
        super().__init__(
            "Compensation",
            "Source code for the product: from outputs to reference axes, in a fixed number of steps, with a proof "
            "that they are enough over the whole range.",
        )
        self.model: Model = session.complete_model()
        self.default = Range.for_model(self.model)
        with self.fields:
            languages = {"c": "C99", "python": "Python", "json": "JSON, for writers of other languages"}
            self.language = ui.select(languages, label="Language", value="c")
            self.name = ui.input("Name of files and functions", value=Path(session.request.data).stem)
            self.precision = ui.select({"double": "double", "float": "float"}, label="Precision", value="double")
            of_axes = f"Largest value of each axis ({unit(input_unit(self.model))})"
            self.reach = ui.number(of_axes, value=self.default.reach, min=0)
            self.inputs = {
                name: tuple(
                    ui.number(f"{column_label(name)}: {end}", value=value)
                    for end, value in (("lowest", low), ("highest", high))
                )
                for name, (low, high) in self._inputs().items()
            }
        with self.below:
            self.without = ui.select(list(self.model.effects), label="Leave out", multiple=True, value=[])
        for field in (
            self.language,
            self.name,
            self.precision,
            self.reach,
            self.without,
            *sum(self.inputs.values(), ()),
        ):
            field.props("dense options-dense").style("min-width: 200px")
        self.dialog.open()

    def _inputs(self) -> dict[str, tuple[float, float]]:
        """The inputs that the model's own effects need, with their usual ranges."""
        required = {name for term in self.model.terms for name in term.effect.needs}
        return {name: ends for name, ends in self.default.input_limits.items() if name in required}

    def _range(self) -> Range:
        """The range of the proof. Raises RigError for ends that are not in order."""
        ends = {name: (float(low.value), float(high.value)) for name, (low, high) in self.inputs.items()}
        for name, (low, high) in ends.items():
            if not low < high:
                raise RigError(f"{name}: the lowest value {low:g} must be below the highest, {high:g}")
        reach = float(self.reach.value or 0)
        if not reach > 0:
            raise RigError(f"The largest value of each axis is {reach:g}; it must be above 0")
        return Range.for_model(self.model, reach, **ends)

    def made(self) -> tuple[bytes | str, str, list[str]]:
        """All files in one archive."""
        from rig.services.compensation import compensation_lines, instruction_for_test, origin_of, source_files

        language = str(self.language.value)
        compensation = invert_model(
            self.model, self._range(), list(self.without.value or ()), str(self.precision.value)
        )
        origin = origin_of(self.model.name, str(self.name.value or "").strip() or None, dump_model(self.model))
        files = source_files(compensation, language, origin)
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, text in files.items():
                archive.writestr(f"{origin.name}/{name}", text)
        lines = [
            f"Files: {', '.join(files)}",
            *compensation_lines(compensation),
            *instruction_for_test(language, origin.name, origin.name),
        ]
        return packed.getvalue(), f"{origin.name}.zip", lines
