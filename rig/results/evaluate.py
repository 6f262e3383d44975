"""The results of a run by the name of its procedure; the record is all that they are made of."""

from __future__ import annotations

import importlib
from pathlib import Path

from rig.record import Record, Run
from rig.results.result import Result


def evaluated(record: Record, run: Run) -> dict[str, Result]:
    """What the run's measurements come to, by name; nothing for a procedure without results.

    Raises DataError where the record does not hold enough for them.
    """
    name = run.procedure.replace("-", "_")
    if not Path(__file__).with_name(f"{name}.py").is_file():
        return {}
    found: dict[str, Result] = importlib.import_module(f"rig.results.{name}").evaluate(record, run)
    return found
