"""add: add one physical effect, from the catalogue or your own, to a model."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.complete import complete_data, complete_effect, complete_model
from rig.cli.terminal.options import request_options
from rig.cli.terminal.output import emit, note, notes
from rig.cli.terminal.progress import working

if TYPE_CHECKING:
    from calibrations.effects import Effect
    from rig.services.load import Loaded
    from rig.services.request import Request

NAME = re.compile(r"[A-Za-z0-9_-]+")  # no useful expression looks like this


@click.command("add")
@click.argument("effect", shell_complete=complete_effect)
@click.option("--name", help="Name of an effect given as an expression.")
@click.option("--model", required=True, shell_complete=complete_model, help="A shipped model by name, or a model file.")
@click.option("--data", required=True, shell_complete=complete_data, help="A file or a run.")
@click.option("--out", required=True, type=click.Path(dir_okay=False, path_type=Path), help="The new model file.")
@request_options
def command(request: Request, effect: str, name: str | None, out: Path, as_json: bool) -> int:
    """Add EFFECT to a model, fit both models to the data, and write the new model. The old model file stays.

    EFFECT is a name in the catalogue (`rig effects`), a free form (free:PLACE, such as free:own-response: a smooth
    curve whose size the data show), a Python file of your own (my_effect.py), or, with --name, an expression such as
    "a*sin(5*beta) + b*cos(5*beta)" or "beta_deg += a*sin(5*beta)". In an expression alpha, beta and mount are in rad,
    ax, ay, az in g, t in s, temperature in C, supply in V; direction, flip and other columns of the data have their
    own names; every other name is a parameter. The model file contains the expression.
    """
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import discovery_document
    from rig.cli.terminal.words import addition, parameters, planned, warning
    from rig.services.load import loaded
    from rig.services.provenance import write_model

    with working("fitting both models") as progress:
        question = loaded(request, note, out)
        added = _find_effect(effect, name, question)
        effects = question.effects if effect.startswith("free:") else {**question.effects, added.name: added}
        result = question.data.add(added, question.model, progress.searched(effects))
        progress.text = "planning the next experiment"
        result = planned(result, request, question.effects)
    path = write_model(question.data, result.end, question.model, out, note)
    if as_json:
        emit(discovery_document(result, str(path) if path else None))
        notes(warning([result.caution]))
    else:
        text = addition(result, request.data, out)
        click.echo(f"{added.name} added to {question.model.name}\n\n{text}\n\n{parameters(result.end.model)}\n")
        if path is not None:
            click.echo(f"written: {path}")
    if effect.endswith(".py"):
        note(f"{out} refers to {added.name} but does not contain it: keep {effect} in the effects folder of the bench")
    return int(result.verdict is Verdict.NO_RESPONSE)


def _find_effect(effect: str, name: str | None, question: Loaded) -> Effect:
    """The effect by name, from an expression or from a file. Raises UnknownName, ModelError, ExpressionError."""
    from calibrations.effects.catalogue import read_effect
    from calibrations.errors import ModelError
    from calibrations.free_forms.place_names import PREFIX
    from calibrations.free_forms.requested import named

    if effect.startswith(PREFIX):
        return named(effect, question.effects)
    if name is not None:
        if name in question.effects:
            raise ModelError(f"{name} is already in the catalogue (`rig effects {name}`); give yours another name")
        return question.data.expression(name, effect)
    if effect.endswith(".py"):
        return read_effect(Path(effect))
    if effect not in question.effects and not NAME.fullmatch(effect):
        raise ModelError(f'there is no effect "{effect}"; if this is an expression, give it a name: --name my-effect')
    return named(effect, question.effects)
