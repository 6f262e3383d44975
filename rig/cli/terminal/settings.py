"""A procedure's settings on the command line: `--step-deg 30`, `--set step_deg=30`; `--until-steady` alone for yes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import click


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
