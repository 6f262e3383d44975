"""report and certificate: documents on data and a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.complete import complete_data, complete_model
from rig.cli.terminal.options import DataCommand, request_options
from rig.cli.terminal.output import (
    FILE,
    bench_option,
    emit,
    force_option,
    json_option,
    model_option,
    note,
    out_option,
    picture_options,
    require_outputs,
)
from rig.cli.terminal.progress import working
from rig.errors import OutputError
from rig.files import write_whole
from rig.services.request import Request

if TYPE_CHECKING:
    from calibrations.presentation.certificate.content import Certificate


@click.command("report", cls=DataCommand)
@click.argument("data", shell_complete=complete_data)
@model_option
@picture_options("Write all pictures here.")
@out_option("Write the page to this HTML file.")
@request_options
def report_command(request: Request, out: Path | None, folder: Path | None, form: str, as_json: bool) -> None:
    """Write a page on DATA (a file or a run) and a model: missing effects, and the completed model.

    The page is one file and needs no network. For a soak without --model it shows the soak. --pictures writes the
    pictures, with or without the page.
    """
    if out is None and folder is None:
        raise click.UsageError("nothing to write: give --out FILE.html, --pictures FOLDER, or both")
    from calibrations.presentation.static import save_all
    from rig.services.report import make_report

    with working("fitting the model and searching for missing effects") as progress:
        pictures, page = make_report(request, note, progress.searched)
        progress.text = "drawing the pictures"
        if out is not None:
            write_whole(out, page())
        paths = save_all({picture.name: picture.chart for picture in pictures}, folder, form) if folder else []
    if as_json:
        emit({"schema": "rig.report/1", "out": str(out) if out else None, "pictures": [str(p) for p in paths]})
    else:
        for path in [*([out] if out else []), *paths]:
            click.echo(f"written: {path}")


FORMS = (".html", ".pdf", ".xml")


@click.command("certificate")
@click.argument("data", shell_complete=complete_data)
@click.option(
    "--model",
    required=True,
    shell_complete=complete_model,
    help="The certificate states the parameters of this model, fitted to DATA.",
)
@click.option(
    "--out",
    type=FILE,
    required=True,
    help="A file that ends in .html, .pdf or .xml; any other name gives all three.",
)
@force_option
@click.option(
    "--as-found", "before", help="The model file in use before. Default: --model, if it has values from other data."
)
@click.option("--number", default="", help="Number of the certificate. Default: the run and a digest.")
@click.option("--customer", default="", help="The customer.")
@bench_option
@json_option
def certificate_command(
    data: str,
    model: str,
    out: Path,
    before: str | None,
    number: str,
    customer: str,
    bench_file: Path | None,
    as_json: bool,
) -> int:
    """Write a calibration certificate for DATA: results and uncertainty budgets, as found and as left.

    Results are compared with the limits of the bench file (limits.results, such as bias-x) by guarded acceptance. Exit
    status 1: a result exceeds its limit, or the data cannot be used and no certificate is written.
    """
    from calibrations.presentation.certificate.content import document
    from calibrations.presentation.certificate.results import require_reference
    from rig.bench import read_bench
    from rig.services.certify import CertificateInput, certified, failed_results, format_certificate
    from rig.services.load import is_still, loaded_table

    paths = _paths(out)
    require_outputs(*paths)
    if is_still(data):
        require_reference(data, "still")
    with working("fitting the model") as progress:
        table, stated_model, effects = loaded_table(Request(data, model, bench_file), note)
        require_reference(table.source, table.kind)
        bench = read_bench(bench_file) if bench_file is not None else None
        request = CertificateInput(data, table, stated_model, Path(model).name, effects, bench, before)
        certificate = certified(request, number, customer)
        for path in paths:
            progress.text = f"writing {path}"
            write_whole(path, format_certificate(certificate, path.suffix))
    if as_json:
        emit(document(certificate) | {"files": [str(path) for path in paths]})
    else:
        click.echo("\n".join([*_certificate_lines(certificate), *(f"written: {path}" for path in paths)]))
    return int(bool(failed_results(certificate)))


def _paths(out: Path) -> list[Path]:
    """The files to write. Raises OutputError for another ending."""
    if out.suffix and out.suffix not in FORMS and not out.suffix[1:].isdigit():
        raise OutputError(f'{out}: a certificate ends in .html, .pdf or .xml, not in "{out.suffix}"')
    return [out] if out.suffix in FORMS else [out.with_name(out.name + form) for form in FORMS]


def _certificate_lines(certificate: Certificate) -> list[str]:
    from calibrations.presentation.certificate.sections import results_table
    from calibrations.text import columns
    from rig.services.certify import certificate_head

    table = results_table(certificate)
    results = columns(table.head, table.rows)
    return [certificate_head(certificate), "", results, "", *certificate.figures.remarks, *certificate.remarks]
