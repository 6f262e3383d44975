"""Two runs, or two sensors, by one model: the fits of both, and their measurements at the poses that both have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.fit import Fit, fit
from calibrations.still import fit as still_fit
from calibrations.still.fit import NoiseFit
from calibrations.table import Array, Table
from rig.analysis.asked import asked
from rig.analysis.asked_still import asked_still
from rig.analysis.request import Request
from rig.errors import RecordError

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


def both(first: Request, second: Request, tell: Callable[[str], None]) -> tuple[Fit, Fit] | tuple[NoiseFit, NoiseFit]:
    """One model fitted to both: the one that is asked for, or that of their kind. Raises RecordError where they are of
    two kinds, and what `asked`, `asked_still` and `fit` raise."""
    still, other_still = asked_still(first, tell), asked_still(second, tell)
    if still is not None and other_still is not None:
        return still_fit.fit(still.model, still.still), still_fit.fit(still.model, other_still.still)
    if still is not None or other_still is not None:
        names = (first.data, second.data) if still is not None else (second.data, first.data)
        raise _unlike(names, "a still record", "none")
    (table, model, _), (other, _, _) = asked(first, tell), asked(second, tell)
    if table.content != other.content:
        raise _unlike((first.data, second.data), f"of {table.content}", f"of {other.content}")
    return fit(model, table), fit(model, other)


def again(first: Fit, second: Fit) -> Again | None:
    """The poses that both have; None where there are none, or the orientations are not known."""
    if first.table.kind != "poses" or first.channels != second.channels:
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


def _unlike(names: tuple[str, str], one: str, other: str) -> RecordError:
    return RecordError(
        f"{names[0]} is {one}, {names[1]} is {other}: no model describes both; mark two of one kind in the record"
    )
