"""The option --record of commands that read runs: the lab's record, by its URL, instead of the rig's own.

Runs are made in the rig's own record whatever it says, so commands that make them do not take it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import click

from rig.errors import RecordError
from rig.files import RECORD

TAKE_IT = frozenset(
    {"add", "calibrate", "certificate", "compare", "compensate", "control", "diagnose", "discover", "exclude"}
    | {"export", "fit", "history", "import", "noise", "report", "runs", "show", "web"}
)


def with_record(command: click.Command) -> click.Command:
    """The command, with the option where it is one of those, or where what it groups is."""
    if isinstance(command, click.Group):
        for each in command.commands.values():
            with_record(each)
    if command.name in TAKE_IT and OPTION not in command.params:
        command.params.append(OPTION)
    return command


def _chosen(context: click.Context, _: click.Parameter, url: str | None) -> None:
    """For as long as the command lasts, the environment says so: the processes that it starts go by it too."""
    if url is not None:
        require_no_password(url, RECORD)
        context.with_resource(_environment(url))


def require_no_password(url: str, instead: str) -> None:
    """Raises RecordError for a URL with a password: everybody on the machine can read how a command was called."""
    from rig.record.lab import has_password, lab_url  # who names no lab needs no driver

    if has_password(lab_url(url)):
        raise RecordError(
            "the URL holds a password, and everybody on this machine can read the words of a command; leave it to "
            f"~/.pgpass or PGPASSWORD, or give the URL as {instead}"
        )


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
