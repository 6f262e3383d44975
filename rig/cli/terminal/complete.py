"""The words that a shell offers for an unfinished word: procedures, runs and files, sensors, effects.

Nothing is imported before a shell asks, and an error offers nothing: a message would appear inside the typed line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps

import click
from click.shell_completion import CompletionItem

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]
MOST_RUNS = 50  # newest first


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
    """The newest runs by id, their sensors, and `last`."""
    from rig.record import Record

    if not Record.is_there():
        return []
    with Record.to_read() as record:
        runs = record.runs()[:MOST_RUNS]
    sensors = [name for run in runs for name in run.sensors if " " not in name]
    return [*(run.run for run in runs), *sensors, *(["last"] if runs else [])]


@_offer
def complete_sensor() -> Iterable[str]:
    """The sensors of the record, by name and serial number."""
    from rig.record import Record

    if not Record.is_there():
        return []
    with Record.to_read() as record:
        return [name for run in record.runs() for name in run.sensors]


def complete_data(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Files and runs. The item for files is first, because bash drops the items before it."""
    return [CompletionItem(begun, type="file"), *complete_run(context, parameter, begun)]
