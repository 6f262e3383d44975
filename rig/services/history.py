"""A sensor's calibrations over its life: each complete run of it that determines a model, in the order of time.

A calibration is derived from its samples anew, by one model for all, and so comparable. Its date is that of the run;
of an imported table the constant `date` that the file carries (`# date: 2025-03-01`), else the day of the import.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta

import numpy as np

from calibrations.analyses.control_chart import Chart, control_chart
from calibrations.analyses.stability import Stability, fit_stability
from calibrations.criteria import BASELINE_RUNS, FEWEST_FOR_DRIFT, FEWEST_RUNS
from calibrations.errors import CalibrationError, DataError
from calibrations.fit import fit
from calibrations.model import Model
from calibrations.noise.means import rms
from calibrations.presentation.certificate.terms import name as result_name
from calibrations.problem import check_kind
from drivers.errors import did_you_mean
from rig.bench.certificates import EXPIRED
from rig.errors import RecordError
from rig.record import Record, Run
from rig.record.measured import Measured
from rig.services.sensors import members, sensors

STALE_DAYS = 365.0  # where no limit says when a calibration is due
Limit = float | tuple[float, float]


@dataclass(frozen=True)
class Value:
    """One parameter of one calibration."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class Calibration:
    """One run's parameters by the names of certificates. `at` is its date and time."""

    data: str
    at: datetime
    rig: str
    values: Mapping[str, Value]
    expired: str | None

    @property
    def day(self) -> str:
        return self.at.date().isoformat()


@dataclass(frozen=True)
class Quantity:
    """One parameter over all calibrations that have it; `chart` and `line` None where they are too few."""

    name: str
    unit: str
    of: tuple[Calibration, ...]
    chart: Chart | None
    line: Stability | None
    allowed: tuple[float, float] | None
    due: date | None

    @property
    def last(self) -> Value:
        return self.of[-1].values[self.name]


@dataclass(frozen=True)
class History:
    """A sensor's life. `passed_over` are runs of it that are no calibration by this model, and why."""

    sensor: str
    model: str
    calibrations: tuple[Calibration, ...]
    quantities: tuple[Quantity, ...]
    passed_over: Mapping[str, str]

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
    tell: Callable[[str], None] = lambda _: None,
) -> History:
    """The history of `sensor` by `model`, see `judged`; `tell` hears which run is calibrated.

    Raises RecordError where the record has no calibration of it, naming the nearest sensor.
    """
    found: list[Calibration] = []
    passed_over: dict[str, str] = {}
    runs = _runs(record, sensor)
    for k, (data, run) in enumerate(runs, 1):
        tell(f"Calibrating {data}, {k} of {len(runs)}")
        try:
            found.append(_calibration(record, data, run, model))
        except (CalibrationError, RecordError) as error:
            passed_over[data] = str(error)
    if not found:
        raise _none(record, sensor, passed_over)
    return judged(History(sensor, model.name, tuple(found), (), passed_over), limits, baseline)


def latest(record: Record, sensor: str, model: Model) -> Calibration:
    """The last calibration of `sensor` alone: those before it are not fitted. Raises RecordError as `history`."""
    passed_over: dict[str, str] = {}
    for data, run in reversed(_runs(record, sensor)):
        try:
            return _calibration(record, data, run, model)
        except (CalibrationError, RecordError) as error:
            passed_over[data] = str(error)
    raise _none(record, sensor, passed_over)


def judged(life: History, limits: Mapping[str, Limit], baseline: int = BASELINE_RUNS) -> History:
    """The same calibrations by other limits, and charts of another baseline. `limits` by result's name: a number is the
    greatest change since the last calibration, a pair the lowest and highest value."""
    of = life.calibrations
    names = dict.fromkeys(name for calibration in of for name in calibration.values)
    return replace(life, quantities=tuple(_quantity(name, of, limits.get(name), baseline) for name in names))


def closest(of: Sequence[Calibration], on: date) -> tuple[Calibration, float]:
    """The calibration closest to a day, and by how many days it is older than that day; below 0: later."""
    noon = datetime(on.year, on.month, on.day, 12, tzinfo=of[0].at.tzinfo)
    days = [(noon - each.at) / timedelta(days=1) for each in of]
    best = int(np.argmin(np.abs(days)))
    return of[best], days[best]


