"""Exclude poses from every analysis, or include them again.

The record keeps the pose, its samples and the reason. The results of a complete run are computed again.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from calibrations.tables import MEANS
from rig.errors import RecordError, UnknownRun
from rig.lease import lease
from rig.record import Record, Run
from rig.results import judge_results

RESULTS = "results"  # the event with the reason for the new results


def exclude(record: Record, name: str, numbers: Sequence[int], reason: str | None) -> Run:
    """Exclude poses with a reason; None includes them again. Returns the run afterwards.

    Results of a complete run are evaluated again. Raises UnknownRun, RecordError for a pose that is not there or a
    sample of an imported record, Busy while a process works on the run.
    """
    run = record.run(name)
    if not run.bench and run.kind not in MEANS:
        raise RecordError(
            f"run {run.run} is an imported table of {run.kind}: its rows are samples, and a single sample cannot be "
            "excluded; remove it from the file and import the file again"
        )
    with lease(record.folder, run.run, f"run {run.run}"):
        record.exclude(run.run, numbers, reason)
        if run.state == "complete" and run.bench:  # an imported table has no results
            _evaluate_again(record, run)
    return record.run(run.run)


def find_numbered_run(data: str) -> str | None:
    """The run that `data` names, where it has poses that can be left out; None of a file, and of samples."""
    if Path(data).exists():
        return None
    with suppress(UnknownRun), Record.to_find(data) as record:
        run = record.run(data.partition("/")[0])
        return run.run if run.kind in MEANS else None
    return None


def _evaluate_again(record: Record, run: Run) -> None:
    """Evaluate the remaining poses. If they do not determine every result, an event gives the reason."""
    results, reason = judge_results(record, run)
    if results or reason:
        record.set_results(run.run, results)
        record.note(run.run, RESULTS, reason or "evaluated again")
    elif run.results:
        record.note(run.run, RESULTS, "computed by the procedure during the run from all poses; not evaluated again")
