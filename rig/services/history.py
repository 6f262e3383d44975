"""The calibrations of a sensor in the order of time: each complete run that determines all parameters of a model.

Every calibration is computed anew from its samples by the same model, so all are comparable. Its date is that of the
run; an imported table has the constant `date` of its file (`# date: 2025-03-01`), else the day of the import.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta
from pathlib import Path

import numpy as np

from calibrations.analyses.control_chart import Chart, control_chart
from calibrations.analyses.stability import Stability, fit_stability
from calibrations.criteria import BASELINE_RUNS, FEWEST_FOR_DRIFT, FEWEST_RUNS, MATERIAL, SHORTEST_FOR_DRIFT_DAYS
from calibrations.errors import CalibrationError, DataError
from calibrations.fitting.fit import fit
from calibrations.fitting.problem_kinds import check_kind
from calibrations.means.noise import rms
from calibrations.model import Model
from calibrations.presentation.certificate.terms import name as result_name
from calibrations.tables import MEANS
from calibrations.text import as_written, rounded
from drivers.errors import did_you_mean
from rig.bench import read_bench
from rig.bench.certificates import EXPIRED
from rig.errors import RecordError, RigError
from rig.record import Record, Run
from rig.record.measured import MeasuredRun


def members(run: Run) -> dict[str, str]:
    """Serial number (or name) -> the sensor's name in the run's batch, "" with one sensor."""
    if batch := run.bench.get("sensors"):
        return {sensor.get("serial") or sensor["name"]: member for member, sensor in batch.items()}
    name = run.constants.get("serial") or run.constants.get("sensor")
    return {as_written(name): ""} if name else {}


def type_of(sensor: str, run: Run) -> str:
    """The type of a sensor that its serial number identifies, such as ADXL203; "" where the run does not have it."""
    name = (
        run.bench["sensors"][members(run)[sensor]]["name"] if run.bench.get("sensors") else run.constants.get("sensor")
    )
    return as_written(name) if name and as_written(name) != sensor else ""


def sensors(runs: Iterable[Run]) -> list[str]:
    """Every sensor of the runs."""
    return list(dict.fromkeys(sensor for run in runs for sensor in members(run)))


def calibrating(runs: Iterable[Run]) -> dict[str, list[Run]]:
    """The complete runs of each sensor that models may be fitted to."""
    by_sensor: dict[str, list[Run]] = {}
    for run in runs:
        if run.state == "complete" and run.kind in MEANS:
            for sensor in members(run):
                by_sensor.setdefault(sensor, []).append(run)
    return by_sensor


def calibration_counts(run: Run, runs: Iterable[Run]) -> dict[str, int]:
    """The number of calibrating runs of each sensor of `run` that has more than one."""
    runs_by_sensor = calibrating(runs)
    counts = {sensor: len(runs_by_sensor.get(sensor, ())) for sensor in members(run)}
    return {sensor: count for sensor, count in counts.items() if count > 1}


STALE_DAYS = 365.0  # without a limit that decides when a calibration is due
Limit = float | tuple[float, float]


@dataclass(frozen=True)
class ParameterValue:
    """One parameter of one calibration."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class Calibration:
    """One run's parameters by the names of certificates. `at` is its date and time, `kind` its procedure.

    `excess` is the remaining error, in noise floors.
    """

    data: str
    at: datetime
    rig: str
    values: Mapping[str, ParameterValue]
    expired: str | None
    kind: str = ""
    excess: float = 1.0

    @property
    def complete(self) -> bool:
        """Whether the remaining error is that of noise; else the values depend on the measured poses."""
        return self.excess <= MATERIAL

    @property
    def day(self) -> str:
        return self.at.date().isoformat()


@dataclass(frozen=True)
class Quantity:
    """One parameter over all calibrations that have it; `chart` None where they are too few.

    `line` is None for a reason, `no_drift`: too few, too short a time, or a model that is not complete.
    """

    name: str
    unit: str
    calibrations: tuple[Calibration, ...]
    chart: Chart | None
    line: Stability | None
    allowed: tuple[float, float] | None
    due: date | None
    no_drift: str = ""

    @property
    def last(self) -> ParameterValue:
        return self.calibrations[-1].values[self.name]


