"""Comparison of two calibrations: of two days, two sensors, or two rigs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from calibrations.analyses.stability import Agreement, compare_values
from calibrations.errors import DataError
from calibrations.means.noise import rms
from drivers.errors import did_you_mean
from rig.errors import RecordError
from rig.services.history import Calibration, History, ParameterValue, closest


@dataclass(frozen=True)
class CalibrationComparison:
    """`one` and `other` for people; unit and agreement of every quantity that both have, by its name. `data`: the two
    runs, None of means over several."""

    one: str
    other: str
    rows: Mapping[str, tuple[str, Agreement]]
    data: tuple[str, str] | None = None

    @property
    def agree(self) -> bool:
        """Whether all quantities agree."""
        return all(agreement.agrees for _, agreement in self.rows.values())


def compare_sensors(life: History, other_sensor: str, last: Calibration) -> CalibrationComparison:
    """The last calibrations of two sensors. Raises DataError, see `compare`."""
    own_last = life.calibrations[-1]
    return CalibrationComparison(
        f"{life.sensor}, {own_last.day}",
        f"{other_sensor}, {last.day}",
        compare(own_last, last),
        (own_last.data, last.data),
    )


def compare_days(life: History, first_day: date, second_day: date) -> CalibrationComparison:
    """The calibrations closest to two days. Raises DataError, see `compare`."""
    a, b = (closest(life.calibrations, day)[0] for day in (first_day, second_day))
    return CalibrationComparison(a.day, b.day, compare(a, b), (a.data, b.data))


def compare_rigs(calibrations: Sequence[Calibration], first_rig: str, second_rig: str) -> CalibrationComparison:
    """The means of all calibrations on two rigs. Raises RecordError for a rig that has none."""
    return CalibrationComparison(
        first_rig,
        second_rig,
        _compare_parameters(
            _means_on(first_rig, calibrations), _means_on(second_rig, calibrations), first_rig, second_rig
        ),
    )


def compare(a: Calibration, b: Calibration) -> dict[str, tuple[str, Agreement]]:
    """Unit and agreement of each quantity that both calibrations have, by name. Raises DataError if there is none."""
    return _compare_parameters(a.values, b.values, a.data, b.data)


def _means_on(rig: str, calibrations: Sequence[Calibration]) -> dict[str, ParameterValue]:
    on_rig = [calibration for calibration in calibrations if calibration.rig == rig]
    if not on_rig:
        raise RecordError(
            f"no calibration on the rig {rig!r}.{did_you_mean(rig, {calibration.rig for calibration in calibrations})}"
        )
    return {
        name: _mean([calibration.values[name] for calibration in on_rig if name in calibration.values])
        for name in on_rig[-1].values
    }


def _compare_parameters(
    a: Mapping[str, ParameterValue], b: Mapping[str, ParameterValue], first_name: str, second_name: str
) -> dict[str, tuple[str, Agreement]]:
    shared = [name for name in a if name in b and a[name].unit == b[name].unit]
    if not shared:
        raise DataError(f"{first_name} and {second_name} have no quantity in common; take a model that both determine")
    return {n: (a[n].unit, compare_values((a[n].value, a[n].std), (b[n].value, b[n].std))) for n in shared}


def _mean(values: Sequence[ParameterValue]) -> ParameterValue:
    """The mean. Its uncertainty has the calibrations' own, which may be common to all, and their scatter."""
    x = np.array([value.value for value in values])
    std = float(rms(np.array([value.std for value in values])))
    scatter = float(x.std(ddof=1) / np.sqrt(len(x))) if len(x) > 1 else 0.0
    return ParameterValue(float(x.mean()), max(std, scatter), values[0].unit)
