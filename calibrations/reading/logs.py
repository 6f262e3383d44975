"""A raw log as the table of what it holds: means of dwells, of rests and turns, or of still positions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from calibrations.errors import MissingConstant
from calibrations.reading.directions import one_for_each_direction
from calibrations.reading.dwells import is_pose_log, pose_means
from calibrations.reading.sessions import is_log, section_means
from calibrations.reading.stills import is_raw_log, positions
from calibrations.table import Constant, Table

RATE_NAMES = ("fs", "sample rate", "sampling rate", "sample frequency", "sampling frequency", "odr")


def means(log: Table) -> Table:
    """The table itself where its rows are means. Raises DataError where nothing holds still; MissingConstant."""
    if is_pose_log(log):
        return pose_means(log)
    if is_raw_log(log) and log.content == "fields":
        return one_for_each_direction(log)
    if is_log(log):
        return section_means(log)
    return positions(log, _rate_hz(log)) if is_raw_log(log) else log


def _rate_hz(log: Table) -> float:
    """Samples a second. Raises MissingConstant where the log does not say."""
    by_time = "t_s" in log and np.ptp(log.time_s) > 0
    rate_hz = (log.n - 1) / float(np.ptp(log.time_s)) if by_time else log.number("sample_rate_hz", 0.0)
    if rate_hz > 0:
        return rate_hz
    name, likely = _likely_rate(log.constants)
    needed = f"the column t_s, or a line such as `# sample_rate_hz: {likely or 100:g}` above its header"
    said = f'; its "{name}" may say so' if likely else ""
    told = f"in `rig import`, --constant sample_rate_hz={likely or 100:g}"
    raise MissingConstant(f"{log.source}: a raw log needs {needed} ({told}){said}", "sample_rate_hz", likely)


def _likely_rate(constants: Mapping[str, Constant]) -> tuple[str, float | None]:
    """What others call the rate of samples, and its value."""
    for name, value in constants.items():
        if name.lower().replace("_", " ") in RATE_NAMES and isinstance(value, float) and value > 0:
            return name, value
    return "", None
