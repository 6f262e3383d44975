"""certificate: a calibration certificate for people (HTML, PDF) and for machines (DCC XML)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.output import bench_option, emit, json_option, note
from rig.errors import OutputError

if TYPE_CHECKING:
    from calibrations.presentation.certificate.content import Certificate

FORMS = (".html", ".pdf", ".xml")


@click.command("certificate")
@click.argument("data")
@click.option("--model", required=True, help="The model whose parameters are certified, as DATA find them.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    help="A file with .html, .pdf or .xml; a name without these gives all three.",
)
@click.option(
    "--as-found", "before", help="The model file in use until now. Default: --model, if other data gave it values."
)
@click.option("--number", default="", help="The certificate's number. Default: the run's, and a digest.")
@click.option("--customer", default="", help="Who asked for it.")
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
    """Draw up a calibration certificate of DATA: results, uncertainties and their budgets, as found and as left.

    Limits of the bench file (limits.results, such as bias-x) are judged by guarded acceptance. Exit status 1: a result
    is beyond its limit, or the data cannot be used and no certificate is written.
    """
    from calibrations.fit import fit
    from calibrations.model.file import read_model
    from calibrations.presentation.certificate.content import document
    from calibrations.presentation.certificate.results import figures, require_reference
    from rig.bench import read_bench
    from rig.services.issue import Asked, issue, limits
    from rig.services.load import is_still, loaded_table
    from rig.services.request import Request

    paths = _paths(out)
    if is_still(data):
        require_reference(data, "still")
    table, given, effects = loaded_table(Request(data, model, bench_file), note)
    require_reference(table.source, table.kind)
    bench = read_bench(bench_file) if bench_file is not None else None
    earlier, of = given, Path(model).name
    if before is not None:
        earlier, of = read_model(before, effects), Path(before).name
    fresh = bool(earlier.params) and earlier.provenance.get("data_sha256") != table.digest
    found = fit(given, table)
    figured = figures(found, earlier if fresh else None, limits(data, bench))
    since = str(earlier.provenance.get("created", "of unknown date"))[:10]
    said = Asked(number, customer, f"the model {of}, {since}" if fresh else "")
    made = issue(data, found, figured, bench, said)
    for path in paths:
        _write(path, made)
    failed = [o.name for o in figured.outcomes if o.decision is not None and o.decision.statement == "fail"]
    if as_json:
        emit(document(made) | {"files": [str(path) for path in paths]})
    else:
        click.echo("\n".join([*_told(made), *(f"written: {path}" for path in paths)]))
    return int(bool(failed))


def _paths(out: Path) -> list[Path]:
    """The files that are asked for. Raises OutputError for another ending, and where there is no folder."""
    if out.suffix and out.suffix not in FORMS and not out.suffix[1:].isdigit():
        raise OutputError(f'{out}: certificates end in .html, .pdf or .xml, not in "{out.suffix}"')
    if not out.parent.is_dir():
        raise OutputError(f"{out}: there is no folder {out.parent}; make it, or name another file")
    return [out] if out.suffix in FORMS else [out.with_name(out.name + form) for form in FORMS]


def _write(path: Path, made: Certificate) -> None:
    """One form of the certificate; its writer is imported only here."""
    from calibrations.presentation.certificate.dcc import dcc
    from calibrations.presentation.certificate.pages import html
    from rig.files import write_whole

    if path.suffix == ".pdf":
        from calibrations.presentation.certificate.pages import pdf

        write_whole(path, pdf(made))
    else:
        write_whole(path, {".html": html, ".xml": dcc}[path.suffix](made))


def _told(made: Certificate) -> list[str]:
    from calibrations.presentation.certificate.sections import results_table, verdict
    from calibrations.presentation.text import columns

    table = results_table(made)
    told = verdict(made)
    conformity = f"; conformity: {told}" if told else ""
    head = f"{made.headline}, No. {made.number}{conformity}"
    return [head, "", columns(table.head, table.rows), "", *made.figures.remarks, *made.remarks]
