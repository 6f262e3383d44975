"""compare: the model beside the measurement, and where it fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from rig.cli.output import check_option, emit, model_option, notes
from rig.cli.request import request_options

if TYPE_CHECKING:
    from rig.analysis.request import Request


@click.command("compare")
@click.argument("data")
@model_option
@check_option
@request_options
def command(request: Request, check: bool, as_json: bool) -> int:
    """Set a model beside DATA (a file or a run) and say where it fails. A model without values is fitted first."""
    from calibrations.compare import compare
    from calibrations.documents import comparison_document
    from calibrations.search.determined import undetermined
    from calibrations.search.outliers import kept
    from rig.cli.asked import asked
    from rig.cli.still import of_still, told_compare
    from rig.cli.words import errors, warning

    if (still := of_still(request)) is not None:
        return told_compare(still, request, check, as_json)
    table, start, _ = asked(request)
    result = compare(table, start)
    caution, outliers = undetermined(result.fit), kept(result.fit)
    if as_json:
        emit(comparison_document(result, request.model or start.name))
        notes([*warning(caution), *warning(outliers)])
    else:
        click.echo(f"{start.name} beside {table.n} rows of {table.source}\n\n{errors(result.fit)}\n")
        if result.adequate:
            click.echo("\n".join(["The model fails nowhere: what is left is noise.", *warning(caution)]))
        else:
            click.echo("It fails, worst first:\n" + "\n".join(f"  {place.text}" for place in result.fails))
            click.echo(f"\nWhich effect is missing: rig diagnose {request.data} --model {request.model or start.name}")
        for line in warning(outliers):
            click.echo(f"\n{line}")
    return 1 if check and (not result.adequate or caution) else 0
