"""diagnose: find the physical effect that a model misses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from rig.cli.terminal.complete import complete_data
from rig.cli.terminal.options import request_options
from rig.cli.terminal.output import check_option, emit, model_option, note, notes
from rig.cli.terminal.progress import working

if TYPE_CHECKING:
    from calibrations.discovery.results import Diagnosis
    from rig.services.request import Request


@click.command("diagnose")
@click.argument("data", shell_complete=complete_data)
@model_option
@check_option
@request_options
def command(request: Request, check: bool, as_json: bool) -> int:
    """Find the physical effect that a model misses on DATA (a file or a run)."""
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import diagnosis_document
    from rig.cli.terminal.words import own_effect, pattern_advice, planned, warning
    from rig.services.load import loaded

    with working("fitting the model") as progress:
        question = loaded(request, note)
        result = question.data.diagnose(question.model, progress.searched(question.effects))
        progress.text = "planning the next experiment"
        result = planned(result, request, question.effects)
    if (untestable := question.data.untestable(result.fit, question.effects)) is not None:
        note(untestable)
    if result.verdict is not Verdict.NO_RESPONSE:
        notes(warning(question.data.doubts(result.fit)))
    name = request.model or question.model.name
    if as_json:
        own = own_effect(result.pattern, name, request)
        emit(diagnosis_document(result, name) | {"own_effect": own})
        notes(warning([result.caution]))
    else:
        click.echo("\n".join([_text(result, name, request), *pattern_advice(result.pattern, name, request)]))
    return int(result.verdict is Verdict.NO_RESPONSE or (check and result.verdict is not Verdict.ADEQUATE))


def _text(result: Diagnosis[Any], model: str, request: Request) -> str:
    from calibrations.presentation.answers import diagnosis_text
    from rig.cli.terminal.words import experiment

    data = result.findings.data
    lines = [diagnosis_text(result, model), ""]
    if result.missing:
        best = result.candidates[0]
        lines.append(
            f"Add it: rig add {best.name} --model {model} --data {request.data} --out model.yaml{request.bench_words}"
        )
    if data.note:
        lines += ["", data.note]
    if result.next_experiment:
        lines += experiment(result.next_experiment, request.data)
    return "\n".join(lines).rstrip()
