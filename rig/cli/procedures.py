"""procedures: list the procedures and what each is for."""

from __future__ import annotations

from pathlib import Path

import click

from procedures.catalogue import find, paths, summary
from rig.bench import read_bench
from rig.cli.output import bench_option, columns, emit, json_option


@click.command("procedures")
@bench_option
@json_option
def command(bench_file: Path | None, as_json: bool) -> None:
    """List the procedures, shipped and your own, and what each is for."""
    folder = read_bench(bench_file).folders.procedures
    if not as_json:
        click.echo(columns(("procedure", "for"), [(name, summary(path)) for name, path in paths(folder).items()]))
        return
    found = [find(name, folder) for name in paths(folder)]
    listed = [{"name": p.name, "summary": p.summary, "doc": p.doc, "settings": p.defaults} for p in found]
    emit({"schema": "rig.procedures/1", "procedures": listed})
