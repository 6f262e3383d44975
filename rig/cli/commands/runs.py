"""runs: list the runs of the record, newest first."""

from __future__ import annotations

import click

from calibrations.text import columns
from rig.cli.terminal.output import emit, json_option, notes
from rig.record import Record, Run


@click.command("runs")
@json_option
def command(as_json: bool) -> None:
    """List the runs of the record, newest first."""
    with Record.to_read() as record:
        runs, damaged = record.runs(), record.damaged_runs()
    notes(damaged)
    if as_json:
        emit({"schema": "rig.runs/1", "runs": [_document(run) for run in runs]})
    elif runs or damaged:
        rows = [(run.run, run.state, run.kind, run.extent, run.source) for run in runs]
        click.echo(columns(("run", "state", "kind", "holds", "source"), rows))
    else:
        click.echo("The record is empty. `rig run sweep` makes a run, `rig import FILE` stores a file.")


def _document(run: Run) -> dict[str, object]:
    return {
        "run": run.run,
        "procedure": run.procedure,
        "state": run.state,
        "poses": run.rows,
        "kind": run.kind,
        "settings": run.settings,
        "source": run.source,
        "created": run.created,
        "ended": run.ended,
    }
