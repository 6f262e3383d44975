"""diagnose: which physical effect the model is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from rig.cli.output import check_option, columns, emit, model_option, note, notes
from rig.cli.request import request_options

if TYPE_CHECKING:
    from calibrations.diagnose import Diagnosis
    from rig.analysis.request import Request

SHOWN = 6


@click.command("diagnose")
@click.argument("data")
@model_option
@check_option
@request_options
def command(request: Request, check: bool, as_json: bool) -> int:
    """Find the physical effect that a model misses on DATA (a file or a run)."""
    from calibrations.diagnose import diagnose
    from calibrations.documents import diagnosis_document
    from rig.cli.asked import asked, tell_blind
    from rig.cli.own_effect import own_effect, told
    from rig.cli.still import of_still, told_diagnose
    from rig.cli.words import warning
    from rig.planning.foresight import with_next

    if (still := of_still(request)) is not None:
        return told_diagnose(still, request, check, as_json)
    table, start, effects = asked(request)
    result = with_next(diagnose(table, start, effects), request.data, effects, request.bench_file, note)
    tell_blind(result.fit, effects)
    name = request.model or start.name
    if as_json:
        own = own_effect(result.pattern, name, request)
        emit(diagnosis_document(result, name) | {"own_effect": own})
        notes(warning(result.caution))
    else:
        click.echo("\n".join([_told(result, name, request), *told(result.pattern, name, request)]))
    return 1 if check and result.verdict != "adequate" else 0


def _told(result: Diagnosis, model: str, request: Request) -> str:
    from calibrations.documents import why
    from calibrations.reports.verdict import headline
    from rig.cli.words import experiment

    lines = [f"{model} on {result.fit.table.n} rows of {result.fit.table.source}: {headline(result)}", ""]
    rows = [
        (
            c.name,
            f"{result.held_out_before:.3g} -> {c.held_out_after:.3g}",
            f"{c.p_value:.1g}",
            f"{c.probability:.3f}",
            ", ".join(c.indistinguishable_from) or "-",
        )
        for c in result.candidates[:SHOWN]
    ]
    if rows:
        probability = "if it is one of these" if result.verdict == "unexplained" else "probability"
        head = ("candidate", "error on unseen poses / floor", "p-value", probability, "not told apart from")
        lines += [columns(head, rows), ""]
    if result.verdict in ("effect-missing", "ambiguous") and result.path.steps:
        best = result.candidates[0]
        lines += [f"{best.name}: {why(best, result)}", "", f"    {best.effect.formula.splitlines()[0]}", ""]
        lines.append(
            f"Add it: rig add {best.name} --model {model} --data {request.data} --out model.yaml{request.bench_words}"
        )
    if result.next_experiment:
        lines += experiment(result.next_experiment, request.data)
    return "\n".join(lines).rstrip()
