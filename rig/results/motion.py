"""motion: errors of the linear and the physical model, both fitted to the sweep of the run, relative to the
displacement sensor.
"""

from __future__ import annotations

from calibrations.analyses.motion import MotionResult, evaluate_motion, fit_physical, linear_from_turns
from procedures.motion import SWEEP
from rig.record.measured import Measured
from rig.results.result import Result

NAMES = ("rmse-linear-x", "rmse-physical-x", "improvement-x", "noise-limit-x", "amplitude", "frequency")


def evaluate(measured: Measured) -> dict[str, Result]:
    """rmse-linear-x, rmse-physical-x, noise-limit-x and amplitude in mm/s^2, improvement-x, frequency in Hz.

    Raises SensorFault for a reading outside the curve of the displacement sensor; RecordError or DataError if a part of
    the run is missing.
    """
    results = beside_displacement(measured).results
    return {name: Result(q.value, "" if q.unit == "1" else q.unit, q.std) for name, q in results.items()}


def beside_displacement(measured: Measured) -> MotionResult:
    """Both models compared with the displacement sensor, as in Ang Fig. 12. Raises as `evaluate`."""
    sweep = measured.part("poses", SWEEP)
    return evaluate_motion(measured.table(), linear_from_turns(sweep), fit_physical(sweep), measured.part("still"))
