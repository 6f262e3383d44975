"""compare: compare a model with data, and show where it fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from rig.cli.terminal.complete import complete_data
from rig.cli.terminal.options import request_options
from rig.cli.terminal.output import check_option, emit, model_option, note, notes
from rig.cli.terminal.progress import working

if TYPE_CHECKING:
    from rig.services.request import Request


@click.command("compare")
@click.argument("data", shell_complete=complete_data)
@model_option
@check_option
@request_options
def command(request: Request, check: bool, as_json: bool) -> int:
    """Compare a model with DATA (a file or a run), and show where it fails. A model without values is fitted first."""
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import comparison_document
    from rig.cli.terminal.words import warning
    from rig.services.load import loaded

    with working("fitting the model"):
        question = loaded(request, note)
        result = question.data.compare(question.model, question.effects)
        name, cautions = request.model or question.model.name, question.data.cautions(result.fit)
    if as_json:
        emit(comparison_document(result, name))
        notes(warning(cautions))
    else:
        click.echo(result.report())
        if result.rejection is None and not result.adequate:
            click.echo(f"\nTo find the missing effect: rig diagnose {request.data} --model {name}")
        for line in filter(None, (question.data.note, *warning(cautions))):
            click.echo(f"\n{line}")
    silent = result.rejection is not None and result.rejection.verdict == Verdict.NO_RESPONSE
    undetermined = question.data.undetermined(result.fit) is not None
    return int(silent or (check and (not result.adequate or undetermined)))
