"""Which sensors a run measured. A sensor goes by its serial number, and by its name where it has none."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from calibrations.presentation.text import as_written
from calibrations.tables import MEANS
from rig.record import Run
from rig.record.measured import sensors_of


def members(run: Run) -> dict[str, str]:
    """Serial number (or name) -> the sensor's name in the run's batch, "" where there is one sensor."""
    if batch := sensors_of(run):
        said: dict[str, Mapping[str, str]] = {member: run.bench["sensors"][member] for member in batch}
        return {each.get("serial") or each["name"]: member for member, each in said.items()}
    name = run.constants.get("serial") or run.constants.get("sensor")
    return {as_written(name): ""} if name else {}


def sensors(runs: Iterable[Run]) -> list[str]:
    """Every sensor of the runs."""
    return list(dict.fromkeys(each for run in runs for each in members(run)))


def calibrating(runs: Iterable[Run]) -> dict[str, list[Run]]:
    """The complete runs of each sensor that models may be fitted to."""
    found: dict[str, list[Run]] = {}
    for run in runs:
        if run.state == "complete" and run.kind in MEANS:
            for sensor in members(run):
                found.setdefault(sensor, []).append(run)
    return found


def lives(run: Run, runs: Iterable[Run]) -> dict[str, int]:
    """How many calibrating runs there are of each sensor of `run`, where more than one."""
    of = calibrating(runs)
    counts = {sensor: len(of.get(sensor, ())) for sensor in members(run)}
    return {sensor: count for sensor, count in counts.items() if count > 1}
