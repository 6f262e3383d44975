"""Two runs, or two sensors, by one model: the fits of both, and their measurements at the poses that both have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.discovery.results import FittedModel
from calibrations.fit import Fit
from calibrations.table import Array, Table
from rig.errors import RecordError
from rig.services.load import loaded
from rig.services.request import Request

POSE = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")  # what a pose is, as far as it is known
SAME_DECIMALS = 2  # of a degree: nearer, gravity along an axis differs by 0.2 mg at most


@dataclass(frozen=True)
class Again:
    """What was measured at the same poses in two tables: rows (k,) of both, the visits of a pose in their order.

    `difference` is the second less the first, in the outputs' unit, of shape (channels, k); `floor` the white noise of
    such a difference, per channel.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    difference: Array
    floor: Array


def both(first: Request, second: Request, tell: Callable[[str], None]) -> tuple[FittedModel, FittedModel]:
    """One model fitted to both: that of the first request, or of its kind of data.

    Raises RecordError where they are of two kinds, and what `loaded` and `fit` raise.
    """
    one, other = loaded(first, tell), loaded(second, tell)
    if one.data.content != other.data.content:
        raise RecordError(
            f"{first.data} is of {one.data.content}, {second.data} of {other.data.content}: no model describes both; "
            "mark two of one kind in the record"
        )
    return one.data.fit(one.model), other.data.fit(one.model)


def again(first: Fit, second: Fit) -> Again | None:
    """The poses that both have; None where there are none, or the orientations are not known."""
    if not first.table.type.stage_angles or first.channels != second.channels:
        return None
    there = _visits(second.table)
    rows = [(row, there[visit]) for visit, row in _visits(first.table).items() if visit in there]
    if not rows:
        return None
    one, other = (np.array(side) for side in zip(*rows, strict=True))
    difference = (second.table.outputs[other] - first.table.outputs[one]).T
    return Again(one, other, difference, np.hypot(first.noise.floor, second.noise.floor))


def _visits(table: Table) -> dict[tuple[float, ...], int]:
    """The row of every pose and number of its visit."""
    columns = np.column_stack([table.optional(name, 0.0) for name in POSE])
    seen: dict[tuple[float, ...], int] = {}
    found = {}
    for row, pose in enumerate(map(tuple, np.round(columns, SAME_DECIMALS) + 0.0)):
        seen[pose] = seen.get(pose, 0) + 1
        found[*pose, float(seen[pose])] = row
    return found
