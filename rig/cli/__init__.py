"""The command line. `rig COMMAND` is the module `rig/cli/commands/COMMAND.py`, imported only when it is called.

A command module holds a click command named `command`; the first line of its docstring is its line in
`rig --help`. A hyphen in the name is an underscore in the file; `import` is `import_.py`. To add a command,
add a file. A command returns nothing, or the exit status (1: done, and a limit or check was not met).
"""

from __future__ import annotations

import ast
import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import click

from rig.cli.terminal.failure import exit_status
from rig.cli.terminal.options import with_record

FOLDER = Path(__file__).parent / "commands"
# The sections of `rig --help`. A command that is in none of them is listed under "Other".
GROUPS = {
    "Start": ("demo", "web"),
    "Measure": (
        "check", "procedures", "plan", "run", "resume", "runs", "show", "import", "exclude", "draw", "simulate",
    ),
    "Find what is missing": (
        "compare", "fit", "diagnose", "add", "discover", "noise", "report", "effects", "models",
    ),
    "Hand over": ("certificate", "compensate", "export", "export-model", "push"),
    "Look after": ("control", "history", "doctor", "completion"),
    "Many sensors": ("fleet",),
}  # fmt: skip


class Commands(click.Group):
    """The commands, found by the names of their files."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 click calls it so
        return sorted(name for path in FOLDER.glob("*.py") if (name := _name(path)))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        path = _path(cmd_name)
        if not path.is_file() or _name(path) != cmd_name:
            return None
        return with_record(cast(click.Command, importlib.import_module(f"{__name__}.commands.{path.stem}").command))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            from drivers.errors import did_you_mean

            known = self.list_commands(ctx)
            raise click.UsageError(f"no command {args[0]!r}.{did_you_mean(args[0], known)}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        names = self.list_commands(ctx)
        grouped = {name for group in GROUPS.values() for name in group}
        width = max(map(len, names))
        for title, group in {**GROUPS, "Other": tuple(name for name in names if name not in grouped)}.items():
            if group:
                with formatter.section(title):
                    formatter.write_dl([(name.ljust(width), _short_help(_path(name))) for name in group])


def _path(name: str) -> Path:
    stem = name.replace("-", "_")
    return FOLDER / f"{stem}_.py" if stem == "import" else FOLDER / f"{stem}.py"


def _name(path: Path) -> str:
    return path.stem.strip("_").replace("_", "-") if path.stem != "__init__" else ""


def _short_help(path: Path) -> str:
    """The first line of the module's docstring, without importing it; a leading `name: ` is dropped."""
    doc = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    first = doc.partition("\n")[0].rstrip(".")
    return first.removeprefix(f"{_name(path)}: ")


COMPLETE = "_RIG_COMPLETE"  # set by the completion script of a shell


@click.command(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="inertial-rig", prog_name="rig")
def rig() -> None:
    """Calibrate inertial sensors on a rig, and find physical effects that their model misses.

    DATA is a file or a run of the record. MODEL is the name of a shipped model or a file. `rig demo` shows a
    calibration on the simulated rig.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command and exit with its status; an error is one message."""
    # Before numpy is imported: the matrices are small, and threads that wait for each other slow a busy machine.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    if instruction := os.environ.get(COMPLETE):  # the shell asks what may follow
        from click.shell_completion import shell_complete

        raise SystemExit(shell_complete(rig, {}, "rig", COMPLETE, instruction))

    def call() -> Any:
        words = list(sys.argv[1:] if arguments is None else arguments)
        with rig.make_context("rig", words) as context:
            return rig.invoke(context)

    raise SystemExit(exit_status(call))
