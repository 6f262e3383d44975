"""add: put one physical effect, of the catalogue or your own, into a model, and watch the error fall."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.options import request_options
from rig.cli.terminal.output import emit, note, notes

if TYPE_CHECKING:
    from calibrations.effects import Effect
    from rig.services.load import Loaded
    from rig.services.request import Request

PLAIN = re.compile(r"[A-Za-z0-9_-]+")  # what no expression that means anything looks like


@click.command("add")
@click.argument("effect")
@click.option("--name", help="Name of an effect that is written as an expression.")
@click.option("--model", required=True, help="A shipped model by name, or a model file.")
@click.option("--data", required=True, help="A file or a run.")
@click.option("--out", required=True, type=click.Path(dir_okay=False, path_type=Path), help="The new model file.")
@request_options
def command(request: Request, effect: str, name: str | None, out: Path, as_json: bool) -> int:
    """Add EFFECT to a model, fit both to the data, and write the new model; the old one stays.

    EFFECT is a name of the catalogue (`rig effects`), a Python file of your own (my_effect.py), or, with --name, an
    expression such as "a*sin(5*beta) + b*cos(5*beta)" or "beta_deg += a*sin(5*beta)". In it alpha, beta and mount are
    in rad, ax, ay, az in g, t in s, temperature in C, supply in V; direction, flip and the data's other columns go by
    their names, and all other names are parameters. The model file holds the expression.
    """
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import discovery_document
    from rig.cli.terminal.words import addition, parameters, planned, warning
    from rig.services.load import loaded
    from rig.services.provenance import write_model

    question = loaded(request, note, out)
    chosen = _chosen(effect, name, question)
    result = question.data.add(chosen, question.model, {**question.effects, chosen.name: chosen})
    result = planned(result, request, question.effects)
    written = write_model(result.end, question.model, out, note)
    if as_json:
        emit(discovery_document(result, str(written) if written else None))
        notes(warning([result.caution]))
    else:
        text = addition(result, request.data, out)
        click.echo(f"{chosen.name} added to {question.model.name}\n\n{text}\n\n{parameters(result.end.model)}\n")
        if written is not None:
            click.echo(f"written to {written}")
    if effect.endswith(".py"):
        note(
            f"{out} names {chosen.name} and does not hold it: keep {effect} in the folder of your bench file's effects"
        )
    return int(result.verdict is Verdict.NO_RESPONSE)


def _chosen(effect: str, name: str | None, question: Loaded) -> Effect:
    """The effect that was named, written, or is in a file. Raises UnknownName, ModelError, ExpressionError."""
    from calibrations.effects.catalogue import find, read_effect
    from calibrations.errors import ModelError

    if name is not None:
        if name in question.effects:
            raise ModelError(f"{name} is in the catalogue already (`rig effects {name}`); give yours another name")
        return question.data.expression(name, effect)
    if effect.endswith(".py"):
        return read_effect(Path(effect))
    if effect not in question.effects and not PLAIN.fullmatch(effect):
        raise ModelError(f'"{effect}" is no name of an effect; if it is an expression, name it: --name my-effect')
    return find(effect, question.effects)
