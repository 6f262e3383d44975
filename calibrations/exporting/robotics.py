"""Matrices for robots and gait analysis: imu_calib (ROS), imu_tk and imucal.

imu_calib  YAML: SM x - bias, in m/s^2; SM row by row
imu_tk     text: T K (x - B); T has ones on its diagonal, K is diagonal
imucal     JSON: accelerometer R^-1 K^-1 (x - b); gyroscope R^-1 K^-1 (x - K_ga a - b)

Source  the readers of these programs; Ferraris, Grimaldi and Parvis, Sensors and Materials 7 (1995), for imucal.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from calibrations.errors import ModelError
from calibrations.exporting.linear_form import FULL, LinearForm, Outputs, export_form, fit_form, outputs_in
from calibrations.exporting.simulated import ExportedFile, SimulatedSensor
from calibrations.table import AXES, Array

ACCELEROMETER, GYROSCOPE = "g", "deg/s"
G_SENSITIVITY = "gyro-g-sensitivity"
GYROSCOPE_OFFSET = "imu_calib measures the offset of the gyroscope at its start; the file has the accelerometer only."


def imu_calib(sensors: Sequence[SimulatedSensor], comment: str) -> ExportedFile:
    """The YAML file of imu_calib."""
    outputs, form = _accelerometer(sensors, "imu_calib")
    bias = form.matrix @ form.offsets[0]
    text = f"# {comment}\nSM: {_row(form.matrix.ravel())}\nbias: {_row(bias)}\n"
    return export_form(outputs, form, text, (GYROSCOPE_OFFSET,))


def imu_tk(sensors: Sequence[SimulatedSensor], comment: str) -> ExportedFile:  # noqa: ARG001 the format has no comments
    """The text file of imu_tk: T (3 x 3), K (3 x 3), B."""
    outputs, form = _accelerometer(sensors, "imu_tk")
    gains = np.diag(form.matrix)
    blocks = [form.matrix / gains, np.diag(gains)]
    rows = ["\n".join(" ".join(map(_number, row)) for row in block) for block in blocks]
    text = "\n\n".join([*rows, "\n".join(map(_number, form.offsets[0]))]) + "\n"
    return export_form(outputs, form, text)


def imucal(sensors: Sequence[SimulatedSensor], comment: str) -> ExportedFile:
    """The JSON file of imucal; it needs an accelerometer and a gyroscope."""
    by_unit = {sensor.unit: sensor for sensor in sensors}
    if set(by_unit) != {ACCELEROMETER, GYROSCOPE} or len(sensors) != len(by_unit):
        raise ModelError("imucal: a file holds an accelerometer and a gyroscope; give two models, one of each")
    acceleration = outputs_in(by_unit[ACCELEROMETER], "m/s^2", "imucal")
    rate = outputs_in(by_unit[GYROSCOPE], "rad/s", "imucal")
    forms = [fit_form(outputs, FULL) for outputs in (acceleration, rate)]
    document: dict[str, object] = {"cal_type": "Ferraris", "_format_version": "2.0.0", "comment": comment}
    document |= {"acc_unit": "m/s^2", "gyr_unit": "rad/s", "from_acc_unit": "m/s^2", "from_gyr_unit": "rad/s"}
    for letter, form in zip("ag", forms, strict=True):
        forward = np.linalg.inv(form.matrix)
        gains = np.linalg.norm(forward, axis=1)
        document |= {f"K_{letter}": np.diag(gains).tolist(), f"R_{letter}": (forward / gains[:, None]).tolist()}
        document[f"b_{letter}"] = form.offsets[0].tolist()
    document["K_ga"] = _acceleration_response(rate).tolist()
    parts = [export_form(acceleration, forms[0]), export_form(rate, forms[1], held_effects=(G_SENSITIVITY,))]
    return ExportedFile.of_parts(json.dumps(document, indent=1) + "\n", parts)


def _acceleration_response(rate: Outputs) -> Array:
    """Output of the gyroscope in rad/s by specific force in m/s^2, (3, 3)."""
    simulated = rate.simulated
    sensitivity = np.zeros((3, 3))
    for i, axis in enumerate(AXES):
        for k, input_axis in enumerate(AXES):
            sensitivity[i, k] = simulated.model.value(f"{G_SENSITIVITY}.{input_axis}.{axis}")
    return sensitivity * rate.factor / simulated.gravity_m_s2


def _accelerometer(sensors: Sequence[SimulatedSensor], program: str) -> tuple[Outputs, LinearForm]:
    if len(sensors) != 1 or sensors[0].unit != ACCELEROMETER:
        raise ModelError(f"{program}: a file holds one accelerometer; give its model only")
    outputs = outputs_in(sensors[0], "m/s^2", program)
    return outputs, fit_form(outputs, FULL)


def _row(values: Array) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _number(value: float) -> str:
    """The number with a decimal point: YAML readers take 4e-6 for text."""
    return f"{value:.12e}"
