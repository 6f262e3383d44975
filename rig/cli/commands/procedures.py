"""procedures: list the procedures with their purposes and settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from procedures.catalogue import Procedure, find, paths
from rig.bench import read_bench
from rig.cli.terminal.complete import complete_procedure
from rig.cli.terminal.output import bench_option, emit, json_option
from rig.cli.terminal.settings_help import procedure_text


@click.command("procedures")
@click.argument("procedure", required=False, shell_complete=complete_procedure)
@bench_option
@json_option
def command(procedure: str | None, bench_file: Path | None, as_json: bool) -> None:
    """List the shipped procedures and your own, with their purposes and settings; or one PROCEDURE."""
    folder = read_bench(bench_file).folders.procedures
    found = [find(name, folder) for name in ([procedure] if procedure else paths(folder))]
    if as_json:
        emit({"schema": "rig.procedures/1", "procedures": [_document(each) for each in found]})
    else:
        click.echo("\n\n".join(procedure_text(each) for each in found))


def _document(procedure: Procedure) -> dict[str, Any]:
    head = {"name": procedure.name, "summary": procedure.summary, "doc": procedure.doc}
    return {**head, "settings": procedure.defaults}
