"""Options that several commands share: the lab's record, the settings of a procedure, the request of an analysis."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import click

from rig.cli.terminal.output import Positive, bench_option, json_option
from rig.errors import RecordError
from rig.files import RECORD
from rig.services.request import Request

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


# A procedure's settings on the command line: `--step-deg 30`, `--set step_deg=30`; `--until-steady` alone for yes.


def settings_arguments(function: Callable[..., Any]) -> Callable[..., Any]:
    """Gives a command `given` (the rest of its line) and `pairs` (of `--set`); `read_settings` joins them."""
    function = click.argument("given", nargs=-1, type=click.UNPROCESSED, metavar="[--SETTING VALUE]...")(function)
    return click.option("--set", "pairs", multiple=True, metavar="NAME=VALUE", help="A setting; may be repeated.")(
        function
    )


PASS_ON = {"ignore_unknown_options": True}  # of a command whose procedure has options of its own


def read_settings(given: Sequence[str], pairs: Sequence[str], defaults: Mapping[str, Any]) -> dict[str, str]:
    """Settings by name, as text; one that is yes or no by its default means yes where no value follows.

    Raises UsageError for a line that is not made of `--name value`.
    """
    settings = dict(_pair(pair) for pair in pairs)
    rest = list(given)
    while rest:
        word = rest.pop(0)
        if not word.startswith("--"):
            raise click.UsageError(f"{word!r} is not expected here; a setting is --name value")
        name, equals, value = word.removeprefix("--").partition("=")
        key = name.replace("-", "_")
        if not equals and isinstance(defaults.get(key), bool) and (not rest or rest[0].startswith("--")):
            value = "yes"
        elif not equals:
            if not rest:
                raise click.UsageError(f"--{name} needs a value")
            value = rest.pop(0)
        settings[key] = value
    return settings


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"--set {text!r}: a setting is NAME=VALUE")
    return name.replace("-", "_"), value


# The options that the analysis commands share, as one argument `request`.


OPTIONS = (
    bench_option,
    click.option(
        "--noise",
        help="A noise model of this sensor, fitted to a still record: slow noise is then known, and not guessed.",
    ),
    click.option("--channel", help="Of a still record: vx, vy ... Default: every axis."),
    click.option("--rate", "rate_hz", type=Positive(), help="Samples a second, for an array (.npy)."),
    json_option,
)


def request_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """--bench, --noise, --channel and --rate go, with the command's own DATA and --model, into `request`; and --json.

    Of several DATA the request is about the first, and the command gets them all as `several`.
    """

    @wraps(function)
    def inside(
        data: str | tuple[str, ...],
        model: str | None,
        bench_file: Path | None,
        noise: str | None,
        channel: str | None,
        rate_hz: float | None,
        **others: Any,
    ) -> Any:
        several = {"several": data} if isinstance(data, tuple) else {}
        first = data if isinstance(data, str) else next(iter(data), "")
        return function(request=Request(first, model, bench_file, noise, channel, rate_hz), **several, **others)

    for option in reversed(OPTIONS):
        inside = option(inside)
    return inside
