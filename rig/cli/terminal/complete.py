"""The words that a shell offers for an unfinished word: procedures, runs and files, sensors, effects.

Nothing is imported before a shell asks, and an error offers nothing: a message would appear inside the typed line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps

import click
from click.shell_completion import CompletionItem, get_completion_class, shell_complete

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]
MOST_RUNS = 50  # newest first
LAST = "last"  # the newest run, or with the name of a procedure as the next word the newest of these


def _offer(words: Callable[[], Iterable[str]]) -> Complete:
    """The completion by those of `words` that begin as the unfinished one does."""

    @wraps(words)
    def complete(_context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
        try:
            offers = [word for word in words() if word.startswith(begun)]
        except Exception:
            return []
        return [CompletionItem(word) for word in dict.fromkeys(offers)]

    return complete


@_offer
def complete_procedure() -> Iterable[str]:
    """The shipped procedures."""
    from procedures.catalogue import paths

    return paths(None)


@_offer
def complete_effect() -> Iterable[str]:
    """The effects of the catalogue."""
    from calibrations.effects.catalogue import catalogue

    return catalogue()


@_offer
def _shipped_models() -> Iterable[str]:
    from calibrations.model.file import shipped_names

    return shipped_names()


def complete_model(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Files and the shipped models. The item for files is first, because bash drops the items before it."""
    return [CompletionItem(begun, type="file"), *_shipped_models(context, parameter, begun)]


@_offer
def complete_run() -> Iterable[str]:
    """`last`, the newest runs by id, and their sensors."""
    from rig.record import Record

    if not Record.is_there():
        return []
    with Record.to_read() as record:
        runs = record.runs()[:MOST_RUNS]
    sensors = [name for run in runs for name in run.sensors if " " not in name]
    return [*([LAST] if runs else []), *(run.run for run in runs), *sensors]


@_offer
def _complete_last() -> Iterable[str]:
    """The procedures of the runs: `last sweep` is the newest sweep."""
    from procedures.catalogue import paths
    from rig.record import Record

    if not Record.is_there():
        return []
    with Record.to_read() as record:
        measured = {run.procedure for run in record.runs()}
    return [name for name in paths() if name in measured]


@_offer
def complete_sensor() -> Iterable[str]:
    """The sensors of the record, by name and serial number."""
    from rig.record import Record

    if not Record.is_there():
        return []
    with Record.to_read() as record:
        return [name for run in record.runs() for name in run.sensors]


def answer_shell(command: click.Command, name: str, variable: str, instruction: str) -> int:
    """Answer a shell that asks for its script or completes a word, as the instruction in `variable` says."""
    shell, _, _ = instruction.partition("_")
    kind = get_completion_class(shell)
    if kind is not None and instruction.endswith("_complete"):
        asking = kind(command, {}, name, variable)
        words, begun = asking.get_completion_args()
        if words[-1:] == [LAST]:  # two words for one argument, which click does not know
            context = click.Context(command)
            for item in _complete_last(context, click.Argument([LAST]), begun):
                click.echo(asking.format_completion(item))
            return 0
    return shell_complete(command, {}, name, variable, instruction)


def complete_data(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Files and runs. The item for files is first, because bash drops the items before it."""
    return [CompletionItem(begun, type="file"), *complete_run(context, parameter, begun)]
