"""add: put one physical effect, of the catalogue or your own, into a model, and watch the error fall."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.output import emit, note, notes
from rig.cli.request import request_options

if TYPE_CHECKING:
    from calibrations.effect import Effect
    from calibrations.table import Table
    from rig.analysis.request import Request

PLAIN = re.compile(r"[A-Za-z0-9_-]+")  # what no expression that means anything looks like


@click.command("add")
@click.argument("effect")
@click.option("--name", help="Name of an effect that is written as an expression.")
@click.option("--model", required=True, help="A shipped model by name, or a model file.")
@click.option("--data", required=True, help="A file or a run.")
@click.option("--out", required=True, type=click.Path(dir_okay=False, path_type=Path), help="The new model file.")
@request_options
def command(request: Request, effect: str, name: str | None, out: Path, as_json: bool) -> None:
    """Add EFFECT to a model, fit both to the data, and write the new model; the old one stays.

    EFFECT is a name of the catalogue (`rig effects`), a Python file of your own (my_effect.py), or, with --name, an
    expression such as "a*sin(5*beta) + b*cos(5*beta)" or "beta_deg += a*sin(5*beta)". In it alpha, beta and mount are
    in rad, ax, ay, az in g, t in s, temperature in C, supply in V; direction, flip and the data's other columns go by
    their names, and all other names are parameters. The model file holds the expression.
    """
    from calibrations.discover import add
    from calibrations.documents import discovery_document
    from calibrations.errors import ModelError
    from rig.analysis.trail import require_new
    from rig.cli.asked import asked, write_model
    from rig.cli.still import of_still, told_add
    from rig.cli.words import addition, parameters, warning

    if (still := of_still(request, out)) is not None:
        told_add(still, request, effect, out, as_json)
        return
    table, start, effects = asked(request, out)
    chosen = _chosen(effect, name, table, effects)
    if start.holds(chosen.name):
        raise ModelError(
            f"{request.model}: {chosen.name} is in the model already; its effects: {', '.join(start.effects)}"
        )
    if (why := chosen.excluded(table)) is not None:
        raise ModelError(f"{chosen.name} {why}; {table.source} is a table of {table.kind}: {', '.join(table.columns)}")
    result = add(chosen, start, table, {**effects, chosen.name: chosen})
    if chosen.expression:
        require_new(result.end, chosen.name, request.model or start.name)
    write_model(result.end, start, out)
    if as_json:
        emit(discovery_document(result, str(out)))
        notes(warning(result.caution))
    else:
        told = addition(result, request.data, out)
        click.echo(f"{chosen.name} added to {start.name}\n\n{told}\n\n{parameters(result.end.model)}\n")
        click.echo(f"written to {out}")
    if effect.endswith(".py"):
        note(
            f"{out} names {chosen.name} and does not hold it: keep {effect} in the folder of your bench file's effects"
        )


def _chosen(effect: str, name: str | None, table: Table, effects: Mapping[str, Effect]) -> Effect:
    """The effect that was named, written, or is in a file. Raises UnknownName, ModelError, ExpressionError."""
    from calibrations.effect import find, read_effect
    from calibrations.errors import ModelError
    from calibrations.expressions.effect import effect_for

    if name is not None:
        if name in effects:
            raise ModelError(f"{name} is in the catalogue already (`rig effects {name}`); give yours another name")
        return effect_for(name, effect, table)
    if effect.endswith(".py"):
        return read_effect(Path(effect))
    if effect not in effects and not PLAIN.fullmatch(effect):
        raise ModelError(f'"{effect}" is no name of an effect; if it is an expression, name it: --name my-effect')
    return find(effect, effects)
