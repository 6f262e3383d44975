"""Help on a procedure: its settings with defaults, units and meaning."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from procedures.catalogue import Procedure, find, paths
from procedures.settings import choices, meaning, setting_text, split_unit
from rig.bench import read_bench

HELP = ("-h", "--help")
WIDTH = 100


class ProcedureCommand(click.Command):
    """A command on a procedure: `COMMAND PROCEDURE --help` also shows the settings of the procedure."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if any(word in HELP for word in args) and args[0] in paths(_folder(args)):
            click.echo(f"{ctx.get_help()}\n\n{procedure_text(find(args[0], _folder(args)))}")
            ctx.exit()
        return super().parse_args(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The options of the command and the settings of its procedure."""
        items = super().shell_complete(ctx, incomplete)
        name = ctx.params.get("procedure")
        if name in paths(None) and incomplete.startswith("--"):
            options = (f"--{setting.replace('_', '-')}" for setting in find(name, None).defaults)
            items += [CompletionItem(option) for option in options if option.startswith(incomplete)]
        return items


def _folder(args: list[str]) -> Any:
    """The folder of own procedures of the bench file among the words of a command."""
    bench = next((args[k + 1] for k, word in enumerate(args[:-1]) if word == "--bench"), None)
    return read_bench(Path(bench) if bench else None).folders.procedures


def procedure_text(procedure: Procedure) -> str:
    """Description and settings of a procedure."""
    return "\n".join([procedure.doc, "", *settings_lines(procedure)])


def settings_lines(procedure: Procedure) -> Iterator[str]:
    """For each setting its option with unit and default, then its meaning and allowed values."""
    choices_by_name = choices(procedure)
    yield "Settings:"
    for name, default in procedure.defaults.items():
        shown = " ".join(filter(None, [setting_text(default), split_unit(name)[1]]))
        yield f"  --{name.replace('_', '-')}  (default: {shown or 'none'})"
        allowed = f"One of: {', '.join(choices_by_name[name])}." if name in choices_by_name else ""
        if text := " ".join(filter(None, [meaning(procedure, name), allowed])):
            yield click.wrap_text(text, WIDTH, "        ", "        ")
