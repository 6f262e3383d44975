"""sweep: the drift of its reference pose, where it has one."""

from __future__ import annotations

import numpy as np

from procedures.sweep import REFERENCE
from rig.record import Record, Run
from rig.results.result import Result

SECONDS = 3600.0  # an hour
FEWEST = 3  # visits that tell a trend from scatter


def evaluate(record: Record, run: Run) -> dict[str, Result]:
    """Trend of the outputs at the reference pose, V/h, with the standard error that its scatter gives."""
    if not run.settings.get("reference_every"):
        return {}
    visits = [k.dwell for k in record.kept(run.run) if k.pose == REFERENCE and k.excluded is None]
    if len(visits) < FEWEST:
        return {}
    hours = np.array([dwell.t_s for dwell in visits]) / SECONDS
    away = hours - hours.mean()
    results = {}
    for axis in (axis for axis in "xyz" if f"v{axis}" in visits[0].means):
        volts = np.array([dwell.means[f"v{axis}"] for dwell in visits])
        trend = float(away @ volts / (away @ away))
        left = volts - volts.mean() - trend * away
        std = np.sqrt(left @ left / (len(visits) - 2) / (away @ away))
        results[f"reference-drift-{axis}"] = Result(trend, "V/h", float(std))
    return results