@dataclass(frozen=True)
class History:
    """The history of a sensor. `passed_over`: its runs that are no calibration by this model, with the reasons."""

    sensor: str
    model: str
    calibrations: tuple[Calibration, ...]
    quantities: tuple[Quantity, ...]
    passed_over: Mapping[str, str]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why values of these calibrations are not comparable."""
        open_ = [calibration for calibration in self.calibrations if not calibration.complete]
        if not open_:
            return ()
        worst = max(calibration.excess for calibration in open_)
        text = (
            f"The model {self.model} is not complete for {len(open_)} of {len(self.calibrations)} calibrations: the "
            f"remaining error is up to {rounded(worst, 2)} times the noise floor. The values depend on the measured "
            "poses, so no drift is computed. Choose a complete model."
        )
        return (text,)

    @property
    def due(self) -> date | None:
        """The first day on which one of the quantities is due."""
        return min((q.due for q in self.quantities if q.due is not None), default=None)


def history(
    record: Record,
    sensor: str,
    model: Model,
    limits: Mapping[str, Limit],
    baseline: int = BASELINE_RUNS,
    notify: Callable[[str], None] = lambda _: None,
) -> History:
    """The history of `sensor` by `model`, see `judge_history`; `notify` receives the run that is calibrated.

    Raises RecordError where the record has no calibration of it, naming the nearest sensor.
    """
    calibrations: list[Calibration] = []
    passed_over: dict[str, str] = {}
    runs = _runs(record, sensor)
    for k, (data, run) in enumerate(runs, 1):
        notify(f"Calibrating {data}, {k} of {len(runs)}")
        try:
            calibrations.append(_calibration(record, data, run, model))
        except (CalibrationError, RecordError) as error:
            passed_over[data] = _without_name(str(error), data)
    if not calibrations:
        raise _no_calibration_error(record, sensor, passed_over)
    calibrations, excluded = _most_frequent_kind(calibrations)
    passed_over |= excluded
    return judge_history(History(sensor, model.name, tuple(calibrations), (), passed_over), limits, baseline)


def _most_frequent_kind(calibrations: list[Calibration]) -> tuple[list[Calibration], dict[str, str]]:
    """The calibrations by the most frequent procedure, of equal ones the last; the others with the reason."""
    kinds = [calibration.kind for calibration in calibrations]
    kind = max(reversed(kinds), key=kinds.count)
    reason = "a calibration by {}; the history shows those by {}, because other poses are not comparable"
    excluded = {
        calibration.data: reason.format(calibration.kind, kind)
        for calibration in calibrations
        if calibration.kind != kind
    }
    return [calibration for calibration in calibrations if calibration.kind == kind], excluded


def latest(record: Record, sensor: str, model: Model) -> Calibration:
    """The last calibration of `sensor`. Earlier runs are not fitted. Raises RecordError as `history`."""
    passed_over: dict[str, str] = {}
    for data, run in reversed(_runs(record, sensor)):
        try:
            return _calibration(record, data, run, model)
        except (CalibrationError, RecordError) as error:
            passed_over[data] = _without_name(str(error), data)
    raise _no_calibration_error(record, sensor, passed_over)


def judge_history(life: History, limits: Mapping[str, Limit], baseline: int = BASELINE_RUNS) -> History:
    """The history with other limits, and with charts of another baseline. `limits` by result's name: a number is the
    greatest change since the last calibration, a pair the lowest and highest value."""
    calibrations = life.calibrations
    names = dict.fromkeys(name for calibration in calibrations for name in calibration.values)
    return replace(life, quantities=tuple(_quantity(name, calibrations, limits.get(name), baseline) for name in names))


def closest(calibrations: Sequence[Calibration], on: date) -> tuple[Calibration, float]:
    """The calibration closest to a day, and by how many days it is older than that day; below 0: later."""
    noon = datetime(on.year, on.month, on.day, 12, tzinfo=calibrations[0].at.tzinfo)
    days = [(noon - calibration.at) / timedelta(days=1) for calibration in calibrations]
    best = int(np.argmin(np.abs(days)))
    return calibrations[best], days[best]


def stale(life: History, calibration: Calibration, age_days: float) -> str | None:
    """Why a calibration is not valid for a day that is `age_days` later (below 0: earlier); None if it is valid."""
    day = calibration.at + timedelta(days=age_days)
    last = calibration is life.calibrations[-1]
    if last and life.due is not None and day.date() > life.due:
        return f"it was due on {life.due}"
    if abs(age_days) > STALE_DAYS:
        return f"it was measured {abs(age_days):.0f} days {'before' if age_days > 0 else 'after'} that day"
    return None


def _runs(record: Record, sensor: str) -> list[tuple[str, Run]]:
    """The complete runs of a sensor in the order of time, each with its name as data, such as `RUN/a1`."""
    complete = sorted((run for run in record.runs() if run.state == "complete"), key=run_date)
    members_and_runs = [(members(run).get(sensor), run) for run in complete]
    return [
        (f"{run.run}/{member}" if member else run.run, run) for member, run in members_and_runs if member is not None
    ]


def _without_name(reason: str, data: str) -> str:
    """A reason without the name of its data at the beginning: the caller shows it before the reason."""
    return reason.removeprefix(f"run {data}: ").removeprefix(f"{data}: ")


def _no_calibration_error(record: Record, sensor: str, passed_over: Mapping[str, str]) -> RecordError:
    first = next((f"{data}: {reason}" for data, reason in passed_over.items()), "")
    reasons = f" This model cannot use its runs: {first}" if first else ""
    sensor_names = sensors(record.runs())
    nearest = "" if sensor in sensor_names else did_you_mean(sensor, sensor_names)
    return RecordError(f"no calibration of the sensor {sensor!r} in the record.{reasons}{nearest}")


def _calibration(record: Record, data: str, run: Run, model: Model) -> Calibration:
    """Raises CalibrationError where the run does not determine the model."""
    check_kind(run.kind, data)  # a night at rest is gigabytes of samples
    date = date_of(run)
    table = MeasuredRun.named(record, data).table()
    fitted = fit(model, table)
    values = {
        result_name(term.effect, e.name, e.axis): ParameterValue(e.value, e.std, e.unit)
        for term, e in fitted.model.all_estimates
        if e.identified and e.std
    }
    if len(values) < len(fitted.theta):
        raise DataError(f"{table.source}: does not determine every parameter of {model.name}")
    expired = str(run.constants[EXPIRED]) if EXPIRED in run.constants else None
    rig = str(run.bench.get("name", "")) or "elsewhere"
    return Calibration(data, date, rig, values, expired, run.procedure, fitted.pooled_excess)


def date_of(run: Run) -> datetime:
    """The date of the measurement. Raises DataError for an invalid constant `date`."""
    created, stated_date = datetime.fromisoformat(run.created), run.constants.get("date")
    try:
        moment = created if stated_date is None else datetime.fromisoformat(str(stated_date))
    except ValueError:
        raise DataError(f"run {run.run}: its constant date is {stated_date!r}; write it as 2025-03-01") from None
    return moment if moment.tzinfo else moment.replace(hour=moment.hour or 12, tzinfo=created.tzinfo)


def run_date(run: Run) -> datetime:
    """The date of a run. A run with an invalid date is passed over later, with a message."""
    try:
        return date_of(run)
    except DataError:
        return datetime.fromisoformat(run.created)


def _quantity(name: str, calibrations: Sequence[Calibration], limit: Limit | None, baseline: int) -> Quantity:
    determined = tuple(calibration for calibration in calibrations if name in calibration.values)
    values = [calibration.values[name] for calibration in determined]
    numbers, stds = [calibration.value for calibration in values], [calibration.std for calibration in values]
    days = [calibration.at.timestamp() / 86400 for calibration in determined]
    least_sigma = float(rms(np.array(stds[:baseline])))
    chart = control_chart(numbers, baseline, least_sigma) if len(determined) >= FEWEST_RUNS else None
    no_drift = _no_drift_text(determined, float(np.ptp(days)))
    line = None if no_drift else fit_stability(days, numbers, stds)
    limits = None
    if limit is not None:
        limits = limit if isinstance(limit, tuple) else (numbers[-1] - limit, numbers[-1] + limit)
    due = line.due_days(*limits) if line is not None and limits is not None else None
    due_date = None if due is None else datetime.fromtimestamp(due * 86400, tz=determined[-1].at.tzinfo).date()
    return Quantity(name, values[0].unit, determined, chart, line, limits, due_date, no_drift)


def _no_drift_text(calibrations: Sequence[Calibration], days: float) -> str:
    """Why these calibrations have no drift; "" where they have one."""
    if len(calibrations) < FEWEST_FOR_DRIFT:
        return f"A drift needs {FEWEST_FOR_DRIFT} calibrations at different times."
    if days < SHORTEST_FOR_DRIFT_DAYS:
        return f"A drift needs calibrations over {SHORTEST_FOR_DRIFT_DAYS:.0f} days; these are of {days:.2g} days."
    if not all(calibration.complete for calibration in calibrations):
        return "A drift needs a complete model."
    return ""


# Limits that set the next calibration: from the bench file and from options.


def limits_of(bench_file: Path | None) -> dict[str, Limit]:
    """The ranges in the bench file's `limits.results`; a magnitude does not limit a change. Raises BenchError."""
    if bench_file is None:
        return {}
    return {name: limit for name, limit in read_bench(bench_file).result_limits.items() if isinstance(limit, tuple)}


def changes(texts: Iterable[str]) -> dict[str, float]:
    """`bias-x=0.005`: the greatest change since the last calibration, by result's name. Raises RigError."""
    return dict(_change(text) for text in texts)


def _change(text: str) -> tuple[str, float]:
    name, _, number = text.partition("=")
    try:
        change = abs(float(number))
    except ValueError:
        change = math.nan
    if not math.isfinite(change):
        raise RigError(f"the limit {text!r} is not valid: write NAME=CHANGE, as in bias-x=0.005")
    return name, change
