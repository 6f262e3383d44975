"""export: write a run, or a file, in another format."""

from __future__ import annotations

from pathlib import Path

import click

from rig.cli.terminal.complete import complete_data
from rig.cli.terminal.output import emit, json_option, note
from rig.cli.terminal.progress import working
from rig.services.export import FORMATS, export


@click.command("export")
@click.argument("data", shell_complete=complete_data)
@click.option("--format", "kind", type=click.Choice(FORMATS), default="csv", show_default=True)
@click.option("--out", "path", type=click.Path(path_type=Path), required=True, help="The file to write.")
@json_option
def command(data: str, kind: str, path: Path, as_json: bool) -> None:
    """Write DATA, a run or a file, to --out."""
    with working(f"writing {path}"):
        rows = export(data, kind, path)
    if as_json:
        emit({"schema": "rig.export/1", "data": data, "format": kind, "rows": rows, "path": str(path)})
    else:
        note(f"{rows} rows to {path}")
