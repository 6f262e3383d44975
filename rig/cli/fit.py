"""fit: estimate a model's parameters from data, with uncertainties."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.output import check_option, emit, model_option, notes
from rig.cli.request import request_options

if TYPE_CHECKING:
    from rig.analysis.request import Request


@click.command("fit")
@click.argument("data")
@model_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the fitted model to this file.")
@check_option
@request_options
def command(request: Request, out: Path | None, check: bool, as_json: bool) -> int:
    """Estimate the parameters of a model from DATA (a file or a run), with standard uncertainties."""
    from calibrations.compare import compare
    from calibrations.documents import fit_document
    from calibrations.fit import fit
    from calibrations.reports.budget import document as in_parts
    from calibrations.search.determined import undetermined
    from calibrations.search.outliers import kept
    from calibrations.search.unseen import unseen
    from rig.cli import calibrated
    from rig.cli.asked import asked, tell_blind, write_model
    from rig.cli.checked import document, lines
    from rig.cli.still import of_still, told_fit
    from rig.cli.words import errors, paper, parameters, warning

    if (still := of_still(request, out)) is not None:
        return told_fit(still, out, check, as_json)
    table, start, effects = asked(request, out)
    found = fit(start, table)
    if out is not None:
        write_model(found, start, out)
    tell_blind(found, effects)
    caution, checked = undetermined(found), unseen(start, table)
    if as_json:
        more = document(checked) | calibrated.document(found) | {"budget": in_parts(found)}
        emit(fit_document(found, str(out) if out else None) | more)
        notes([*warning(caution), *warning(kept(found))])
    else:
        click.echo(f"{found.model.name} fitted to {table.n} rows of {table.source}\n\n{parameters(found.model)}\n")
        told = [*calibrated.lines(found), *warning(caution), *warning(kept(found)), *lines(checked, request.data)]
        click.echo("\n".join([errors(found), *(f"\n{line}" for line in told)]))
        if "cross-axis-bias" in start.effects and table.kind == "poses":
            click.echo(f"\n{paper(table)}")
        if out is not None:
            click.echo(f"\nwritten to {out}")
    return 1 if check and (caution or not compare(table, found.model).adequate) else 0
