"""Results from single samples: the noise at rest (noise-floor), and models in vibration (motion)."""

from __future__ import annotations

import numpy as np

from calibrations.analyses.motion import MotionResult, evaluate_motion, fit_physical, linear_from_turns
from calibrations.analyses.noise_floor import hidden_inclination_deg, noise_rms
from calibrations.errors import DataError
from calibrations.geometry.orientation import UPRIGHT_DEG
from procedures.instruments import output_channel
from procedures.motion import SWEEP
from procedures.noise_floor import STILL
from rig.record import KeptPose
from rig.record.measured import MeasuredRun
from rig.record.tables import units_of
from rig.results.result import Missing, Result, evaluates

PEAK_TO_PEAK = 4  # x rms: Ang V


@evaluates("noise-floor")
def noise_floor(measured: MeasuredRun) -> dict[str, Result | Missing]:
    """Noise in the unit of the outputs, inclination in deg. The inclination needs the poses at +1 g and -1 g.

    Raises DataError without a still record.
    """
    upright: list[KeptPose] = []
    still: list[KeptPose] = []
    for recorded in measured.kept():
        (still if recorded.pose.path.startswith(STILL) else upright).append(recorded)
    if not still:
        raise DataError(f"run {measured.run.run} has no still record yet; `rig resume` continues it")
    first, results = still[0].samples, dict[str, Result | Missing]()
    for axis in UPRIGHT_DEG:
        if (channel := output_channel(axis, first.channels)) is None:
            continue
        k, unit = first.channels.index(channel), units_of(measured.run, [channel]).get(channel, "V")
        value, std = noise_rms([recorded.samples.volts[:, k] for recorded in still])
        results[f"noise-rms-{axis}"] = Result(value, unit, std)
        results[f"noise-pp-{axis}"] = Result(PEAK_TO_PEAK * value, unit, PEAK_TO_PEAK * std)
        results[f"inclination-{axis}"] = _inclination(upright, axis, channel, value, std)
    return results


def _inclination(upright: list[KeptPose], axis: str, channel: str, rms: float, std: float) -> Result | Missing:
    outputs = []
    for beta_deg in UPRIGHT_DEG[axis]:
        at_pose = [recorded.dwell.means[channel] for recorded in upright if recorded.pose.beta_deg == beta_deg]
        if not at_pose:
            return Missing(f"there is no pose at alpha 90, beta {beta_deg:g} deg; `rig show RUN --poses` lists all")
        outputs.append(float(np.mean(at_pose)))
    plus, minus = outputs
    if plus == minus:
        return Missing("the output is the same at both poses; check that it is connected, and measure again")
    inclination = hidden_inclination_deg(PEAK_TO_PEAK * rms, (plus - minus) / 2)
    return Result(inclination, "deg", inclination * std / rms if rms else None)


@evaluates("motion")
def motion(measured: MeasuredRun) -> dict[str, Result]:
    """rmse-linear-x, rmse-physical-x, noise-limit-x and amplitude in mm/s^2, improvement-x, frequency in Hz.

    Raises SensorFault for a reading outside the curve of the displacement sensor; RecordError or DataError if a part of
    the run is missing.
    """
    results = compare_with_displacement(measured).results
    return {name: Result(q.value, "" if q.unit == "1" else q.unit, q.std) for name, q in results.items()}


def compare_with_displacement(measured: MeasuredRun) -> MotionResult:
    """Both models compared with the displacement sensor, as in Ang Fig. 12. Raises as `motion`."""
    sweep = measured.part("poses", SWEEP)
    return evaluate_motion(measured.table(), linear_from_turns(sweep), fit_physical(sweep), measured.part("still"))
