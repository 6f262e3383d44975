"""certificate: a calibration certificate for people (HTML, PDF) and for machines (DCC XML)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.complete import complete_data, complete_model
from rig.cli.terminal.output import bench_option, emit, json_option, note
from rig.cli.terminal.progress import working
from rig.errors import OutputError

if TYPE_CHECKING:
    from calibrations.presentation.certificate.content import Certificate

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
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    help="A file that ends in .html, .pdf or .xml; any other name gives all three.",
)
@click.option(
    "--as-found", "before", help="The model file in use before. Default: --model, if it has values from other data."
)
@click.option("--number", default="", help="Number of the certificate. Default: the run and a digest.")
@click.option("--customer", default="", help="The customer.")
@bench_option
@json_option
def command(
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
    from rig.services.certify import Certified, certified, failed_results
    from rig.services.load import is_still, loaded_table
    from rig.services.request import Request

    paths = _paths(out)
    if is_still(data):
        require_reference(data, "still")
    with working("fitting the model") as progress:
        table, given, effects = loaded_table(Request(data, model, bench_file), note)
        require_reference(table.source, table.kind)
        bench = read_bench(bench_file) if bench_file is not None else None
        asked = Certified(data, table, given, Path(model).name, effects, bench, before)
        certificate = certified(asked, number, customer)
        for path in paths:
            progress.text = f"writing {path}"
            _write(path, certificate)
    if as_json:
        emit(document(certificate) | {"files": [str(path) for path in paths]})
    else:
        click.echo("\n".join([*_lines(certificate), *(f"written: {path}" for path in paths)]))
    return int(bool(failed_results(certificate)))


def _paths(out: Path) -> list[Path]:
    """The files to write. Raises OutputError for another ending or a missing folder."""
    if out.suffix and out.suffix not in FORMS and not out.suffix[1:].isdigit():
        raise OutputError(f'{out}: a certificate ends in .html, .pdf or .xml, not in "{out.suffix}"')
    if not out.parent.is_dir():
        raise OutputError(f"{out}: there is no folder {out.parent}; make it, or give another file")
    return [out] if out.suffix in FORMS else [out.with_name(out.name + form) for form in FORMS]


def _write(path: Path, certificate: Certificate) -> None:
    """Write one format of the certificate."""
    from rig.files import write_whole
    from rig.services.certify import written

    write_whole(path, written(certificate, path.suffix))


def _lines(certificate: Certificate) -> list[str]:
    from calibrations.presentation.certificate.sections import results_table
    from calibrations.text import columns
    from rig.services.certify import certificate_head

    table = results_table(certificate)
    results = columns(table.head, table.rows)
    return [certificate_head(certificate), "", results, "", *certificate.figures.remarks, *certificate.remarks]
