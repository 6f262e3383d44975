"""fit: estimate a model's parameters from data, with uncertainties."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rig.cli.terminal.output import check_option, emit, model_option, notes
from rig.cli.terminal.request import request_options

if TYPE_CHECKING:
    from calibrations.discovery.dataset import Dataset
    from calibrations.model import Model
    from rig.services.request import Request


@click.command("fit")
@click.argument("data")
@model_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the fitted model to this file.")
@check_option
@request_options
def command(request: Request, out: Path | None, check: bool, as_json: bool) -> int:
    """Estimate the parameters of a model from DATA (a file or a run), with standard uncertainties."""
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import fit_document
    from rig.cli.terminal.asked import asked, note_untestable, write_model
    from rig.cli.terminal.words import parameters, table, warning

    question = asked(request, out)
    data = question.data
    found = data.fit(question.model)
    written, reason = write_model(found, question.model, out), data.rejection(found)
    note_untestable(data, found, question.effects)
    cautions, further = data.cautions(found), _further(data, question.model, found)
    if as_json:
        emit(fit_document(data, found, str(written) if written else None) | further.document)
        notes(warning(cautions))
    else:
        remarks = [*further.lines, *warning(cautions)]
        if reason is not None:
            remarks = [f"This data cannot be used: {reason.verdict}: {reason.text}."]
        click.echo(f"{found.model.name} fitted to {data.description}\n\n{parameters(found.model)}\n")
        click.echo("\n".join([table(data.error_table(found)), *(f"\n{line}" for line in remarks)]))
        if further.paper:
            click.echo(f"\n{further.paper}")
        if written is not None:
            click.echo(f"\nwritten to {written}")
    if reason is not None and reason.verdict == Verdict.NO_RESPONSE:
        return 1
    unsure = data.undetermined(found) is not None
    return int(check and (unsure or not data.compare(found.model).adequate))


@dataclass(frozen=True)
class _Further:
    """What a fit of rows says beyond its parameters: check poses, calibration matrices, uncertainty budget."""

    document: dict[str, Any]
    lines: tuple[str, ...] = ()
    paper: str = ""


def _further(data: Dataset[Any], model: Model, found: Any) -> _Further:
    if data.form != "rows":
        return _Further({})
    from calibrations.discovery.check_poses import unseen
    from calibrations.presentation.report.parameters import budget_document as in_parts
    from rig.cli.terminal import calibrated
    from rig.cli.terminal.checked import document, lines
    from rig.cli.terminal.words import paper

    checked = unseen(model, found.table)
    stepwise = "cross-axis-bias" in model.effects and found.table.type.stage_angles
    return _Further(
        document(checked) | calibrated.document(found) | {"budget": in_parts(found)},
        (*calibrated.lines(found), *lines(checked, data.source)),
        paper(found.table) if stepwise else "",
    )
