"""Output of commands: text for people, or with `--json` one document on standard output."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rig.cli.terminal.complete import complete_model
from rig.cli.terminal.progress import erase

if TYPE_CHECKING:
    from calibrations.discovery.verdict import Verdict

json_option = click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output.")
check_option = click.option("--check", is_flag=True, help="Exit with 1 unless the model is adequate.")
model_option = click.option(
    "--model",
    default=None,
    shell_complete=complete_model,
    help="A shipped model by name, or a model file. Default: by kind of data.",
)
FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
bench_option = click.option("--bench", "bench_file", type=FILE, help="The bench file; without it the simulated rig.")


def picture_options(help_text: str) -> Callable[[Any], Any]:
    """--pictures with this help, and --format: the arguments `folder` and `form`."""

    def decorated(function: Any) -> Any:
        form = click.option("--format", "form", type=click.Choice(["png", "svg"]), default="png", show_default=True)
        return click.option("--pictures", "folder", type=FOLDER, help=help_text)(form(function))

    return decorated


def range_option(help_text: str) -> Callable[[Any], Any]:
    """--input NAME=LOW:HIGH, which may be repeated: the argument `ranges`."""
    return click.option("--input", "ranges", multiple=True, metavar="NAME=LOW:HIGH", help=help_text)


def watch_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """--unattended and --answers."""
    function = click.option("--unattended", is_flag=True, help="Ask no questions, show only the end.")(function)
    return click.option("--answers", type=FILE, help="A YAML file with answers to the questions.")(function)


class Positive(click.FloatRange):
    """A finite number above 0."""

    name = "positive number"

    def __init__(self) -> None:
        super().__init__(min=0, min_open=True)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number; give one above 0", param, ctx)
        return number


def emit(document: dict[str, Any]) -> None:
    """Print the JSON document. Raises ValueError for NaN and infinity, which JSON does not have."""
    click.echo(json.dumps(document, allow_nan=False, ensure_ascii=False))


def note(text: str) -> None:
    """Print progress or a remark to standard error; standard output is for results."""
    erase()
    click.echo(text, err=True)


def verdict_status(verdict: Verdict, check: bool = False) -> int:
    """1 if an output does not respond, and with --check unless the model is adequate; else 0."""
    from calibrations.discovery.verdict import Verdict

    return int(verdict is Verdict.NO_RESPONSE or (check and verdict is not Verdict.ADEQUATE))


def notes(lines: Iterable[str]) -> None:
    """Print several remarks."""
    for line in lines:
        note(line)
