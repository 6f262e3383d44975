"""add: put one physical effect into a model, and watch the error fall."""

from __future__ import annotations

from pathlib import Path

import click

from rig.cli.output import bench_option, emit, json_option, notes


@click.command("add")
@click.argument("effect")
@click.option("--model", required=True, help="A shipped model by name, or a model file.")
@click.option("--data", required=True, help="A file or a run.")
@click.option("--out", required=True, type=click.Path(dir_okay=False, path_type=Path), help="The new model file.")
@bench_option
@json_option
def command(effect: str, model: str, data: str, out: Path, bench_file: Path | None, as_json: bool) -> None:
    """Add EFFECT to a model, fit both to the data, and write the new model; the old one stays."""
    from calibrations.discover import add
    from calibrations.documents import discovery_document
    from calibrations.effect import find
    from calibrations.errors import ModelError
    from rig.cli.asked import asked, write_model
    from rig.cli.words import addition, parameters, warning

    table, start, effects = asked(data, model, bench_file, out)
    chosen = find(effect, effects)
    if start.holds(effect):
        raise ModelError(f"{model}: {effect} is in the model already; its effects: {', '.join(start.effects)}")
    if (why := chosen.excluded(table)) is not None:
        raise ModelError(f"{effect} {why}; {table.source} is a table of {table.kind}: {', '.join(table.columns)}")
    result = add(chosen, start, table, effects)
    write_model(result.end, start, out)
    if as_json:
        emit(discovery_document(result, str(out)))
        notes(warning(result.caution))
    else:
        click.echo(
            f"{effect} added to {start.name}\n\n{addition(result, data, out)}\n\n{parameters(result.end.model)}\n"
        )
        click.echo(f"written to {out}")
