"""Parameter files of autopilots: PX4 and ArduPilot.

Both correct readings in m/s^2, rad/s and gauss, before they turn the sensor's axes into those of the vehicle.

PX4        accelerometer (x - T - OFF) SCALE; gyroscope x - T - OFF; magnetometer S (x - OFF)
           T = X0 + X1 d + X2 d^2 + X3 d^3, d = t - TREF, t limited to TMIN .. TMAX
ArduPilot  accelerometer (x - P(t) + P(tc) - OFFS) SCAL; gyroscope x - P(t) + P(tc) - OFFS; P = p1 d + p2 d^2 + p3 d^3,
           d = t - 35 limited as above, tc CALTEMP, p in 1e-6; magnetometer M (x + OFS), in mgauss

Source  PX4: the library sensor_calibration, temperature_compensation; ArduPilot: AP_InertialSensor,
        AP_InertialSensor_tempcal, AP_Compass.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.errors import ModelError
from calibrations.exporting.linear_form import (
    DIAGONAL,
    OFFSETS,
    SYMMETRIC,
    LinearForm,
    Outputs,
    export_form,
    fit_form,
    outputs_in,
)
from calibrations.exporting.simulated import ExportedFile, Loss, SimulatedSensor
from calibrations.table import Array

Value = float | int
UNIT = {"g": "m/s^2", "deg/s": "rad/s", "field": "gauss"}
KIND = {"g": DIAGONAL, "deg/s": OFFSETS, "field": SYMMETRIC}
CUBIC = 3
PAIRS = ((0, 1), (0, 2), (1, 2))
FLOAT, INTEGER = 9, 6  # MAVLink's types of parameters
PX4_IGNORES = 0.01  # m/s^2, rad/s, gauss or parts of 1: PX4 does not apply a smaller change (norm of three axes)
PX4_SCALES, ARDUPILOT_SCALES = (0.1, 3.0), (0.8, 1.2)
ARDUPILOT_OFFSETS = 3.5  # m/s^2
ARDUPILOT_T0 = 35.0
AXIS_NAMES = "XYZ"


@dataclass(frozen=True)
class Slot:
    """The place of a sensor in the autopilot: `number` 0 is the first. `device_id`: as the autopilot reports it."""

    number: int = 0
    device_id: int | None = None


def px4(sensors: Sequence[SimulatedSensor], slot: Slot) -> ExportedFile:
    """A file of parameters for QGroundControl: tab-separated vehicle, component, name, value, type."""
    sensor_parts = [_px4_sensor(_fit_form(sensor, "PX4", None), slot) for sensor in sensors]
    lines = ["# Onboard parameters: sensor calibration", "# Vehicle-Id Component-Id Name Value Type"]
    for values, _ in sensor_parts:
        for name, value in values.items():
            kind = INTEGER if isinstance(value, int) else FLOAT
            lines.append(f"1\t1\t{name}\t{_value_text(value)}\t{kind}")
    parts = [part for _, part in sensor_parts]
    return ExportedFile.of_parts("\n".join(lines) + "\n", parts, _identity_notes(slot, "PX4"))


def ardupilot(sensors: Sequence[SimulatedSensor], slot: Slot) -> ExportedFile:
    """A file of parameters for Mission Planner, QGroundControl and MAVProxy: NAME,VALUE."""
    sensor_parts = [_ardupilot_sensor(_fit_form(sensor, "ArduPilot", ARDUPILOT_T0), slot) for sensor in sensors]
    lines = [f"{name},{_value_text(value)}" for values, _ in sensor_parts for name, value in values.items()]
    parts = [part for _, part in sensor_parts]
    return ExportedFile.of_parts("\n".join(lines) + "\n", parts, _identity_notes(slot, "ArduPilot"))


def _fit_form(sensor: SimulatedSensor, program: str, t0: float | None) -> tuple[Outputs, LinearForm]:
    outputs = outputs_in(sensor, UNIT[sensor.unit], program)
    degree = 0 if program == "ArduPilot" and sensor.unit == "field" else CUBIC
    return outputs, fit_form(outputs, KIND[sensor.unit], degree, t0).rounded()


def _px4_sensor(fitted: tuple[Outputs, LinearForm], slot: Slot) -> tuple[Mapping[str, Value], ExportedFile]:
    outputs, form = fitted
    unit, n = outputs.simulated.unit, slot.number
    sensor = {"g": "ACC", "deg/s": "GYRO", "field": "MAG"}[unit]
    values: dict[str, Value] = {} if slot.device_id is None else {f"CAL_{sensor}{n}_ID": slot.device_id}
    values |= {f"CAL_{sensor}{n}_{axis}OFF": form.offsets[0, i] for i, axis in enumerate(AXIS_NAMES)}
    scales = np.diag(form.matrix)
    if unit != "deg/s":
        _check_range("PX4", outputs, "scale", scales, PX4_SCALES)
        values |= {f"CAL_{sensor}{n}_{axis}SCALE": scales[i] for i, axis in enumerate(AXIS_NAMES)}
    if unit == "field":
        pairs = zip(AXIS_NAMES, PAIRS, strict=True)
        values |= {f"CAL_MAG{n}_{axis}ODIAG": form.matrix[pair] for axis, pair in pairs}
    if form.degree:
        values |= _px4_thermal(form, outputs.simulated, {"g": "A", "deg/s": "G", "field": "M"}[unit], slot)
    return values, export_form(outputs, form, ignored=list(_px4_ignored(outputs, form)))


def _px4_thermal(form: LinearForm, simulated: SimulatedSensor, letter: str, slot: Slot) -> Iterator[tuple[str, Value]]:
    """The coefficients of T without the constant, which is part of the offset."""
    n = slot.number
    low, high = simulated.spans["temperature_c"]
    yield f"TC_{letter}_ENABLE", 1
    if slot.device_id is not None:
        yield f"TC_{letter}{n}_ID", slot.device_id
    yield from {f"TC_{letter}{n}_TREF": form.t0, f"TC_{letter}{n}_TMIN": low, f"TC_{letter}{n}_TMAX": high}.items()
    for order in range(CUBIC + 1):
        for i in range(3):
            yield f"TC_{letter}{n}_X{order}_{i}", form.offsets[order, i] if order else 0.0


def _px4_ignored(outputs: Outputs, form: LinearForm) -> Iterator[Loss]:
    """Corrections that PX4 reads and does not apply, because they are small."""
    offset, scales = form.offsets[0], np.diag(form.matrix)
    unit, reason = outputs.simulated.unit, f"PX4 does not apply changes up to {PX4_IGNORES:g}"
    if 0 < np.linalg.norm(offset) <= PX4_IGNORES:
        size = np.abs(form.matrix @ offset) / outputs.per
        yield Loss("offset", f"{reason} {outputs.unit}", float(size.max()), float(size.max()), unit)
    if unit != "deg/s" and 0 < np.linalg.norm(scales - 1) <= PX4_IGNORES:
        size = np.abs((scales - 1) * outputs.a / outputs.per)
        rms = float(np.sqrt(np.mean(size**2, axis=0)).max())
        yield Loss("scale", f"{reason}", rms, float(size.max()), unit)


def _ardupilot_sensor(fitted: tuple[Outputs, LinearForm], slot: Slot) -> tuple[Mapping[str, Value], ExportedFile]:
    outputs, form = fitted
    unit, k = outputs.simulated.unit, slot.number + 1
    if unit == "field":
        return _ardupilot_compass(form, slot), export_form(outputs, form)
    sensor, number = ("ACC" if unit == "g" else "GYR"), (str(k) if k > 1 else "")
    prefix = f"INS_{sensor}{number}"
    caltemp = float(np.mean(outputs.simulated.spans["temperature_c"])) if form.degree else None
    offsets = form.offsets[0] + (_polynomial(form, caltemp) if caltemp is not None else 0.0)
    values: dict[str, Value] = {} if slot.device_id is None else {f"{prefix}_ID": slot.device_id}
    if unit == "g":
        _check_range("ArduPilot", outputs, "offset", offsets, (-ARDUPILOT_OFFSETS, ARDUPILOT_OFFSETS))
        _check_range("ArduPilot", outputs, "scale", np.diag(form.matrix), ARDUPILOT_SCALES)
    values |= {f"{prefix}OFFS_{axis}": offsets[i] for i, axis in enumerate(AXIS_NAMES)}
    if unit == "g":
        values |= {f"{prefix}SCAL_{axis}": form.matrix[i, i] for i, axis in enumerate(AXIS_NAMES)}
    if caltemp is not None:
        low, high = outputs.simulated.spans["temperature_c"]
        values |= {f"INS_TCAL{k}_ENABLE": 1, f"INS_TCAL{k}_TMIN": low, f"INS_TCAL{k}_TMAX": high}
        values[f"INS_{sensor}{k}_CALTEMP"] = caltemp
        for order in range(1, CUBIC + 1):
            for i, axis in enumerate(AXIS_NAMES):
                values[f"INS_TCAL{k}_{sensor}{order}_{axis}"] = 1e6 * form.offsets[order, i]
    return values, export_form(outputs, form, notes=_gyroscope_note(unit))


def _gyroscope_note(unit: str) -> tuple[str, ...]:
    if unit != "deg/s":
        return ()
    return ("ArduPilot measures the gyroscope's offsets again at each start; set INS_GYR_CAL to 0 to keep these.",)


def _ardupilot_compass(form: LinearForm, slot: Slot) -> Mapping[str, Value]:
    """Offsets in mgauss, which ArduPilot adds; the matrix with ones where it changes nothing."""
    number = "" if slot.number == 0 else str(slot.number + 1)
    values: dict[str, Value] = {} if slot.device_id is None else {f"COMPASS_DEV_ID{number}": slot.device_id}
    values |= {f"COMPASS_OFS{number}_{axis}": -1e3 * form.offsets[0, i] for i, axis in enumerate(AXIS_NAMES)}
    values |= {f"COMPASS_DIA{number}_{axis}": form.matrix[i, i] for i, axis in enumerate(AXIS_NAMES)}
    values |= {f"COMPASS_ODI{number}_{axis}": form.matrix[pair] for axis, pair in zip(AXIS_NAMES, PAIRS, strict=True)}
    return values | {f"COMPASS_SCALE{number}": 0.0}


def _polynomial(form: LinearForm, t: float) -> Array:
    """C(t) without its constant."""
    d = t - form.t0
    return np.asarray(sum(form.offsets[k] * d**k for k in range(1, form.degree + 1)))


def _check_range(program: str, outputs: Outputs, quantity: str, values: Array, span: tuple[float, float]) -> None:
    for axis, value in zip("xyz", values, strict=True):
        if not span[0] <= value <= span[1]:
            raise ModelError(
                f"{outputs.simulated.model.name}: {program} accepts {quantity} from {span[0]:g} to "
                f"{span[1]:g}, but that of {axis} is {value:.4g}; check the sensor and the unit of its data, "
                f"{outputs.simulated.model.unit}"
            )


def _identity_notes(slot: Slot, program: str) -> tuple[str, ...]:
    if slot.device_id is not None:
        return ()
    advice = f"load the file only into the vehicle where this sensor is number {slot.number + 1}"
    return (f"No device ID: {advice}, or give --device-id, as {program} reports it.",)


def _value_text(value: Value) -> str:
    return str(value) if isinstance(value, int) else f"{float(np.float32(value)):.9g}"
