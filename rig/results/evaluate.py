"""The results of a run, computed from the record by the evaluation of its procedure."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

from calibrations.errors import CalibrationError
from calibrations.text import join_words
from rig.bench import Bench
from rig.errors import RecordError
from rig.record import Record, Run
from rig.record.measured import MeasuredRun
from rig.results.result import EVALUATIONS, Evaluation, Missing, Result, documents

MODULES = {  # with the evaluation of each procedure, imported when it is needed
    **dict.fromkeys(("check-standard", "repeat", "temperature-cycle", "sweep"), "tumbles"),
    **dict.fromkeys(("level-check", "misalignment"), "alignment"),
    **dict.fromkeys(("noise-floor", "motion"), "samples"),
    **dict.fromkeys(("hand-positions", "hand-fields", "hand-turns"), "by_hand"),
    **dict.fromkeys(("rate-turn", "magnetometer-turn"), "triads"),
    "soak": "soak",
}


def judge_results(record: Record, run: Run) -> tuple[dict[str, Any], str | None]:
    """The run's results as documents with the verdicts by the limits of its bench, and a text on the missing results.

    Raises SensorFault if the samples show a fault of an instrument.
    """
    try:
        results = evaluate_results(record, record.run(run.run))  # read again: the number of its rows bounds the memory
    except (CalibrationError, RecordError) as error:
        return {}, f"none: {error}"
    determined = {name: result for name, result in results.items() if isinstance(result, Result)}
    return documents(determined, Bench.model_validate(run.bench).result_limits), _list_missing(results)


def _list_missing(results: Mapping[str, Result | Missing]) -> str | None:
    """The missing results, each reason once; None if no result is missing."""
    by_reason: dict[str, list[str]] = {}
    for name, result in results.items():
        if isinstance(result, Missing):
            by_reason.setdefault(result.why, []).append(name)
    return "; ".join(f"no {join_words(names, 'or')}: {reason}" for reason, names in by_reason.items()) or None


def evaluate_results(record: Record, run: Run) -> dict[str, Result | Missing]:
    """The run's results by name; empty for a procedure without results.

    In a batch the names begin with that of the sensor: `a1/bias-drift-x`. Results of the bench are given once. Raises
    DataError if the record has too few measurements.
    """
    if run.procedure not in MODULES:
        return {}
    evaluation = _evaluation(run.procedure)
    sensors = () if evaluation.of_bench else run.batch
    if not sensors:
        return dict(evaluation.evaluate(MeasuredRun(record, run)))
    by_sensor = {sensor: evaluation.evaluate(MeasuredRun(record, run, sensor)) for sensor in sensors}
    return {f"{sensor}/{name}": result for sensor, results in by_sensor.items() for name, result in results.items()}


def _evaluation(procedure: str) -> Evaluation:
    importlib.import_module(f"rig.results.{MODULES[procedure]}")  # registers it
    return EVALUATIONS[procedure]
