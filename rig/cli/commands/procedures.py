"""procedures: list the procedures with their purposes and settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from procedures.catalogue import Procedure, find, paths
from rig.bench import read_bench
from rig.cli.terminal.output import bench_option, emit, json_option


@click.command("procedures")
@bench_option
@json_option
def command(bench_file: Path | None, as_json: bool) -> None:
    """List the shipped procedures and your own, with their purposes and the defaults of their settings."""
    folder = read_bench(bench_file).folders.procedures
    found = [find(name, folder) for name in paths(folder)]
    if as_json:
        emit({"schema": "rig.procedures/1", "procedures": [_document(procedure) for procedure in found]})
    else:
        click.echo("\n\n".join(_text(procedure) for procedure in found))


def _document(procedure: Procedure) -> dict[str, Any]:
    head = {"name": procedure.name, "summary": procedure.summary, "doc": procedure.doc}
    return {**head, "settings": procedure.defaults}


def _text(procedure: Procedure) -> str:
    settings = [f"  --{name.replace('_', '-')} {_written(value)}" for name, value in procedure.defaults.items()]
    return "\n".join([procedure.doc, "", *settings])


def _written(value: Any) -> str:
    """The text of a default on the command line."""
    if isinstance(value, tuple):
        return ",".join(f"{part:g}" for part in value)
    return f"{value:g}" if isinstance(value, float) else str(value)
