"""The columns of poses that are only planned: angles, mounting, time, and the temperature where an oven makes it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from calibrations.table import Array, Table
from rig.planning.plan import Plan

PAUSE_S = 60.0  # from the end of the data to the beginning of the next run, at least
OVEN_S = 1200.0  # in which an oven with what is in it comes near to its set point


def columns(planned: Plan, data: Table) -> dict[str, Array]:
    """The columns of a planned run's poses: angles, side, mounting, time after `data`, temperature, length."""
    poses = [held.pose for held in planned.held]
    names = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
    made = {name: np.array([getattr(pose, name) for pose in poses], dtype=float) for name in names}
    dwell_s = np.array([_dwell_s(planned.settings, pose.path) for pose in poses])
    since_s = np.array([held.start_s for held in planned.held]) + dwell_s / 2
    made["t_s"] = float(data.time_s.max()) + PAUSE_S + since_s
    if "temperature_c" in data and {"oven_c", "temperatures_c"} & {k for k, v in planned.settings.items() if v}:
        last_c = float(data.column("temperature_c")[data.order[-1]])
        made["temperature_c"] = _temperature_c(planned, last_c, since_s)
    return made | ({"dwell_s": dwell_s} if "sample_rate_hz" in data.constants else {})


def _dwell_s(settings: Mapping[str, Any], path: str) -> float:
    """How long a pose is recorded: blocks of a hold, else dwells."""
    return float(settings["block_s" if path.startswith("hold") and "block_s" in settings else "dwell_s"])


def _temperature_c(planned: Plan, last_c: float, since_s: Array) -> Array:
    """The sensor's temperature, from what it was last on its way to what the oven is set to (of first order)."""
    now_c, at_s, course = last_c, 0.0, []
    for held, t_s in zip(planned.held, since_s, strict=True):
        now_c += (_oven_c(planned.settings, held.pose.path) - now_c) * -np.expm1(-(t_s - at_s) / OVEN_S)
        at_s = t_s
        course.append(now_c)
    return np.array(course)


def _oven_c(settings: Mapping[str, Any], path: str) -> float:
    """The set point at a pose: that of a soak, or of the step of a cycle, which its path names."""
    return float(settings["oven_c"] if "oven_c" in settings else path.split()[1])
