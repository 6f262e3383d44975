"""A model before any data: its own values, or those of a usual sensor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibrations.design.expected import SAMPLE_STD_V, assume_sensor
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit
from calibrations.model.file import read_model
from tests.calibrations.synthetic import components, poses, turns

CONSTANTS = {"sample_rate_hz": 1000.0, "approach_deg": 5.0}
POSES = turns((90, 45), step_deg=30.0)


def test_a_shipped_model_has_a_sensor_of_1_v_per_g() -> None:
    found = assume_sensor(read_model("linear"), POSES, CONSTANTS)
    assert list(found.theta) == [0, 0, 1, 1]
    assert found.channels == ("x", "y")
    assert not found.residual.any()
    assert np.allclose(found.noise.white, SAMPLE_STD_V)


def test_what_is_0_without_a_value_is_taken_at_its_usual_size() -> None:
    model = read_model("linear").with_effect(catalogue()["hysteresis"])
    found = assume_sensor(model, POSES, CONSTANTS)
    heights = found.theta[of_parameter(found, "height")]
    assert np.all(heights > 0)
    forgotten = of_parameter(found, "begin")  # all elements slip on the way to the first of these poses
    assert np.all((np.linalg.norm(found.jacobian, axis=(0, 1)) > 0) | forgotten)  # each parameter does something


def test_a_fitted_model_keeps_its_values() -> None:
    x, y, _ = components(POSES)
    fitted = fit(read_model("linear"), poses(POSES, 2.5 + 1.01 * x, 2.4 + 0.98 * y, seed=None))
    assert np.array_equal(assume_sensor(fitted.model, POSES, CONSTANTS).theta, fitted.theta)


def test_temperature_stands_where_the_model_refers_to() -> None:
    columns = {**POSES, "temperature_c": np.linspace(30, 40, len(POSES["t_s"]))}
    x, y, _ = components(POSES)
    model = read_model("linear").with_effect(catalogue()["temperature-bias"])
    made = poses(columns, 2.5 + x, 2.5 + y)
    found = assume_sensor(fit(model, made).model, POSES, CONSTANTS)
    assert np.allclose(found.table.column("temperature_c"), 35)
    assert not found.jacobian[:, :, of_parameter(found, "slope")].any()


def of_parameter(found: Fit, name: str) -> NDArray[np.bool_]:
    return np.array([slot.parameter.name == name for slot in found.problem.layout.slots])
