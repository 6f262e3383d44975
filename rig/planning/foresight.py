"""The next experiment of an answer, planned on the bench that was named; and whether the data are of that bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from calibrations.effects import Effect
from rig.bench import read_bench
from rig.planning.next_experiment import Answer, proposed
from rig.record import Record


def with_next(
    result: Answer, data: str, effects: Mapping[str, Effect], bench_file: Path | None, tell: Callable[[str], None]
) -> Answer:
    """The answer with its next experiment as a command; the same where nothing is in dispute.

    A command that measures on another bench than the data came from would tell nothing, and `tell` hears it.
    """
    if result.next_experiment is None:
        return result
    bench = read_bench(bench_file)
    if (theirs := _measured_on(data)) not in (None, bench.name):
        tell(
            f'{data} was measured on the bench "{theirs}", and the next experiment is planned on "{bench.name}"; '
            "name that bench's file with --bench."
        )
    return proposed(result, effects, bench, bench_file)


def _measured_on(data: str) -> str | None:
    """The name of the bench of a run; None of a file, or of a table that was imported."""
    if Path(data).is_file():
        return None
    with Record.to_find(data) as record:
        name = record.run(data.partition("/")[0]).bench.get("name")
    return None if name is None else str(name)
