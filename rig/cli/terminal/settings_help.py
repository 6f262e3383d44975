"""Help on a procedure: its settings with defaults, units and meaning."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from procedures.catalogue import Procedure, find, paths
from procedures.settings import choices
from rig.bench import read_bench

UNITS = {"deg_s": "deg/s", "m_s2": "m/s^2", "deg": "deg", "hz": "Hz", "um": "um", "c": "C", "s": "s"}  # ends of names
SHARED = {
    "dwell_s": "How long samples are averaged at each pose.",
    "settle_s": "How long the stages stand still before samples are taken.",
    "block_s": "A record is saved in blocks of this length, which is what a fault costs at most.",
}  # settings that mean the same in every procedure
HELP = ("-h", "--help")
WIDTH = 100


class ProcedureCommand(click.Command):
    """A command on a procedure: `COMMAND PROCEDURE --help` also shows the settings of the procedure."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if any(word in HELP for word in args) and args[0] in paths(_folder(args)):
            click.echo(f"{ctx.get_help()}\n\n{procedure_text(find(args[0], _folder(args)))}")
            ctx.exit()
        return super().parse_args(ctx, args)


def _folder(args: list[str]) -> Any:
    """The folder of own procedures of the bench file among the words of a command."""
    bench = next((args[k + 1] for k, word in enumerate(args[:-1]) if word == "--bench"), None)
    return read_bench(Path(bench) if bench else None).folders.procedures


def procedure_text(procedure: Procedure) -> str:
    """Description and settings of a procedure."""
    return "\n".join([procedure.doc, "", *settings_lines(procedure)])


def settings_lines(procedure: Procedure) -> Iterator[str]:
    """For each setting the option with its default, then unit, allowed values and meaning."""
    choices_by_name = choices(procedure)
    for name, default in procedure.defaults.items():
        yield f"  --{name.replace('_', '-')} {default_text(default)}".rstrip()
        unit = next((UNITS[end] for end in UNITS if name.endswith(f"_{end}")), "")
        parts = [
            f"In {unit}." if unit else "",
            f"One of: {', '.join(choices_by_name[name])}." if name in choices_by_name else "",
        ]
        text = " ".join(filter(None, [*parts, meaning(procedure, name)]))
        if text:
            yield click.wrap_text(text, WIDTH, "        ", "        ")


def meaning(procedure: Procedure, name: str) -> str:
    """The sentences of the procedure's docstring that name the setting; else what it means in every procedure."""
    doc = " ".join(inspect.cleandoc(procedure.function.__doc__ or "").split())
    sentences = re.split(r"(?<=[.:])\s+(?=[A-Z`])", doc)
    own_sentences = " ".join(sentence for sentence in sentences if re.search(rf"`{name}[`=]", sentence)).replace(
        "`", ""
    )
    return own_sentences or SHARED.get(name, "")


def default_text(value: Any) -> str:
    """The text of a default on the command line."""
    if isinstance(value, tuple):
        return ",".join(f"{part:g}" for part in value)
    return f"{value:g}" if isinstance(value, float) else str(value)
