"""Output of commands: text for people, or with `--json` one document on standard output."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rig.cli.terminal.complete import complete_model
from rig.cli.terminal.progress import erase
from rig.files import require_new, require_out

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


# Output files. A file that exists is refused before the work begins, unless the command has --force.


INPUTS = ("data", "model", "models", "noise", "sources", "before", "bench_file", "answers")  # parameters with files


def _set_force(context: click.Context, _: click.Parameter, force: bool) -> None:
    context.meta[force_option.__name__] = force


def force_option(function: Any) -> Any:
    """--force, for a command that calls `require_outputs`."""
    words = "Replace output files that exist."
    return click.option("--force", is_flag=True, expose_value=False, callback=_set_force, help=words)(function)


def require_outputs(*paths: Path | None) -> None:
    """Raises OutputError for an input or a device, and unless --force is given, for a file that exists."""
    context = click.get_current_context()
    for path in filter(None, paths):
        require_out(path, *_inputs(context))
        if not context.meta.get(force_option.__name__):
            require_new(path)


def _inputs(context: click.Context) -> Iterator[str | Path]:
    for value in (context.params.get(name) for name in INPUTS):
        yield from value if isinstance(value, tuple) else (value,) if value else ()


def out_option(help_text: str, name: str = "--out", **attributes: Any) -> Callable[[Any], Any]:
    """An option for one output file, which is checked before the command begins; and --force."""

    def decorated(function: Any) -> Any:
        @wraps(function)
        def checked(**words: Any) -> Any:
            require_outputs(click.get_current_context().params[name.lstrip("-")])
            return function(**words)

        return click.option(name, type=FILE, help=help_text, **attributes)(force_option(checked))

    return decorated


def picture_options(help_text: str) -> Callable[[Any], Any]:
    """--pictures with this help, and --format: the arguments `folder` and `form`.

    A folder that already has pictures of the format is refused before the command begins, unless --force is given.
    """

    def decorated(function: Any) -> Any:
        @wraps(function)
        def checked(folder: Path | None, form: str, **words: Any) -> Any:
            if folder is not None:
                require_outputs(*sorted(folder.glob(f"*.{form}")))
            return function(folder=folder, form=form, **words)

        has_force = any(option.name == "force" for option in getattr(function, "__click_params__", ()))
        checked = checked if has_force else force_option(checked)
        form_option = click.option(
            "--format", "form", type=click.Choice(["png", "svg"]), default="png", show_default=True
        )
        return click.option("--pictures", "folder", type=FOLDER, help=help_text)(form_option(checked))

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
