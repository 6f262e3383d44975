"""Axes of a still record in another unit than its output's: as what is sensed, where its scale factor is known."""

from __future__ import annotations

from dataclasses import dataclass

from calibrations.still.record import Still
from calibrations.table import MILLI


@dataclass(frozen=True)
class Scaled:
    """Values of a channel are drawn `factor` times as large, in `unit`."""

    factor: float
    unit: str


def scaled(still: Still, axis: str, in_sensed: bool) -> Scaled:
    """The output's own unit; or thousandths of what is sensed, as noise is small."""
    sensed = still.sensed.get(axis)
    if sensed is None or not in_sensed:
        return Scaled(1.0, still.unit)
    if sensed.unit not in MILLI:
        return Scaled(sensed.factor, sensed.unit)
    return Scaled(1e3 * sensed.factor, MILLI[sensed.unit])


def units(still: Still) -> dict[bool, str]:
    """What all of its axes can be drawn in."""
    names = {each.unit for each in still.sensed.values()}
    known = set(still.sensed) == set(still.axes) and len(names) == 1
    return {False: still.unit} | ({True: names.pop()} if known else {})
