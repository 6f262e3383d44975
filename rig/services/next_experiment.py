"""The next experiment of a diagnosis, planned on the bench of the request."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from calibrations.discovery.results import Diagnosis, Discovery
from calibrations.effects import Effect
from rig.services.request import Request

Answer = TypeVar("Answer", Diagnosis[Any], Discovery[Any])


def planned(result: Answer, request: Request, effects: Mapping[str, Effect], notify: Callable[[str], None]) -> Answer:
    """The result with its next experiment as a command, if it has one.

    A measurement on another bench than that of the data would not help: `notify` receives a remark about that.
    """
    if result.next_experiment is None:
        return result
    from rig.bench import read_bench  # planning loads procedures, drivers and the simulated bench
    from rig.planning.next_experiment import with_next_experiment

    bench = read_bench(request.bench_file)
    if (source_bench := _bench_of(request.data)) not in (None, bench.name):
        notify(
            f'{request.data} was measured on the bench "{source_bench}", but the next experiment is planned for '
            f'"{bench.name}"; give the file of that bench with --bench.'
        )
    return with_next_experiment(result, effects, bench, request.bench_file)


def _bench_of(data: str) -> str | None:
    """The name of the bench of a run; None for a file or an imported table."""
    if Path(data).is_file():
        return None
    from rig.record import Record

    with Record.to_find(data) as record:
        name = record.run(data.partition("/")[0]).bench.get("name")
    return None if name is None else str(name)
