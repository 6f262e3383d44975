"""Comparison of two runs, or of two sensors of a run: results, parameters, and measurements at the same poses.

`deviations` is the difference divided by its standard uncertainty, with both uncertainties independent: above 2 it is
unlikely to be chance (E_n of ISO/IEC 17043 is half of it).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.findings import FittedModel
from calibrations.fitting.fit import Fit
from calibrations.model import Estimate
from calibrations.table import Array, Table
from rig.errors import RecordError
from rig.record import Run
from rig.services.load import load_request
from rig.services.request import Request

DIFFERENT = 2.0  # standard uncertainties


@dataclass(frozen=True)
class Pair:
    """One quantity of both, in `unit`."""

    name: str
    unit: str
    first: float
    second: float
    first_std: float | None
    second_std: float | None

    @property
    def difference(self) -> float:
        """The second minus the first."""
        return self.second - self.first

    @property
    def std(self) -> float | None:
        """Standard uncertainty of the difference; None if neither uncertainty is known."""
        return hypot(self.first_std or 0.0, self.second_std or 0.0) or None

    @property
    def deviations(self) -> float | None:
        """The difference in standard uncertainties."""
        return None if self.std is None else self.difference / self.std

    @property
    def differ(self) -> bool:
        """Whether the difference is significant."""
        return self.deviations is not None and abs(self.deviations) > DIFFERENT


def results_of(first: Run, second: Run, sensors: tuple[str, str] = ("", "")) -> list[Pair]:
    """Results that both runs have; of a batch, the results of the named sensors."""
    first_results, second_results = (
        _results_of_sensor(run.results, sensor) for run, sensor in zip((first, second), sensors, strict=True)
    )
    return [
        Pair(name, a["unit"], a["value"], b["value"], a["std"], b["std"])
        for name, a in first_results.items()
        if (b := second_results.get(name)) is not None and a["unit"] == b["unit"]
    ]


def parameters_of(first: FittedModel, second: FittedModel) -> list[Pair]:
    """The parameters of one model that was fitted to both."""
    second_parameters = dict(_estimates(second))
    return [
        Pair(name, a.unit, a.value, b.value, a.std, b.std)
        for name, a in _estimates(first)
        if (b := second_parameters.get(name)) is not None and a.identified and b.identified
    ]


def _results_of_sensor(results: Mapping[str, Any], sensor: str) -> Mapping[str, Any]:
    """The results of one sensor, without its name; for all sensors unchanged."""
    if not sensor:
        return results
    return {name.rpartition("/")[2]: result for name, result in results.items() if name.startswith(f"{sensor}/")}


def _estimates(fit: FittedModel) -> Iterator[tuple[str, Estimate]]:
    for term in fit.model.terms:
        for estimate in term.estimates:
            yield " ".join(dict.fromkeys(filter(None, (term.name, estimate.name, estimate.axis)))), estimate


# One model fitted to both, and the measurements at common poses.


POSE = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")  # the columns that define a pose
ANGLE_DECIMALS = 2  # of a degree: nearer, gravity along an axis differs by 0.2 mg at most


@dataclass(frozen=True)
class RepeatedPoses:
    """Measurements at the same poses in two tables: rows (k,) of both, the visits of a pose in their order.

    `difference` is the second minus the first, in the outputs' unit, of shape (channels, k); `floor` the white noise of
    such a difference, per channel.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    difference: Array
    floor: Array


def fit_both(first: Request, second: Request, notify: Callable[[str], None]) -> tuple[Dataset[Any], Any, Any]:
    """(the data of the first, and one model fitted to both: that of the first request, or of its kind of data).

    Raises RecordError if the two runs have different kinds of data. Errors of `load_request` and `fit` pass through.
    """
    first_loaded, second_loaded = load_request(first, notify), load_request(second, notify)
    if first_loaded.data.content != second_loaded.data.content:
        raise RecordError(
            f"{first.data} is of {first_loaded.data.content}, {second.data} of {second_loaded.data.content}: "
            "no model describes both; choose two runs of one kind"
        )
    return first_loaded.data, first_loaded.data.fit(first_loaded.model), second_loaded.data.fit(first_loaded.model)


def match_poses(first: Fit, second: Fit) -> RepeatedPoses | None:
    """The poses of both; None without any, or if the orientations are not known."""
    if not first.table.type.stage_angles or first.channels != second.channels:
        return None
    visits = _visits(second.table)
    rows = [(row, visits[visit]) for visit, row in _visits(first.table).items() if visit in visits]
    if not rows:
        return None
    first_rows, second_rows = (np.array(side) for side in zip(*rows, strict=True))
    difference = (second.table.outputs[second_rows] - first.table.outputs[first_rows]).T
    return RepeatedPoses(first_rows, second_rows, difference, np.hypot(first.noise.floor, second.noise.floor))


def _visits(table: Table) -> dict[tuple[float, ...], int]:
    """The row of every pose and number of its visit."""
    columns = np.column_stack([table.optional(name, 0.0) for name in POSE])
    visits: dict[tuple[float, ...], int] = {}
    rows = {}
    for row, pose in enumerate(map(tuple, np.round(columns, ANGLE_DECIMALS) + 0.0)):
        visits[pose] = visits.get(pose, 0) + 1
        rows[*pose, float(visits[pose])] = row
    return rows
