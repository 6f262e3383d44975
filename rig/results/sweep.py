"""sweep: the drift of its reference pose, where it has one."""

from __future__ import annotations

import numpy as np

from calibrations.analyses.stability import fit_trend
from calibrations.criteria import FEWEST_FOR_DRIFT
from procedures.instruments import output_channel
from procedures.sweep import REFERENCE
from rig.record.measured import Measured
from rig.record.tables import units_of
from rig.results.result import Result

HOUR_S = 3600.0
NAMES = ("reference-drift-{axis}",)


def evaluate(measured: Measured) -> dict[str, Result]:
    """Trend of the outputs at the reference pose, an hour, with the standard error that its scatter gives."""
    if not measured.run.settings.get("reference_every"):
        return {}
    visits = [kept.dwell for kept in measured.kept() if kept.pose.path == REFERENCE.path]
    if len(visits) < FEWEST_FOR_DRIFT:
        return {}
    hours = np.array([dwell.t_s for dwell in visits]) / HOUR_S
    results = {}
    for axis in "xyz":
        if (channel := output_channel(axis, visits[0].means)) is None:
            continue
        drift, std = fit_trend(hours, np.array([dwell.means[channel] for dwell in visits]))
        unit = units_of(measured.run, [channel]).get(channel, "V")
        results[f"reference-drift-{axis}"] = Result(drift, f"{unit}/h", std)
    return results
