"""discover: add missing effects until none is missing."""

from __future__ import annotations

from pathlib import Path

import click

from rig.cli.output import bench_option, check_option, emit, json_option, model_option, notes


@click.command("discover")
@click.argument("data")
@model_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the final model to this file.")
@check_option
@bench_option
@json_option
def command(data: str, model: str | None, out: Path | None, check: bool, bench_file: Path | None, as_json: bool) -> int:
    """Diagnose and add until nothing is missing on DATA (a file or a run)."""
    from calibrations.discover import discover
    from calibrations.documents import discovery_document
    from rig.cli.asked import asked, write_model
    from rig.cli.words import discovery, parameters, warning

    table, start, effects = asked(data, model, bench_file, out)
    result = discover(table, start, effects)
    if out is not None:
        write_model(result.end, start, out)
    if as_json:
        emit(discovery_document(result, str(out) if out else None))
        notes(warning(result.caution))
    else:
        click.echo(f"{table.n} rows of {table.source}\n\n{discovery(result)}\n\n{parameters(result.end.model)}")
        if out is not None:
            click.echo(f"\nwritten to {out}")
    return 1 if check and result.verdict != "adequate" else 0
