"""Displacement of the carriage out of the channel d63, by the calibration that the run's bench file carries.

It grows towards the sensor's +x. The converter samples the channels of one scan in turn; by how much the sensor's axes
come after the displacement goes with the table.
"""

from __future__ import annotations

from calibrations.table import Array
from rig.bench import D63, Bench
from rig.errors import RecordError
from rig.record.values import Run

UM = 1e-6
AXES = ("vx", "vy", "vz")


def displacement_m(run: Run, volts: Array) -> Array:
    """Displacement of each sample, m, shape (n,); zero lies anywhere.

    Raises SensorFault for a reading outside the curve, RecordError where the run's bench has no curve.
    """
    sensor = Bench.model_validate(run.bench).d63
    if sensor is None:
        raise RecordError(f"run {run.run}: its bench has no d63, the displacement sensor's curve")
    return sensor.direction * UM * sensor.curve.displacement_um(volts, sensor.side)


def constants(run: Run, sensor: str | None) -> dict[str, str | float]:
    """Which calibration of which displacement sensor, and by how much later than it each axis is sampled, s."""
    bench = Bench.model_validate(run.bench)
    if bench.d63 is None:
        return {}
    adc, prefix = bench.instruments["adc"].typed_settings(), f"{sensor}." if sensor else ""
    there = {axis: f"{prefix}{axis}" for axis in AXES if f"{prefix}{axis}" in adc.channels}
    skews = {f"skew_{axis[1]}_s": round(adc.lag_s(channel) - adc.lag_s(D63), 9) for axis, channel in there.items()}
    return {"d63_serial": bench.d63.curve.serial, "d63_calibrated": bench.d63.curve.date, **skews}
