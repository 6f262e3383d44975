"""models: list the shipped models."""

from __future__ import annotations

import click

from calibrations.text import columns
from rig.cli.terminal.output import emit, json_option


@click.command("models")
@json_option
def command(as_json: bool) -> None:
    """List the shipped models and their effects."""
    from calibrations.model.file import read_model, shipped_names

    models = [read_model(name) for name in shipped_names()]
    if as_json:
        emit({"schema": "rig.models/1", "models": [{"model": m.name, "effects": list(m.effects)} for m in models]})
    else:
        click.echo(columns(("model", "effects"), [(m.name, ", ".join(m.effects)) for m in models]))
