"""The directive `command-reference`: usage, text and options of every command, from the commands themselves."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator

import click
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from rig.cli import SECTIONS, Commands
from rig.cli import rig as group


class CommandReference(SphinxDirective):
    """One section for each group of `rig --help`, one below it for each command."""

    def run(self) -> list[nodes.Node]:
        return self.parse_text_to_nodes("\n".join(reference()), allow_section_headings=True)


def reference() -> Iterator[str]:
    """Markdown of the whole reference, line by line."""
    context = click.Context(group, info_name="rig")
    commands = Commands()
    for title, members in SECTIONS.items():
        yield f"## {title}\n"
        for name in members:
            command = commands.get_command(context, name)
            if command is None:
                raise ValueError(f"rig.cli.SECTIONS names {name}, which is no command")
            yield from section(command, click.Context(command, info_name=name, parent=context), "###")


def section(command: click.Command, context: click.Context, mark: str) -> Iterator[str]:
    """One command, and those below it."""
    yield f"{mark} {context.command_path}\n"
    yield f"```text\n{command.get_usage(context).removeprefix('Usage: ')}\n```\n"
    yield prose(command.help or "")
    rows = [record for each in command.params if (record := each.get_help_record(context))]
    if rows:
        yield "\n| option | meaning |\n| --- | --- |"
        yield from (f"| `{cell(option)}` | {cell(prose(text))} |" for option, text in rows)
    yield ""
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            if below := command.get_command(context, name):
                yield from section(below, click.Context(below, info_name=name, parent=context), mark + "#")


def prose(text: str) -> str:
    """Help text as Markdown: a part that click does not wrap is shown as it is; no word is taken for a tag."""
    parts = inspect.cleandoc(text).split("\n\n")
    return "\n\n".join(
        f"```text\n{part.removeprefix(chr(8)).strip(chr(10))}\n```" if part.startswith("\b") else plain(part)
        for part in parts
    )


def plain(text: str) -> str:
    """Text with the marks of Markdown escaped outside `code`."""
    return "".join(
        part if part.startswith("`") else re.sub(r"([*_<>\[\]])", r"\\\1", part)
        for part in re.split(r"(`[^`]*`)", text)
    )


def cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("command-reference", CommandReference)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
