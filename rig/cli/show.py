"""show: one run: how it was made, how it ended, what it measured."""

from __future__ import annotations

import click

from rig.certificates import EXPIRED
from rig.cli.output import emit, json_option
from rig.record import Event, Record, Run
from rig.record.measured import table_of


@click.command("show")
@click.argument("run")
@json_option
def command(run: str, as_json: bool) -> None:
    """Show how RUN was made, how it ended, and the range of each of its columns."""
    with Record.to_find(run) as record:
        found, events = record.run(run), record.events(run)
        table = table_of(record, run) if found.rows else None
    ranges = {name: (float(v.min()), float(v.max())) for name, v in table.columns.items()} if table else {}
    if as_json:
        emit(_document(found, events, ranges))
    else:
        click.echo("\n".join(_lines(found, events, ranges)))


def _lines(run: Run, events: list[Event], ranges: dict[str, tuple[float, float]]) -> list[str]:
    ended = f"{run.state} {run.ended or ''}".strip()
    head = [f"{run.run}: {run.procedure}, {ended}, {run.rows} rows of {run.kind}", f"from {run.source}"]
    settings = [f"  {name} = {value}" for name, value in run.settings.items()]
    why = [run.message] if run.message else []
    why += [f"But {run.constants[EXPIRED]}."] if EXPIRED in run.constants else []
    columns = [f"  {name:16}{low:12.6g} .. {high:.6g}" for name, (low, high) in ranges.items()]
    return [*head, *why, *settings, *columns, *(f"  {event.at}  {event.what}: {event.text}" for event in events)]


def _document(run: Run, events: list[Event], ranges: dict[str, tuple[float, float]]) -> dict[str, object]:
    return {
        "schema": "rig.show/1",
        "run": run.run,
        "procedure": run.procedure,
        "state": run.state,
        "message": run.message,
        "kind": run.kind,
        "poses": run.rows,
        "settings": run.settings,
        "bench": run.bench,
        "identities": run.identities,
        "constants": run.constants,
        "created": run.created,
        "ended": run.ended,
        "columns": {name: {"min": low, "max": high} for name, (low, high) in ranges.items()},
        "events": [{"at": event.at, "what": event.what, "text": event.text} for event in events],
        "results": run.results,
        EXPIRED: run.constants.get(EXPIRED),
    }