def stale(found: History, calibration: Calibration, age_days: float) -> str | None:
    """Why a calibration does not hold for a day so much later (or earlier), or None."""
    day = calibration.at + timedelta(days=age_days)
    last = calibration is found.calibrations[-1]
    if last and found.due is not None and day.date() > found.due:
        return f"it was due on {found.due}"
    if abs(age_days) > STALE_DAYS:
        return f"it is {abs(age_days):.0f} days {'older' if age_days > 0 else 'younger'} than that day"
    return None


def _runs(record: Record, sensor: str) -> list[tuple[str, Run]]:
    """The complete runs of a sensor in the order of time, each with its name as data, such as `RUN/a1`."""
    complete = sorted((run for run in record.runs() if run.state == "complete"), key=when)
    of = [(members(run).get(sensor), run) for run in complete]
    return [(f"{run.run}/{member}" if member else run.run, run) for member, run in of if member is not None]


def _none(record: Record, sensor: str, passed_over: Mapping[str, str]) -> RecordError:
    reasons = f" Its runs are none by this model: {next(iter(passed_over.values()))}" if passed_over else ""
    known = sensors(record.runs())
    nearest = "" if sensor in known else did_you_mean(sensor, known)
    return RecordError(f"no calibration of the sensor {sensor!r} in the record.{reasons}{nearest}")


def _calibration(record: Record, data: str, run: Run, model: Model) -> Calibration:
    """Raises CalibrationError where the run does not determine the model."""
    check_kind(run.kind, data)  # a night at rest is gigabytes of samples
    at = date_of(run)
    table = Measured.named(record, data).table()
    found = fit(model, table)
    values = {
        result_name(term.effect, e.name, e.axis): Value(e.value, e.std, e.unit)
        for term in found.model.terms
        for e in term.estimates
        if e.identified and e.std
    }
    if len(values) < len(found.theta):
        raise DataError(f"{table.source}: does not determine every parameter of {model.name}")
    expired = str(run.constants[EXPIRED]) if EXPIRED in run.constants else None
    return Calibration(data, at, str(run.bench.get("name", "")) or "elsewhere", values, expired)


def date_of(run: Run) -> datetime:
    """When the sensor was as the run found it. Raises DataError for a constant `date` that is none."""
    said = run.constants.get("date")
    try:
        at = datetime.fromisoformat(str(said)) if said is not None else datetime.fromisoformat(run.created)
    except ValueError:
        raise DataError(f"run {run.run}: its constant date is {said!r}; write it as 2025-03-01") from None
    return at if at.tzinfo else at.replace(hour=at.hour or 12, tzinfo=datetime.fromisoformat(run.created).tzinfo)


def when(run: Run) -> datetime:
    """Its date; a run whose date is none is passed over later, which says so."""
    try:
        return date_of(run)
    except DataError:
        return datetime.fromisoformat(run.created)


def _quantity(name: str, of: Sequence[Calibration], limit: Limit | None, baseline: int) -> Quantity:
    mine = tuple(each for each in of if name in each.values)
    values = [each.values[name] for each in mine]
    numbers, stds = [each.value for each in values], [each.std for each in values]
    days = [each.at.timestamp() / 86400 for each in mine]
    chart = control_chart(numbers, baseline, float(rms(np.array(stds)))) if len(mine) >= FEWEST_RUNS else None
    line = fit_stability(days, numbers, stds) if len(mine) >= FEWEST_FOR_DRIFT and np.ptp(days) > 0 else None
    allowed = None
    if limit is not None:
        allowed = limit if isinstance(limit, tuple) else (numbers[-1] - limit, numbers[-1] + limit)
    due = line.due_days(*allowed) if line is not None and allowed is not None else None
    when = None if due is None else datetime.fromtimestamp(due * 86400, tz=mine[-1].at.tzinfo).date()
    return Quantity(name, values[0].unit, mine, chart, line, allowed, when)
