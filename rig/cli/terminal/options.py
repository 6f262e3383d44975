"""Options that several commands share: the lab's record, the settings of a procedure, the request of an analysis."""

from __future__ import annotations

import os
import re
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
    """Add the option --record to a command, or to the commands of a group, that reads runs."""
    if isinstance(command, click.Group):
        for subcommand in command.commands.values():
            with_record(subcommand)
    if command.name in TAKE_IT and OPTION not in command.params:
        command.params.append(OPTION)
    return command


def _set_environment(context: click.Context, _: click.Parameter, url: str | None) -> None:
    """Set the environment variable for the duration of the command, also for processes that it starts."""
    if url is not None:
        require_no_password(url, RECORD)
        context.with_resource(_environment(url))


def require_no_password(url: str, instead: str) -> None:
    """Raises RecordError for a URL with a password: all users of the machine can read the words of a command."""
    from rig.lab_url import has_password, lab_url  # slow to import; only needed with a URL

    if has_password(lab_url(url)):
        raise RecordError(
            "the URL has a password, and all users of this machine can read the words of a command; put it into "
            f"~/.pgpass or PGPASSWORD, or give the URL as {instead}"
        )


@contextmanager
def _environment(url: str) -> Iterator[None]:
    previous = os.environ.get(RECORD)
    os.environ[RECORD] = url
    try:
        yield
    finally:
        os.environ.pop(RECORD)
        if previous is not None:
            os.environ[RECORD] = previous


OPTION = click.Option(
    ["--record"], metavar="URL", expose_value=False, callback=_set_environment, is_eager=True,
    help=f"Read from the lab's record, postgresql://USER@HOST/DATABASE. Default: {RECORD}, else the rig's record.",
)  # fmt: skip


# A procedure's settings on the command line: `--step-deg 30`, `--set step_deg=30`; `--until-steady` alone for yes.


def settings_arguments(function: Callable[..., Any]) -> Callable[..., Any]:
    """Arguments `given` (the rest of the line) and `pairs` (from `--set`); `read_settings` joins them."""
    function = click.argument("given", nargs=-1, type=click.UNPROCESSED, metavar="[--SETTING VALUE]...")(function)
    return click.option("--set", "pairs", multiple=True, metavar="NAME=VALUE", help="A setting; may be repeated.")(
        function
    )


PASS_ON = {"ignore_unknown_options": True}  # for commands whose procedure has its own options


def read_settings(words: Sequence[str], pairs: Sequence[str], defaults: Mapping[str, Any]) -> dict[str, str]:
    """Settings by name, as text; a switch without a value means yes.

    Raises UsageError for words other than `--name value`.
    """
    settings = dict(_pair(pair) for pair in pairs)
    remaining = list(words)
    while remaining:
        word = remaining.pop(0)
        if not word.startswith("--"):
            raise click.UsageError(f"{word!r} is not expected here; a setting is --name value")
        name, equals, value = word.removeprefix("--").partition("=")
        key = name.replace("-", "_")
        if not equals and isinstance(defaults.get(key), bool) and (not remaining or remaining[0].startswith("--")):
            value = "yes"
        elif not equals:
            if not remaining:
                raise click.UsageError(f"--{name} needs a value")
            value = remaining.pop(0)
        settings[key] = value
    return settings


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"--set {text!r}: a setting is NAME=VALUE")
    return name.replace("-", "_"), value


class DataCommand(click.Command):
    """A command with DATA and --model: a model after DATA belongs to --model."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        values, words, _ = self.make_parser(ctx).parse_args(list(args))
        several = values["data"][1:] if isinstance(values["data"], tuple) else ()
        if model := next(filter(_is_model, (*several, *words)), None):
            raise click.UsageError(f"{model} is a model: give it as --model {model}", ctx)
        return super().parse_args(ctx, args)


def _is_model(word: str) -> bool:
    """Whether a word is the name of a shipped model, or that of a model file."""
    from calibrations.model.file import shipped_names

    return word.endswith((".yaml", ".yml")) or word in shipped_names()


# The options that the analysis commands share, as one argument `request`.


OPTIONS = (
    bench_option,
    click.option(
        "--noise",
        help="Noise model of this sensor, fitted to a still record; it replaces the estimate of the slow noise.",
    ),
    click.option("--channel", help="Channel of a still record: vx, vy ... Default: every axis."),
    click.option("--rate", "rate_hz", type=Positive(), help="Samples a second, for an array (.npy)."),
    json_option,
)


def request_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Options --bench, --noise, --channel, --rate and --json; with DATA and --model they make the argument `request`.

    With several DATA the request has the first, and the argument `several` has all of them.
    """

    @wraps(function)
    def wrapped(
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
        wrapped = option(wrapped)
    return wrapped


def input_range(text: str) -> tuple[str, tuple[float, float]]:
    """The name and range in `NAME=LOW:HIGH`. Raises UsageError."""
    parts = re.fullmatch(r"([a-z]\w*)=([^:]+):([^:]+)", text)
    try:
        name, low, high = parts.groups() if parts else ("", "", "")
        ends = float(low), float(high)
    except ValueError:
        ends = (1.0, 0.0)
    if not ends[0] < ends[1]:
        raise click.UsageError(f"--input {text!r}: write NAME=LOW:HIGH, as in temperature_c=0:60")
    return name, ends
