"""noise-floor: rms and peak-to-peak noise of each axis, and the inclination that it hides."""

from __future__ import annotations

import numpy as np

from calibrations.errors import DataError
from calibrations.noise_floor import hidden_inclination_deg, rms
from procedures.noise_floor import STILL
from rig.record import Kept
from rig.record.measured import Measured
from rig.results.result import Result

PEAK_TO_PEAK = 4  # x rms: Ang V
UPRIGHT_DEG = {"x": (0.0, 180.0), "y": (90.0, 270.0)}  # beta at +1 g and at -1 g
NAMES = ("noise-rms-{axis}", "noise-pp-{axis}", "inclination-{axis}")


def evaluate(measured: Measured) -> dict[str, Result]:
    """V, and deg for the inclination. Raises DataError where the still record, or a pose at +-1 g, is missing."""
    upright: list[Kept] = []
    still: list[Kept] = []
    for kept in measured.kept():
        (still if kept.pose.path.startswith(STILL) else upright).append(kept)
    if not still:
        raise DataError(f"run {measured.run.run} holds no still record yet; `rig resume` goes on with it")
    first, results = still[0].samples, {}
    for axis, betas in UPRIGHT_DEG.items():
        if (channel := f"v{axis}") not in first.channels:
            continue
        k = first.channels.index(channel)
        value, std = rms([kept.samples.volts[:, k] for kept in still])
        plus, minus = (_output(upright, channel, beta_deg) for beta_deg in betas)
        inclination = hidden_inclination_deg(PEAK_TO_PEAK * value, (plus - minus) / 2)
        results[f"noise-rms-{axis}"] = Result(value, "V", std)
        results[f"noise-pp-{axis}"] = Result(PEAK_TO_PEAK * value, "V", PEAK_TO_PEAK * std)
        results[f"inclination-{axis}"] = Result(inclination, "deg", inclination * std / value if value else None)
    return results


def _output(upright: list[Kept], channel: str, beta_deg: float) -> float:
    found = [kept.dwell.means[channel] for kept in upright if kept.pose.beta_deg == beta_deg]
    if not found:
        raise DataError(f"there is no pose at alpha 90, beta {beta_deg:g} deg; `rig show RUN --poses` lists those kept")
    return float(np.mean(found))
