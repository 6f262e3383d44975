"""The next experiment of an answer, planned on the bench of the request."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from calibrations.discovery.results import Diagnosis, Discovery
from calibrations.effects import Effect
from rig.services.request import Request

Answer = TypeVar("Answer", Diagnosis[Any], Discovery[Any])


def planned(result: Answer, request: Request, effects: Mapping[str, Effect], tell: Callable[[str], None]) -> Answer:
    """The answer with its next experiment as a command; `tell` hears where that is on another bench."""
    if result.next_experiment is None:
        return result
    from rig.planning.foresight import with_next  # planning loads procedures, drivers and the simulated bench

    return with_next(result, request.data, effects, request.bench_file, tell)
