"""The results of a run, computed from the record by the file of its procedure."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calibrations.errors import CalibrationError
from calibrations.text import joined
from rig.bench import Bench
from rig.errors import RecordError
from rig.record import Record, Run
from rig.record.measured import Measured, sensors_of
from rig.results.result import Missing, Result, documents


def judged(record: Record, run: Run) -> tuple[dict[str, Any], str | None]:
    """The run's results as documents with the verdicts by the limits of its bench, and a text on the missing results.

    Raises SensorFault if the samples show a fault of an instrument.
    """
    try:
        results = evaluated(record, record.run(run.run))  # read again: the number of its rows bounds the memory
    except (CalibrationError, RecordError) as error:
        return {}, f"none: {error}"
    given = {name: result for name, result in results.items() if isinstance(result, Result)}
    return documents(given, Bench.model_validate(run.bench).result_limits), _missing(results)


def _missing(results: Mapping[str, Result | Missing]) -> str | None:
    """The missing results, each reason once; None if no result is missing."""
    by_reason: dict[str, list[str]] = {}
    for name, result in results.items():
        if isinstance(result, Missing):
            by_reason.setdefault(result.why, []).append(name)
    return "; ".join(f"no {joined(names, 'or')}: {why}" for why, names in by_reason.items()) or None


def evaluated(record: Record, run: Run) -> dict[str, Result | Missing]:
    """The run's results by name; empty for a procedure without results.

    In a batch the names begin with that of the sensor: `a1/bias-drift-x`. Results of the bench (OF_THE_BENCH in the
    file) are given once. Raises DataError if the record has too few measurements.
    """
    name = run.procedure.replace("-", "_")
    if not Path(__file__).with_name(f"{name}.py").is_file():
        return {}
    module = importlib.import_module(f"rig.results.{name}")
    sensors = [] if getattr(module, "OF_THE_BENCH", False) else sensors_of(run)
    if not sensors:
        results: dict[str, Result | Missing] = module.evaluate(Measured(record, run))
        return results
    by_sensor = {sensor: module.evaluate(Measured(record, run, sensor)) for sensor in sensors}
    return {f"{sensor}/{name}": result for sensor, of_one in by_sensor.items() for name, result in of_one.items()}


# The names that results can have: NAMES of each procedure's file, in which `{axis}` stands for any axis.

AXES = "xyz"


def names() -> list[str]:
    """The names of results of all shipped procedures, in alphabetical order."""
    files = (path.stem for path in Path(__file__).parent.glob("[a-z]*.py"))
    modules = [importlib.import_module(f"rig.results.{file}") for file in files]
    patterns = [pattern for module in modules for pattern in getattr(module, "NAMES", ())]
    return sorted({pattern.format(axis=axis) for pattern in patterns for axis in AXES})
