"""level-check: the tilt of the table and the offset of the level, from two readings half a turn apart."""

from __future__ import annotations

from math import hypot

from procedures.level_check import reversal
from rig.record.measured import Measured
from rig.results.result import Result

OF_THE_BENCH = True
NAMES = ("level-{axis}", "level-offset-{axis}", "base-{axis}", "base-offset-{axis}")


def evaluate(measured: Measured) -> dict[str, Result]:
    """Tilt of the table or of the base along x and y of the level, and the offset of the level, deg."""
    readings = {reading.name: reading for reading in measured.readings()}
    what = "base" if measured.run.settings.get("on") == "base" else "level"
    results = {}
    for axis in "xy":
        front, back = readings[f"{what}-front-{axis}"], readings[f"{what}-back-{axis}"]
        std = hypot(front.std, back.std) / 2 if front.std is not None and back.std is not None else None
        tilt_deg, offset_deg = reversal(front.value, back.value)
        results[f"{what}-{axis}"] = Result(tilt_deg, "deg", std)
        results[f"{what}-offset-{axis}"] = Result(offset_deg, "deg", std)
    return results
