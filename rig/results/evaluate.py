"""The results of a run by the name of its procedure; the record is all that they are made of."""

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
    """The run's results as documents, judged by the limits of its bench; and which of them are missing, and why.

    An instrument's fault that shows only now is raised: SensorFault.
    """
    try:
        found = evaluated(record, record.run(run.run))  # as it is now: the number of its rows bounds the memory
    except (CalibrationError, RecordError) as error:
        return {}, f"none: {error}"
    given = {name: result for name, result in found.items() if isinstance(result, Result)}
    return documents(given, Bench.model_validate(run.bench).result_limits), _missing(found)


def _missing(found: Mapping[str, Result | Missing]) -> str | None:
    """What is missing, each reason once; None where nothing is."""
    by_reason: dict[str, list[str]] = {}
    for name, result in found.items():
        if isinstance(result, Missing):
            by_reason.setdefault(result.why, []).append(name)
    return "; ".join(f"no {joined(names, 'or')}: {why}" for why, names in by_reason.items()) or None


def evaluated(record: Record, run: Run) -> dict[str, Result | Missing]:
    """What the run's measurements come to, by name; nothing for a procedure without results.

    Those of a batch begin with the sensor's name: `a1/bias-drift-x`. What belongs to the bench (OF_THE_BENCH of the
    file) is given once. Raises DataError where the record does not hold enough.
    """
    name = run.procedure.replace("-", "_")
    if not Path(__file__).with_name(f"{name}.py").is_file():
        return {}
    module = importlib.import_module(f"rig.results.{name}")
    sensors = [] if getattr(module, "OF_THE_BENCH", False) else sensors_of(run)
    if not sensors:
        found: dict[str, Result | Missing] = module.evaluate(Measured(record, run))
        return found
    each = {sensor: module.evaluate(Measured(record, run, sensor)) for sensor in sensors}
    return {f"{sensor}/{name}": result for sensor, results in each.items() for name, result in results.items()}


# The names that results can have: NAMES of each procedure's file, in which `{axis}` stands for any axis.

AXES = "xyz"


def names() -> list[str]:
    """Those of all shipped procedures, in alphabetical order."""
    files = (path.stem for path in Path(__file__).parent.glob("[a-z]*.py"))
    patterns = [each for file in files for each in getattr(importlib.import_module(f"rig.results.{file}"), "NAMES", ())]
    return sorted({pattern.format(axis=axis) for pattern in patterns for axis in AXES})
