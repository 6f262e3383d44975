"""The option --record of commands that read runs: the lab's record, by its URL, instead of the rig's own.

Runs are made in the rig's own record whatever it says, so commands that make them do not take it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import click

from rig.home import RECORD

TAKE_IT = frozenset(
    {"add", "certificate", "compare", "compensate", "control", "diagnose", "discover", "exclude", "export"}
    | {"fit", "history", "import", "noise", "plan", "report", "runs", "show", "web"}
)


def with_record(command: click.Command) -> click.Command:
    """The command, with the option where it is one of those."""
    if command.name in TAKE_IT and OPTION not in command.params:
        command.params.append(OPTION)
    return command


def _chosen(context: click.Context, _: click.Parameter, url: str | None) -> None:
    """For as long as the command lasts, the environment says so: the processes that it starts go by it too."""
    if url is not None:
        context.with_resource(_environment(url))


@contextmanager
def _environment(url: str) -> Iterator[None]:
    before = os.environ.get(RECORD)
    os.environ[RECORD] = url
    try:
        yield
    finally:
        os.environ.pop(RECORD)
        if before is not None:
            os.environ[RECORD] = before


OPTION = click.Option(
    ["--record"], metavar="URL", expose_value=False, callback=_chosen, is_eager=True,
    help=f"Of the lab, postgresql://USER@HOST/DATABASE, to read from; else {RECORD}, else the rig's own.",
)  # fmt: skip
